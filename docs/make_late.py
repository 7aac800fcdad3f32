"""Inputs at 10 Hz, held and 50 ms late, over seeds, into docs/studies.md: `python -m docs.make_late`, some minutes.

The vehicle moves with inputs at 100 Hz; ten a second are recorded, and stamped 50 ms after they were given.
"""

import argparse
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import auvid_cli as auvid
from auvid_cli.api.judgement import judge
from auvid_cli.config.load import dump_experiment, parse_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from docs.section import replace_section

# s. Each input of the vehicle's own holds for 10 ms, which straight lines between records do not, so that by these the
# inputs act 5 ms later than the records are early.
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
    "as it is": (),
    "straight lines": ("identification.inputs.between=linear",),
    "straight lines, delay sought": (
        "identification.inputs.between=linear",
        "identification.estimate.biases=[delay]",
    ),
}


class Outcome(NamedTuple):
    """What a seed came to: the grade, the coefficient that is farthest off, and the delay that was found, ms."""

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


def _row(manoeuvre: str, way: str, found: list[Outcome]) -> str:
    right = [of for of in found if of.sigmas <= _WRONG]
    grades = [of.grade for of in found]
    counts = ", ".join(f"{grades.count(grade)} {grade}" for grade in dict.fromkeys(sorted(grades)))
    deceived = sum(of.grade == "sound" and of.sigmas > _WRONG for of in found)
    errors = [abs(of.delay - 1e3 * (_HELD - _LATE)) for of in found if of.delay is not None]
    deviations = [of.deviation for of in found if of.deviation is not None]
    delay = f"{max(errors):.1f} (± {np.median(deviations):.1f})" if errors else ""
    median = np.median([of.sigmas for of in found])
    return f"| {manoeuvre} | {way} | {len(right)} | {counts} | {deceived} | {median:.3g} | {delay} |"


def main() -> None:
    """Go through all seeds and write the section."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    seeds, rows = range(1, parser.parse_args().seeds + 1), []
    for manoeuvre in _MANOEUVRES:
        found: dict[str, list[Outcome]] = {way: [] for way in _WAYS}
        for seed in seeds:
            run = auvid.load_experiment("spiral", f"seed={seed}", f"manoeuvre=manoeuvres/{manoeuvre}.yaml", *_RUN)
            dataset = auvid.simulate(run)
            late = replace(dataset, inputs=replace(dataset.inputs, time=dataset.inputs.time + _LATE))
            for way, settings in _WAYS.items():
                found[way].append(outcome(late, *settings))
            print(manoeuvre, seed, *(of[-1] for of in found.values()), flush=True)
        rows += [_row(manoeuvre, way, outcomes) for way, outcomes in found.items()]
    lines = [
        f"Seeds 1 to {len(seeds)}. Right: no coefficient beyond {_WRONG:g} standard deviations.",
        "",
        "| manoeuvre | inputs | right | judged | wrong, and sound | largest error / sd, median "
        "| delay off by at most, ms (± sd) |",
        "| --- | --- | ---: | --- | ---: | ---: | --- |",
        *rows,
    ]
    replace_section("late", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
