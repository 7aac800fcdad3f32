"""Study: prediction bands of a wrong model. Writes docs/studies.md: `python -m docs.make_mismatch`, an hour.

For each seed the smoother identifies from a multisine of all inputs, with process noise estimated for each axis. Its
model predicts a 10/10 zigzag. Rows are kept; finished seeds are not repeated.
"""

from dataclasses import replace
from typing import NamedTuple

import pandas as pd

import auvid_cli as auvid
from auvid_cli.api.evaluation import judge
from auvid_cli.data.dataset import Dataset
from docs.resumable import WIDE_PRIOR, all_rows, asked_seeds
from docs.section import replace_section

_SENSORS = (
    "sensors.gyroscope={rate: 20 Hz, noise: 0.1 deg/s}",
    "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}",
    "sensors.dvl={rate: 5 Hz, noise: 0.5 cm/s}",
    "sensors.depth={rate: 5 Hz, noise: 2 cm}",
    "identification.noise=estimate",
    "identification.process_noise={velocity: [1e-4, 1e-4, 1e-4], rate: [1e-4, 1e-4, 1e-4]}",
)
_MULTISINE, _ZIGZAG = (
    (f"manoeuvre=manoeuvres/{name}.yaml", "manoeuvre.duration=100 s", "manoeuvre.initial_speed=3.9 m/s")
    for name in ("multisine", "zigzag_10_10")
)
_OTHER_SEED = 1000
_SIGNALS, _HORIZONS = ("u", "v", "w", "q", "r", "down"), (0.5, 5.0, 50.0)
_LEAST, _MOST = 0.90, 0.98


class Case(NamedTuple):
    """A model error: settings of the simulation, and settings of the smoother."""

    true: tuple[str, ...]
    told: tuple[str, ...] = ()


CASES = {
    "missing moment of |v| r": Case(("vehicle.terms=[{name: N_|v|r, row: N, factors: ['|v|', r], value: -150}]",)),
    "mass 3 % larger": Case(("vehicle.parameters.m=48.98268 kg",)),
    "buoyancy 10 % smaller": Case(("vehicle.parameters.B=419.72640264 N",)),
    "buoyancy 10 % smaller, ballast estimated": Case(
        ("vehicle.parameters.B=419.72640264 N",),
        ("identification.estimate={biases: [ballast], ballast: {buoyancy_spread: 50 N, moment_spread: 5 N*m}}",),
    ),
    "disturbance, also estimated": Case(
        (
            "manoeuvre.disturbance={force: {standard_deviation: 5 N, time_constant: 3 s}, "
            "moment: {standard_deviation: [0.2 N*m, 2 N*m, 2 N*m], time_constant: 3 s}}",
        ),
        (
            "identification.estimate={biases: [disturbance], disturbance: {force: {standard_deviation: 10 N, "
            "time_constant: 5 s}, moment: {standard_deviation: [0.4 N*m, 4 N*m, 4 N*m], time_constant: 5 s}}}",
        ),
    ),
}


def data(manoeuvre: tuple[str, ...], case: Case, seed: int) -> Dataset:
    """Simulate a case, with the settings of the smoother."""
    settings = (*manoeuvre, *_SENSORS, f"seed={seed}")
    told = auvid.load_experiment("spiral", WIDE_PRIOR, *settings, *case.told)
    return replace(auvid.simulate(auvid.load_experiment("spiral", WIDE_PRIOR, *settings, *case.true)), experiment=told)


def found(case: Case, seed: int) -> pd.DataFrame:
    """Identify and predict one seed: a row for each signal and horizon."""
    training = data(_MULTISINE, case, seed)
    estimate = auvid.identify(training, "smoother")
    if not estimate.completed:
        return pd.DataFrame({"signal": [""], "horizon_s": [0.0], "status": [estimate.status]})
    validation = auvid.validate(data(_ZIGZAG, case, _OTHER_SEED + seed), estimate, training=training)
    rows = validation.to_pandas()["validation"].query("kind == 'ahead' and horizon_s in @_HORIZONS")
    kept = ["signal", "horizon_s", "measurements", "noise", "rmse", "expected_rmse", "share_within_band"]
    grade, reason, *_ = judge(estimate)["smoother"].row()
    return rows[kept].assign(status=estimate.status, grade=grade, reason=reason)


def table(rows: pd.DataFrame) -> list[str]:
    """Return the share of errors within the band, by case, signal and horizon."""
    lines = [
        f"| model error | seeds | {' | '.join(f'{signal}, {h:g} s' for signal in _SIGNALS for h in _HORIZONS)} |",
        f"| --- | ---: | {' | '.join(['---:'] * len(_SIGNALS) * len(_HORIZONS))} |",
    ]
    for case, each in rows.groupby("case", sort=False):
        cells = []
        for signal in _SIGNALS:
            for horizon in _HORIZONS:
                own = each[(each["signal"] == signal) & (each["horizon_s"] == horizon)]
                share = (own["share_within_band"].fillna(0.0) * own["measurements"]).sum() / own["measurements"].sum()
                cells.append(f"{share:.0%}" if _LEAST <= share <= _MOST else f"**{share:.0%}**")
        label = str(case).replace("|", r"\|")
        lines.append(f"| {label} | {each['seed'].nunique()} | {' | '.join(cells)} |")
    return lines


def verdicts(rows: pd.DataFrame) -> list[str]:
    """Return the verdicts of each case, with the first reason of seed 1."""
    lines = ["Verdicts on the estimates, with the first reason in seed 1:", ""]
    for case, each in rows.drop_duplicates(["case", "seed"]).groupby("case", sort=False):
        counts = ", ".join(f"{count} {grade}" for grade, count in each["grade"].value_counts().items())
        reason = each["reason"].fillna("").iloc[0]
        lines.append(f"- {case}: {counts}{reason and f'; {reason}'}".replace("|", r"\|"))
    return lines


def main() -> None:
    """Go through all seeds and write the section."""
    seeds = asked_seeds(__doc__, 20)
    runs = [(name, seed) for seed in range(1, seeds + 1) for name in CASES]
    rows = all_rows("mismatch", runs, lambda name, seed: found(CASES[name], seed))
    replace_section("mismatch", "\n".join([*table(rows), "", *verdicts(rows)]), "studies")


if __name__ == "__main__":
    main()
