"""Study: results from field logs over seeds. Writes docs/studies.md: `python -m docs.make_field`, half an hour.

Each seed has a survey, a disturbance and a vehicle file of its own, and goes through the steps of docs/own-log.md. Rows
are kept; finished seeds are not repeated.

For some seeds all coefficients are estimated as well, with the simulated noise: from the survey, which an autopilot
steered by the true motion, and from a run with the same fin angles but other disturbances, to which the fins do not
react.
"""

import json
import re
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

import auvid_cli as auvid
from auvid_cli.api.evaluation import judge
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import dump_experiment, parse_run
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.accuracy import coefficient_results
from auvid_cli.simulation.field_log import field_log
from docs.resumable import all_rows, asked_seeds
from docs.section import replace_section

TUTORIAL = Path(__file__).with_name("own-log.md")
_FENCE = re.compile(r"```yaml\n(.*?)```\n", re.DOTALL)
_TURNS = ("v", "r")
_OTHER_SEED = 2000  # added to a seed for other noise
_REPLAYED = 3  # surveys that are replayed

# Compared models, as columns of the table of a validation, and its rows of the free run and the prediction ahead.
_COMPARED = {"identified": "rmse", "vehicle_file": "vehicle_file_rmse"}
_KINDS = {"free": "kind == 'free_run'", "ahead": "kind == 'ahead' and horizon_s == 20"}


def settings() -> list[str]:
    """Return the settings that the tutorial identifies with, and the noise that it tunes, as texts of YAML."""
    return _FENCE.findall(TUTORIAL.read_text(encoding="utf-8"))


def survey_of(experiment: Experiment, folder: Path) -> Dataset:
    """Write the logs of an experiment with their map, and read them."""
    for name, text in field_log(auvid.simulate(experiment)).items():
        (folder / name).write_text(text, encoding="utf-8")
    chart = folder / "map.yaml"
    (folder / "lateral.yaml").write_text(settings()[0], encoding="utf-8")
    return with_settings(auvid.import_logs(chart), str(folder / "lateral.yaml"))


def replayed(experiment: Experiment, folder: Path) -> Experiment:
    """Return an experiment with the same fins at the same times, with other noise and other disturbances."""
    fins, manoeuvre = auvid.simulate(experiment).inputs, experiment.manoeuvre
    trim = [manoeuvre.fin_trim.rudder, manoeuvre.fin_trim.elevator, 0.0, 0.0]
    table = pd.DataFrame(fins.values + trim, columns=["rudder", "elevator", "surge_force", "roll_moment"])
    table.insert(0, "time", fins.time)
    (folder / "replayed").mkdir()
    table.to_csv(folder / "replayed/fins.csv", index=False)
    kept = manoeuvre.model_dump(
        mode="json", exclude_none=True, exclude={"type", "leg", "turn_rate", "autopilot", "name"}
    )
    kept |= {"type": "recorded", "file": str(folder / "replayed/fins.csv"), "initial_speed": manoeuvre.speed}
    return auvid.load_experiment("field", f"seed={experiment.seed + _OTHER_SEED}", f"manoeuvre={json.dumps(kept)}")


def all_of_it(experiment: Experiment, folder: Path) -> dict[str, object]:
    """Identify all coefficients, with the noise as it was simulated."""
    survey, pushed = survey_of(experiment, folder), json.dumps(experiment.manoeuvre.disturbance.model_dump(mode="json"))
    noise = "{velocity: 1e-5, rate: 1e-5, attitude: 1e-6, depth: 1e-6}"
    seen = with_settings(
        survey,
        f"identification.coefficients={json.dumps(list(experiment.vehicle.coefficient_set.symbols))}",
        f"identification.estimate.disturbance={pushed}",
        f"identification.process_noise={noise}",
        "identification.measurement_noise={attitude: 0.75, depth: 0.6}",
        "identification.use.spans=[[0, 320]]",
    )
    return _judged(experiment, auvid.identify(seen, "smoother"))


def _judged(experiment: Experiment, estimate: Estimate) -> dict[str, object]:
    true, deviations = experiment.vehicle.all_coefficients(), estimate.final_deviations()
    means = dict(zip(estimate.state, estimate.mean[-1].tolist(), strict=True))
    off = {symbol: abs(means[symbol] - true[symbol]) / deviations[symbol] for symbol in means if symbol in true}
    worst = max(off, key=lambda symbol: off[symbol])
    judgement = judge(estimate)["smoother"]
    return {"grade": judgement.grade.value, "status": estimate.status, "worst": worst, "sigmas": off[worst]}


def tuned_survey(experiment: Experiment, folder: Path) -> tuple[Dataset, Dataset]:
    """Return the survey of an experiment with the noise that its first 320 s ask for, and these alone."""
    survey = survey_of(experiment, folder)
    tuned = auvid.tune(with_settings(survey, "identification.use.spans=[[0, 320]]"))
    survey = replace(survey, experiment=tuned.experiment)
    return survey, with_settings(survey, "identification.use.spans=[[0, 320]]")


def doubts(_case: str, seed: int) -> pd.DataFrame:
    """Return a row for each coefficient of one seed: its error, and whether it is doubted or identified."""
    with tempfile.TemporaryDirectory() as folder:
        experiment = auvid.load_experiment("field", f"seed={seed}")
        _, seen = tuned_survey(experiment, Path(folder))
        estimate = auvid.identify(seen, "smoother")
    judgement, true = judge(estimate)["smoother"], experiment.vehicle.all_coefficients()
    rows = coefficient_results(estimate, None, {}, judgement)
    named = min((test for test in estimate.faults if test.rank), key=lambda test: test.rank, default=None)
    return pd.DataFrame(
        {
            "coefficient": [row.coefficient for row in rows],
            "true": [true[row.coefficient] for row in rows],
            "estimate": [row.estimate for row in rows],
            "data": [row.corrected_standard_deviation for row in rows],
            "total": [row.total_standard_deviation for row in rows],
            "identified": [row.identified for row in rows],
            "trusted": [judgement.trusts(row.coefficient) for row in rows],
            "grade": judgement.grade.value,
            "named": "" if named is None else str(named.fault),
            "doubted": judgement.row()[-1],
        }
    )


def doubt_table(rows: pd.DataFrame) -> list[str]:
    """Return a row for each seed."""
    lines = []
    for seed, own in rows.groupby("seed"):
        off = (own["estimate"] - own["true"]).abs() / own["total"]
        kept = own["trusted"].astype(bool)
        doubted = ", ".join(own["coefficient"][~kept]) if not kept.all() else "none"
        lines.append(
            f"| {seed} | {own['grade'].iloc[0]} | {own['named'].fillna('').iloc[0]} | {kept.sum()} of {len(own)} "
            f"| {doubted if kept.any() else 'all'} | {own['identified'].sum()} | {off.max():.1f} |".replace(
                "|u|", r"\|u\|"
            )
            .replace("|v|", r"\|v\|")
            .replace("|r|", r"\|r\|")
        )
    return lines


def outcome(seed: int, folder: Path) -> dict[str, object]:
    """Go through the steps of the tutorial with one seed; an estimate that did not complete predicts nothing."""
    experiment = auvid.load_experiment("field", f"seed={seed}")
    survey, seen = tuned_survey(experiment, folder)
    estimate = auvid.identify(seen, "smoother")
    row = _judged(experiment, estimate)
    if not estimate.completed:
        return row
    unseen = with_settings(survey, "identification.use.spans=[[321, null]]")
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


def found_of_all(case: str, seed: int) -> pd.DataFrame:
    """Look for all coefficients of one seed: a row."""
    with tempfile.TemporaryDirectory() as folder:
        experiment = auvid.load_experiment("field", f"seed={seed}")
        if case == "replayed":
            experiment = replayed(experiment, Path(folder))
        return pd.DataFrame([all_of_it(experiment, Path(folder))])


def with_settings(dataset: Dataset, *overrides: str) -> Dataset:
    """Return a dataset with overrides of its settings."""
    return replace(dataset, experiment=parse_run(dump_experiment(dataset.experiment), "survey", overrides))


def _cell(value: float, form: str) -> str:
    return "" if np.isnan(value) else format(value, form)


def _line(row: pd.Series) -> str:
    errors = " | ".join(
        _cell(row[f"{kind}_{what}_{signal}"], ".4f") for kind in _KINDS for signal in _TURNS for what in _COMPARED
    )
    return f"| {row['seed']} | {row['grade']} | {errors} | {_cell(100 * row['within'], '.0f')} | {_worst(row)} |"


def _worst(row: pd.Series) -> str:
    return f"{row['sigmas']:.1f} ({row['worst']})".replace("|", r"\|")


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
        "Bands that contain 85 to 99 % of the errors": rows["within"].round(2).between(0.85, 0.99).sum(),
        "No coefficient beyond 5 standard deviations": (rows["sigmas"] <= 5.0).sum(),
        "Called sound": (rows["grade"] == "sound").sum(),
    }
    return f"Of {len(rows)} seeds. " + "; ".join(f"{what}: {count}" for what, count in counts.items()) + "."


def write_doubts(seeds: int) -> None:
    """Do the seeds that are missing, and write the section on doubted coefficients from all kept seeds."""
    all_rows("field_doubts", [("field", seed) for seed in range(1, seeds + 1)], doubts)
    rows = all_rows("field_doubts", [], doubts).sort_values("seed", kind="stable")
    off = (rows["estimate"] - rows["true"]).abs() / rows["total"]
    whole = rows.groupby("seed")["trusted"].all()
    lines = [
        f"{len(whole)} seeds: no lateral coefficient is doubted in {whole.sum()}. Of {len(rows)} coefficients",
        f"{(off <= 2.0).mean():.1%} are within two total standard deviations, {(off > 5.0).sum()} beyond five;",
        f"{rows['identified'].sum()} are identified.",
        "",
        "| seed | judged | named | not doubted | doubted | identified | largest error / total sd |",
        "| ---: | --- | --- | ---: | --- | ---: | ---: |",
        *doubt_table(rows),
    ]
    replace_section("field doubts", "\n".join(lines), "studies")


def main() -> None:
    """Go through all seeds and write the section."""
    seeds = asked_seeds(__doc__, 20)
    rows = all_rows("field", [("field", seed) for seed in range(1, seeds + 1)], found).sort_values("seed")
    lines = [
        _summary(rows),
        "",
        "| seed | judged | sway, free | file's | yaw rate, free | file's | sway, 20 s | file's | yaw rate, 20 s "
        "| file's | within band % | largest error / sd |",
        "| ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |",
        *(_line(row) for _, row in rows.iterrows()),
    ]
    replace_section("field", "\n".join(lines), "studies")
    write_doubts(seeds)
    cases = [(case, seed) for seed in range(1, min(seeds, _REPLAYED) + 1) for case in ("steered", "replayed")]
    rows = all_rows("steered", cases, found_of_all).sort_values(["case", "seed"], ascending=False)
    lines = [
        "| fins | seed | judged | largest error / sd |",
        "| --- | ---: | --- | --- |",
        *(f"| {row['case']} | {row['seed']} | {row['grade']} | {_worst(row)} |" for _, row in rows.iterrows()),
    ]
    replace_section("steered", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
