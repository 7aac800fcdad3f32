"""Inputs at 10 Hz, held and 50 ms late, over seeds, into docs/studies.md: `python -m docs.make_late`, two minutes.

The vehicle moves with inputs at 100 Hz; ten a second are recorded, and stamped 50 ms after they were given.
Rows are kept; finished seeds are not repeated.
"""

from dataclasses import asdict, dataclass, replace

import numpy as np
import pandas as pd

import auvid_cli as auvid
from auvid_cli.api.evaluation import judge
from auvid_cli.config.loading import dump_experiment, parse_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from docs.resumable import WIDE_PRIOR, all_rows, asked_seeds
from docs.section import replace_section

# s. The vehicle holds each input for 10 ms. Straight lines between records do not, so inputs act 5 ms later by them.
_LATE, _HELD = 0.05, 0.005
# Standard deviations beyond which a coefficient is wrong.
_WRONG = 5.0
_MANOEUVRES = ("zigzag_20_20",)
_RUN = (
    "manoeuvre.duration=60 s",
    "manoeuvre.recorded_rate=10 Hz",
    "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}",
    "sensors.gyroscope.rate=10 Hz",
    "sensors.dvl.rate=5 Hz",
)
_WAYS = {
    "as recorded": (),
    "straight lines": ("identification.inputs.between=linear",),
    "straight lines, delay estimated": (
        "identification.inputs.between=linear",
        "identification.estimate.biases=[delay]",
    ),
}


@dataclass(frozen=True)
class Outcome:
    """Result of a seed: grade, coefficient with the largest error, and estimated delay, ms."""

    grade: str
    sigmas: float
    delay: float | None = None
    deviation: float | None = None


def outcome(dataset: Dataset, *settings: str) -> Outcome:
    """Identify, and compare with the truth."""
    text = dump_experiment(dataset.experiment)
    try:
        estimate = auvid.identify(replace(dataset, experiment=parse_experiment(text, "late", settings)), "smoother")
    except DataError:
        return Outcome("refused", np.inf)
    grade = judge(estimate)["smoother"].grade.value
    if not estimate.completed:
        return Outcome(grade, np.inf)
    return Outcome(grade, _farthest(estimate, dataset), *_delay(estimate))


def _farthest(estimate: Estimate, dataset: Dataset) -> float:
    true = {} if dataset.truth is None else dataset.truth.coefficients
    found, deviations = estimate.final_coefficients(), estimate.final_deviations()
    return max(abs(found[symbol] - value) / deviations[symbol] for symbol, value in true.items())


def _delay(estimate: Estimate) -> tuple[float, ...]:
    if "delay_inputs" not in estimate.state:
        return ()
    row = estimate.state.index("delay_inputs")
    return 1e3 * float(estimate.mean[-1, row]), 1e3 * float(estimate.standard_deviation[-1, row])


def found(manoeuvre: str, seed: int) -> pd.DataFrame:
    """Identify one seed in each way: a row for each."""
    run = auvid.load_experiment("spiral", WIDE_PRIOR, f"seed={seed}", f"manoeuvre=manoeuvres/{manoeuvre}.yaml", *_RUN)
    dataset = auvid.simulate(run)
    late = replace(dataset, inputs=replace(dataset.inputs, time=dataset.inputs.time + _LATE))
    return pd.DataFrame([{"way": way, **asdict(outcome(late, *settings))} for way, settings in _WAYS.items()])


def _line(manoeuvre: str, way: str, rows: pd.DataFrame) -> str:
    right, sound = rows["sigmas"] <= _WRONG, rows["grade"] == "sound"
    counts = ", ".join(f"{count} {grade}" for grade, count in rows["grade"].value_counts().sort_index().items())
    errors = (rows["delay"] - 1e3 * (_HELD - _LATE)).abs().dropna()
    delay = f"{errors.max():.1f} ({rows['deviation'].median():.1f})" if len(errors) else ""
    median = rows["sigmas"].median()
    return f"| {manoeuvre} | {way} | {right.sum()} | {counts} | {(sound & ~right).sum()} | {median:.3g} | {delay} |"


def main() -> None:
    """Go through all seeds and write the section."""
    seeds = asked_seeds(__doc__, 20)
    runs = [(manoeuvre, seed) for seed in range(1, seeds + 1) for manoeuvre in _MANOEUVRES]
    rows = all_rows("late", runs, found)
    lines = [
        f"Seeds 1 to {rows['seed'].max()}. Right: no coefficient beyond {_WRONG:g} standard deviations.",
        "",
        "| manoeuvre | inputs | right | judged | wrong, but sound | largest error / sd, median "
        "| largest error of the delay, ms (its sd) |",
        "| --- | --- | ---: | --- | ---: | ---: | --- |",
        *(
            _line(str(case), way, rows[(rows["case"] == case) & (rows["way"] == way)])
            for case in _MANOEUVRES
            for way in _WAYS
        ),
    ]
    replace_section("late", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
