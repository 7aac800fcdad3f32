"""What comes of a log from the field, over seeds, into docs/studies.md: `python -m docs.make_field`, some ten minutes.

Each seed has a survey, a disturbance and a vehicle file of its own; with each is done what docs/own-log.md does, but
for the noise, which is as it was tuned there on the first of them.
"""

import argparse
import re
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import auvid_cli as auvid
from auvid_cli.api.judgement import judge
from auvid_cli.api.logs import suggest_map
from auvid_cli.api.simulation import simulate_log
from auvid_cli.config.load import dump_experiment, parse_run
from auvid_cli.data.dataset import Dataset
from docs.section import replace_section

TUTORIAL = Path(__file__).with_name("own-log.md")
_FENCE = re.compile(r"```yaml\n(.*?)```\n", re.DOTALL)
_TURNS = ("v", "r")


class Outcome(NamedTuple):
    """What one seed came to."""

    seed: int
    grade: str
    identified: dict[str, tuple[float, float]]
    vehicle_file: dict[str, tuple[float, float]]
    within: float | None
    worst: str
    sigmas: float


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


def outcome(seed: int, folder: Path) -> Outcome:
    """Go the tutorial's way with one seed."""
    experiment = auvid.load_experiment("field", f"seed={seed}")
    for name, text in simulate_log(experiment).items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "map.yaml").write_text(fill_in(suggest_map(sorted(folder.glob("*.csv")), folder)), encoding="utf-8")
    files = []
    for k, text in enumerate(settings()):
        files.append(folder / f"settings{k}.yaml")
        files[-1].write_text(text, encoding="utf-8")
    survey = auvid.import_logs(folder / "map.yaml")
    seen = _with(survey, *map(str, files), "identification.use.spans=[[0, 320]]")
    estimate = auvid.identify(seen, "smoother")
    true, deviations = experiment.vehicle.all_coefficients(), estimate.final_deviations()
    means = dict(zip(estimate.state, estimate.mean[-1].tolist(), strict=True))
    off = {symbol: abs(means[symbol] - true[symbol]) / deviations[symbol] for symbol in means if symbol in true}
    worst = max(off, key=lambda symbol: off[symbol])
    grade = judge(estimate)["smoother"].grade
    if not estimate.completed:
        # Nothing is predicted with it.
        return Outcome(seed, grade, {}, {}, None, worst, off[worst])
    unseen = _with(survey, *map(str, files), "identification.use.spans=[[321, null]]")
    rows = auvid.validate(unseen, estimate, training=seen).to_pandas()["validation"].query("signal in @_TURNS")
    ahead = rows.query("kind == 'ahead'")
    identified, vehicle_file = (
        {
            signal: (
                rows.query("signal == @signal and kind == 'free_run'")[which].item(),
                ahead.query("signal == @signal and horizon_s == 20")[which].item(),
            )
            for signal in _TURNS
        }
        for which in ("rmse", "vehicle_file_rmse")
    )
    within = float(np.average(ahead["share_within_band"], weights=ahead["measurements"]))
    return Outcome(seed, grade, identified, vehicle_file, within, worst, off[worst])


def _with(dataset: Dataset, *overrides: str) -> Dataset:
    return replace(dataset, experiment=parse_run(dump_experiment(dataset.experiment), "survey", overrides))


def _row(of: Outcome) -> str:
    pairs = ((of.identified, of.vehicle_file, signal, k) for k in (0, 1) for signal in _TURNS)
    errors = " | ".join(f"{ours[s][k]:.4f} | {theirs[s][k]:.4f}" if ours else " | " for ours, theirs, s, k in pairs)
    worst, within = of.worst.replace("|", r"\|"), "" if of.within is None else f"{100 * of.within:.0f}"
    return f"| {of.seed} | {of.grade} | {errors} | {within} | {of.sigmas:.1f} ({worst}) |"


def _summary(found: list[Outcome]) -> str:
    ended = [of for of in found if of.within is not None]
    free, ahead = (
        sum(all(of.identified[s][k] < of.vehicle_file[s][k] for s in _TURNS) for of in ended) for k in (0, 1)
    )
    held = sum(of.within is not None and 85 <= round(100 * of.within) <= 99 for of in found)
    counts = {
        "Better than the vehicle file in sway and yaw rate, in the free run": free,
        "20 s ahead": ahead,
        "Bands that hold 85 to 99 %": held,
        "No coefficient beyond 5 standard deviations": sum(of.sigmas <= 5.0 for of in found),
        "Called sound": sum(of.grade == "sound" for of in found),
    }
    return f"Of {len(found)} seeds. " + "; ".join(f"{what}: {count}" for what, count in counts.items()) + "."


def main() -> None:
    """Go through all seeds and write the section."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    found = []
    for seed in range(1, parser.parse_args().seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            found.append(outcome(seed, Path(folder)))
        print(_row(found[-1]), flush=True)
    lines = [
        _summary(found),
        "",
        "| seed | judged | sway, free | file's | yaw rate, free | file's | sway, 20 s | file's | yaw rate, 20 s "
        "| file's | within band % | largest error / sd |",
        "| ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |",
        *map(_row, found),
    ]
    replace_section("field", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
