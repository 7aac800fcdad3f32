"""Study: reliability of the judgement. Writes docs/studies.md: `python -m docs.make_judgement`.

From the kept rows of `auvid campaign judgement` (`--results results/campaigns/judgement` reads and keeps new ones), and
from faults planted one by one into data of each manoeuvre, with white angles, a minute on one core.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from auvid_cli.config.enums import FilterName
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.evaluation.judgement import judge
from auvid_cli.identification.run import identify
from auvid_cli.report.table import filter_label
from auvid_cli.simulation.simulate import simulate
from docs.campaign_rows import campaign_rows, results_option
from docs.section import replace_section

_MANOEUVRES = ("spiral", "multisine", "doublets", "zigzag_10_10", "zigzag_20_20", "turning_circle")
_COLUMNS = ["run", "kind", "case", "attitude", "filter", "seed", "name", "grade", "true", "estimate", "identified"]
_COLUMNS += ["standard_deviation", "corrected_standard_deviation", "total_standard_deviation", "processor_time"]
# Standard deviations: an estimate all of whose coefficients are nearer to the truth is right, one beyond is wrong.
_RIGHT, _WRONG = 3.0, 5.0


def _late(sensor: str, delay: float) -> Callable[[Dataset], Dataset]:
    def change(dataset: Dataset) -> Dataset:
        record = dataset.sensors[sensor]
        inside = record.time + delay < dataset.inputs.time[-1]
        later = replace(record, time=record.time[inside] + delay, values=record.values[inside])
        return replace(dataset, sensors=dataset.sensors | {sensor: later})

    return change


def _changed(sensor: str, factor: float, offset: float) -> Callable[[Dataset], Dataset]:
    def change(dataset: Dataset) -> Dataset:
        record = dataset.sensors[sensor]
        other = replace(record, values=factor * record.values + offset)
        return replace(dataset, sensors=dataset.sensors | {sensor: other})

    return change


def _held(dataset: Dataset) -> Dataset:
    time = dataset.inputs.time
    kept = np.searchsorted(time, np.floor(10.0 * time + 1e-6) / 10.0 - 1e-6)
    return replace(dataset, inputs=replace(dataset.inputs, values=dataset.inputs.values[kept]))


_FAULTS: dict[str, Callable[[Dataset], Dataset]] = {
    "gyroscope 2 ms late": _late("gyroscope", 0.002),
    "inputs held at 10 Hz": _held,
    "gyroscope biased by 0.05 deg/s": _changed("gyroscope", 1.0, np.deg2rad(0.05)),
    "DVL 20 ms late": _late("dvl", 0.02),
    "DVL 0.1 % too fast": _changed("dvl", 1.001, 0.0),
}


def planted(manoeuvre: str, seed: int) -> list[str]:
    """Plant each fault into data of a manoeuvre: a row for each, with the verdict."""
    overrides = f"seed={seed}", f"manoeuvre=manoeuvres/{manoeuvre}.yaml", "sensors.attitude.source=direct"
    clean, rows = simulate(load_experiment(find_experiment(None), overrides)), []
    for fault, change in _FAULTS.items():
        dataset = change(clean)
        estimate = identify(dataset, FilterName.SMOOTHER)
        worst = max(estimate.faults, key=lambda test: abs(test.z))
        true = clean.truth.coefficients if clean.truth else {}
        found = estimate.final_coefficients()
        by_data, total = (
            max(abs(found[symbol] - true[symbol]) / deviations[symbol] for symbol in found if symbol in true)
            for deviations in (estimate.data_deviations(), estimate.final_deviations())
        )
        grade = judge([estimate])[estimate.filter].grade
        name = str(worst.fault).replace("|", r"\|")
        rows.append(f"| {manoeuvre} | {fault} | {by_data:.3g} | {total:.3g} | {grade} | {name} | {abs(worst.z):.3g} |")
    return rows


def judged(runs: pd.DataFrame, coefficients: pd.DataFrame) -> list[str]:
    """Return for each filter and attitude how many runs are right, and how many of these are judged sound."""
    rows = []
    for (attitude, name), own in runs.groupby(["attitude", "filter"], sort=False):
        errors = coefficients[coefficients["run"].isin(own["run"])]
        largest = errors.groupby("run")["error"].max().reindex(own["run"]).fillna(np.inf)
        sound = own["grade"].eq("sound").to_numpy()
        right, wrong = (largest <= _RIGHT).to_numpy(), (largest > _WRONG).to_numpy()
        kept = errors[errors["run"].isin(own["run"][sound]) & errors["identified"].eq(True)]["error"]
        counts = own["grade"].value_counts()
        others = ", ".join(f"{counts[grade]} {grade}" for grade in counts.index if grade != "sound")
        rows.append(
            f"| {attitude} | {filter_label(str(name))} | {len(own)} | {right.sum()} | {(right & sound).sum()} "
            f"| {wrong.sum()} | {(wrong & sound).sum()} | {(kept <= 2.0).mean():.1%} | {kept.max():.3g} | {others} |"
        )
    return rows


def main() -> None:
    """Run everything and write the section."""
    parser = results_option(__doc__)
    parser.add_argument("--seed", type=int, default=201, help="of the data into which faults are planted")
    options = parser.parse_args()
    rows = campaign_rows("judgement", options.results, columns=_COLUMNS)
    faults = [row for manoeuvre in _MANOEUVRES for row in planted(manoeuvre, options.seed)]
    lines = [
        rows.summary(),
        f"They have {rows.runs['case'].nunique()} pairs of vehicle and manoeuvre. Right: all coefficients within",
        f"{_RIGHT:g} standard deviations of the truth; wrong: one beyond {_WRONG:g}, or no result. Standard deviations",
        "are those from the data, corrected for correlated errors where the estimator does so. `within 2 sd` and",
        "`largest / sd` count the identified coefficients of sound runs.",
        "",
        "| attitude | filter | runs | right | right and sound | wrong | wrong and sound | within 2 sd | largest / sd "
        "| not sound |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |",
        *judged(rows.runs, rows.coefficients),
        "",
        f"One planted fault in each run, white angles, seed {options.seed}: its effect, verdict and named fault.",
        f"{sum('| sound |' in row for row in faults)} of {len(faults)} estimates are called sound.",
        "",
        "| manoeuvre | planted fault | largest error / sd from data | / total sd | verdict | named fault | its z |",
        "| --- | --- | ---: | ---: | --- | --- | ---: |",
        *faults,
    ]
    replace_section("judgement", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
