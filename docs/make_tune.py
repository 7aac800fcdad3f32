"""Study: does tuning find the simulated noise? Writes docs/studies.md: `python -m docs.make_tune`, two minutes.

All noise in the settings is twice the true noise. Rows are kept; finished seeds are not repeated.
"""

from math import sqrt
from typing import NamedTuple

import pandas as pd

import auvid_cli as auvid
from docs.resumable import WIDE_PRIOR, all_rows, asked_seeds
from docs.section import replace_section

_SENSORS = {"gyroscope": 0.5, "attitude": 0.5, "dvl": 0.5}
# The same run in all cases: 30 s with all inputs moving.
RUN = (
    "manoeuvre=manoeuvres/multisine.yaml",
    "manoeuvre.duration=30 s",
    "manoeuvre.initial_speed=3.9 m/s",
    "manoeuvre.excitation.fade_in=3 s",
    "sensors.gyroscope={rate: 50 Hz, noise: 0.1 deg/s, standard_deviation: 0.2 deg/s}",
    "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg, standard_deviation: 0.2 deg}",
    "sensors.dvl={rate: 5 Hz, noise: 0.5 cm/s, standard_deviation: 1 cm/s}",
)
# White noise in the accelerations, SI / Hz^0.5: a new random force at each tick of the inputs, for a vehicle without
# mass coupling between axes.
_WHITE, _TICK = 5e-3, 0.01
_FORCE = [_WHITE * mass / sqrt(_TICK) for mass in (60.603, 99.356, 99.3461)]
_MOMENT = [_WHITE * inertia / sqrt(_TICK) for inertia in (0.98290933, 29.4507, 28.8229)]
_UNCOUPLED = ("zG", "Y_rdot", "Z_qdot", "M_wdot", "N_vdot")


class Case(NamedTuple):
    """A simulated case: additional settings, and the true noise by its setting, SI."""

    settings: tuple[str, ...]
    true: dict[str, float]


CASES = {
    "white": Case(
        (
            f"manoeuvre.disturbance={{force: {{standard_deviation: {_FORCE}, time_constant: 1e-9 s}}, "
            f"moment: {{standard_deviation: {_MOMENT}, time_constant: 1e-9 s}}}}",
            *(f"vehicle.parameters.{symbol}=0" for symbol in _UNCOUPLED),
            "vehicle.parameters.zB=-8.3 mm",
            f"identification.process_noise={{velocity: {2 * _WHITE}, rate: {2 * _WHITE}, attitude: 1e-4}}",
        ),
        {"process_noise.velocity": _WHITE, "process_noise.rate": _WHITE, "process_noise.attitude": 0.0},
    ),
}

# Process noise acts between measurements, so a slower sensor is a case of its own.
SLOW_GYROSCOPE = "sensors.gyroscope.rate=20 Hz"
CASES |= {
    f"{name}, gyroscope at 20 Hz": case._replace(settings=(*case.settings, SLOW_GYROSCOPE))
    for name, case in CASES.items()
}


def found(case: Case, seed: int, disturbance: bool = False) -> pd.DataFrame:
    """Simulate and tune one seed, on request with the time constant of a disturbance: a row for each noise."""
    experiment = auvid.load_experiment("spiral", WIDE_PRIOR, *RUN, *case.settings, f"seed={seed}")
    rows = auvid.tune(auvid.simulate(experiment), sensors=True, disturbance=disturbance).to_pandas()
    rows["setting"] = rows["setting"].str.removeprefix("identification.")
    true = case.true | {f"measurement_noise.{sensor}": factor for sensor, factor in _SENSORS.items()}
    return rows.assign(true=rows["setting"].map(true))


def table(rows: pd.DataFrame) -> list[str]:
    """Return a table of how often the interval of each noise contains the truth."""
    lines = [
        "| disturbance | noise | unit | true | stated | estimate, median | half width of the interval, median | "
        "intervals that contain the true value |",
        "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for (case, setting), each in rows.groupby(["case", "setting"], sort=False):
        first, held = each.iloc[0], _held(each)
        half = "" if first["true"] == 0.0 else f"{((each['high'] - each['low']) / (2 * first['true'])).median():.0%}"
        lines.append(
            f"| {case} | `{setting}` | {first['unit']} | {first['true']:.3g} | {first['stated']:.3g} | "
            f"{each['tuned'].median():.3g} | {half} | {held.sum()} of {len(held)} |"
        )
    return lines


def summary(rows: pd.DataFrame) -> str:
    """Return for each case the share of correct intervals, of noise that is present and of absent noise."""
    lines = []
    for case, each in rows.groupby("case", sort=False):
        present, held = each["true"] > 0.0, _held(each)
        lines.append(
            f"- {case}, seeds {each['seed'].min()} to {each['seed'].max()}: of {present.sum()} intervals of noise that "
            f"is present, {held[present].mean():.1%} contain the true value; of {(~present).sum()} intervals of absent "
            f"noise, {held[~present].mean():.1%} begin at 0."
        )
    return "\n".join(lines)


def _held(rows: pd.DataFrame) -> "pd.Series[bool]":
    return (rows["low"] <= rows["true"]) & (rows["true"] <= rows["high"])


def main() -> None:
    """Go through all seeds and write the section."""
    seeds = asked_seeds(__doc__, 100)
    runs = [(name, seed) for seed in range(1, seeds + 1) for name in CASES]
    rows = all_rows("tune", runs, lambda name, seed: found(CASES[name], seed))
    replace_section("tune", "\n".join([summary(rows), "", *table(rows)]), "studies")


if __name__ == "__main__":
    main()
