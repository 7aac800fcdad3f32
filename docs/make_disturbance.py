"""Study: is a simulated disturbance found? Writes docs/studies.md: `python -m docs.make_disturbance`.

Each seed is tuned with sizes, time constants and sensor noise stated twice as large as they are. Then, with no
disturbance stated, `auvid tune` decides by the likelihood whether there is one, in data with a disturbance and without.
A seed takes a minute. Rows are kept; finished seeds are not repeated.
"""

from math import radians

import pandas as pd

import auvid_cli as auvid
from docs.make_tune import RUN, SLOW_GYROSCOPE, Case, found, summary, table
from docs.resumable import WIDE_PRIOR, all_rows, asked_seeds
from docs.section import replace_section

_LASTS = (
    "manoeuvre.disturbance={force: {standard_deviation: 5 N, time_constant: 3 s}, "
    "moment: {standard_deviation: [0.2 N*m, 2 N*m, 2 N*m], time_constant: 3 s}}"
)
_FOUND = Case(
    (
        _LASTS,
        "sensors.gyroscope.drift=0.03 deg/s/s^0.5",
        "identification.process_noise={velocity: 1e-3, rate: 1e-3, attitude: 1e-4}",
        "identification.estimate={biases: [gyro, disturbance], gyro: {spread: 0.1 deg/s, walk: 0.06 deg/s/s^0.5}, "
        "disturbance: {force: {standard_deviation: 10 N, time_constant: 6 s}, "
        "moment: {standard_deviation: [0.4 N*m, 4 N*m, 4 N*m], time_constant: 6 s}}}",
    ),
    {
        "process_noise.velocity": 0.0,
        "process_noise.rate": 0.0,
        "process_noise.attitude": 0.0,
        "estimate.gyro.walk": radians(0.03),
        "estimate.disturbance.force.standard_deviation": 5.0,
        "estimate.disturbance.force.time_constant": 3.0,
        "estimate.disturbance.moment.standard_deviation.0": 0.2,
        "estimate.disturbance.moment.standard_deviation.1": 2.0,
        "estimate.disturbance.moment.standard_deviation.2": 2.0,
        "estimate.disturbance.moment.time_constant": 3.0,
    },
)
_CASES = {
    "lasting": _FOUND,
    "lasting, gyroscope at 20 Hz": _FOUND._replace(settings=(*_FOUND.settings, SLOW_GYROSCOPE)),
}
_CHOICES = {"none": (), "5 N and 0.2, 2, 2 N m over 3 s": (_LASTS,)}


def chosen(settings: tuple[str, ...], seed: int) -> pd.DataFrame:
    """Simulate one seed and decide whether there is a disturbance."""
    experiment = auvid.load_experiment("spiral", WIDE_PRIOR, *RUN, *settings, f"seed={seed}")
    choice = auvid.tune(auvid.simulate(experiment), disturbance=True).choice
    assert choice is not None, "that was asked for"
    return pd.DataFrame({"gain": [choice.gain], "needed": [choice.needed], "is_kept": [choice.is_kept]})


def choices(rows: pd.DataFrame) -> list[str]:
    """Return how often a disturbance was found."""
    lines = [
        "| disturbance | found | gain in log-likelihood, smallest | median | largest | needed |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for case, each in rows.groupby("case", sort=False):
        gain = each["gain"]
        lines.append(
            f"| {case} | {each['is_kept'].sum()} of {len(each)} | {gain.min():.2f} | {gain.median():.2f} | "
            f"{gain.max():.2f} | {each['needed'].median():.1f} |"
        )
    return lines


def main() -> None:
    """Go through all seeds and write the section."""
    seeds = asked_seeds(__doc__, 20)
    every = range(1, seeds + 1)
    runs = [(name, seed) for seed in every for name in _CASES]
    rows = all_rows("disturbance", runs, lambda name, seed: found(_CASES[name], seed, disturbance=True))
    runs = [(name, seed) for seed in every for name in _CHOICES]
    kept = all_rows("disturbance_chosen", runs, lambda name, seed: chosen(_CHOICES[name], seed))
    replace_section("disturbance", "\n".join([summary(rows), "", *table(rows), "", *choices(kept)]), "studies")


if __name__ == "__main__":
    main()
