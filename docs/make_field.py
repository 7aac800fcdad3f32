"""What comes of a log from the field, over seeds, into docs/studies.md: `python -m docs.make_field`, half an hour.

Each seed has a survey, a disturbance and a vehicle file of its own; with each is done what docs/own-log.md does. What
was found is kept in a file, line by line, and seeds that stand there are not done again.
"""

import re
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

import auvid_cli as auvid
from auvid_cli.api.judgement import judge
from auvid_cli.api.logs import suggest_map
from auvid_cli.api.simulation import simulate_log
from auvid_cli.config.load import dump_experiment, parse_run
from auvid_cli.data.dataset import Dataset
from docs.resumable import all_rows, asked
from docs.section import replace_section

TUTORIAL = Path(__file__).with_name("own-log.md")
_FENCE = re.compile(r"```yaml\n(.*?)```\n", re.DOTALL)
_TURNS = ("v", "r")


# What is compared, as a column of the tables of a validation, and what the free run and the prediction ahead are of.
_COMPARED = {"identified": "rmse", "vehicle_file": "vehicle_file_rmse"}
_KINDS = {"free": "kind == 'free_run'", "ahead": "kind == 'ahead' and horizon_s == 20"}


def settings() -> list[str]:
    """Return the settings that the tutorial identifies with, and the noise that it tunes, as texts of YAML."""
    return _FENCE.findall(TUTORIAL.read_text(encoding="utf-8"))


def fill_in(text: str) -> str:
    """Fill in what only the user knows of the tutorial's suggested map."""
    text = re.sub(r"(?m)^name: .*", "name: survey", text)
    text = re.sub(r"(?s)vehicle: #.*?\nlogs:", "vehicle: vehicle.yaml\nlogs:", text)
    for deviation in ("1 cm/s", "0.2 deg", "1 cm"):
        text = re.sub(r"standard_deviation: null.*", f"standard_deviation: {deviation}", text, count=1)
    return re.sub(r"# check: no column looks like thrust.*", "surge_force: {constant: 10 N}", text)


def outcome(seed: int, folder: Path) -> dict[str, object]:
    """Go the tutorial's way with one seed; an estimate that did not complete predicts nothing."""
    experiment = auvid.load_experiment("field", f"seed={seed}")
    for name, text in simulate_log(experiment).items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "map.yaml").write_text(fill_in(suggest_map(sorted(folder.glob("*.csv")), folder)), encoding="utf-8")
    (folder / "lateral.yaml").write_text(settings()[0], encoding="utf-8")
    survey = _with(auvid.import_logs(folder / "map.yaml"), str(folder / "lateral.yaml"))
    tuned = auvid.tune(_with(survey, "identification.use.spans=[[0, 320]]"))
    survey = replace(survey, experiment=tuned.experiment)
    seen = _with(survey, "identification.use.spans=[[0, 320]]")
    estimate = auvid.identify(seen, "smoother")
    true, deviations = experiment.vehicle.all_coefficients(), estimate.final_deviations()
    means = dict(zip(estimate.state, estimate.mean[-1].tolist(), strict=True))
    off = {symbol: abs(means[symbol] - true[symbol]) / deviations[symbol] for symbol in means if symbol in true}
    worst = max(off, key=lambda symbol: off[symbol])
    row: dict[str, object] = {"grade": judge(estimate)["smoother"].grade.value, "status": estimate.status}
    row |= {"worst": worst, "sigmas": off[worst]}
    if not estimate.completed:
        return row
    unseen = _with(survey, "identification.use.spans=[[321, null]]")
    rows = auvid.validate(unseen, estimate, training=seen).to_pandas()["validation"].query("signal in @_TURNS")
    for kind, query in _KINDS.items():
        for what, column in _COMPARED.items():
            for signal, value in rows.query(query).set_index("signal")[column].items():
                row[f"{kind}_{what}_{signal}"] = value
    ahead = rows.query("kind == 'ahead'")
    row["within"] = float(np.average(ahead["share_within_band"], weights=ahead["measurements"]))
    return row


def found(_case: str, seed: int) -> pd.DataFrame:
    """Do one seed: a row."""
    with tempfile.TemporaryDirectory() as folder:
        return pd.DataFrame([outcome(seed, Path(folder))])


def _with(dataset: Dataset, *overrides: str) -> Dataset:
    return replace(dataset, experiment=parse_run(dump_experiment(dataset.experiment), "survey", overrides))


def _cell(value: float, form: str) -> str:
    return "" if np.isnan(value) else format(value, form)


def _line(row: pd.Series) -> str:
    errors = " | ".join(
        _cell(row[f"{kind}_{what}_{signal}"], ".4f") for kind in _KINDS for signal in _TURNS for what in _COMPARED
    )
    worst = f"{row['sigmas']:.1f} ({row['worst']})".replace("|", r"\|")
    return f"| {row['seed']} | {row['grade']} | {errors} | {_cell(100 * row['within'], '.0f')} | {worst} |"


def _summary(rows: pd.DataFrame) -> str:
    free, ahead = (
        int(
            np.logical_and.reduce(
                [rows[f"{kind}_identified_{s}"] < rows[f"{kind}_vehicle_file_{s}"] for s in _TURNS]
            ).sum()
        )
        for kind in _KINDS
    )
    counts = {
        "Better than the vehicle file in sway and yaw rate, in the free run": free,
        "20 s ahead": ahead,
        "Bands that hold 85 to 99 %": rows["within"].round(2).between(0.85, 0.99).sum(),
        "No coefficient beyond 5 standard deviations": (rows["sigmas"] <= 5.0).sum(),
        "Called sound": (rows["grade"] == "sound").sum(),
    }
    return f"Of {len(rows)} seeds. " + "; ".join(f"{what}: {count}" for what, count in counts.items()) + "."


def main() -> None:
    """Go through all seeds and write the section."""
    seeds, file = asked(__doc__, "field", 20)
    rows = all_rows(file, [("field", seed) for seed in range(1, seeds + 1)], found).sort_values("seed")
    lines = [
        _summary(rows),
        "",
        "| seed | judged | sway, free | file's | yaw rate, free | file's | sway, 20 s | file's | yaw rate, 20 s "
        "| file's | within band % | largest error / sd |",
        "| ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |",
        *(_line(row) for _, row in rows.iterrows()),
    ]
    replace_section("field", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
