"""Whether an informed prior pays, into docs/studies.md: `python -m docs.make_prior`, ten minutes.

A REMUS 100 each of whose coefficients is some 30 % off its file, another one for each seed, is simulated on four
manoeuvres and identified by the smoother from four priors. No prior knows of the vehicle that is simulated.
Rows are kept; finished runs are not repeated.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

import auvid_cli as auvid
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.loading import dump_experiment, parse_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.errors import SimulationError
from docs.resumable import all_rows, asked_seeds
from docs.section import replace_section

# Logarithm of the true coefficient over the value in the vehicle file.
_OFF = 0.3
_SENSORS = (
    "sensors.gyroscope={rate: 20 Hz, noise: 0.1 deg/s}",
    "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}",
    "sensors.dvl={rate: 5 Hz, noise: 0.5 cm/s}",
)
_SLOW = "manoeuvre.duration=90 s", "manoeuvre.speed=1.54 m/s"
_LATERAL = "lateral only"
_MANOEUVRES = {
    "spiral": ("manoeuvre.duration=90 s",),
    "zigzag": ("manoeuvre=manoeuvres/zigzag_20_20.yaml", *_SLOW),
    "turning circle": ("manoeuvre=manoeuvres/turning_circle.yaml", *_SLOW),
    # Neutral, and without the torque of the propeller: the elevator, which holds a pitch of zero, hardly moves.
    _LATERAL: (
        "manoeuvre={type: multisine, duration: 90 s, speed: 1.54 m/s, autopilot: {horizontal: none}}",
        "manoeuvre.excitation.rudder={amplitude: 12 deg, lowest: 0.03 Hz, highest: 0.4 Hz, lines: 9}",
        "vehicle.parameters.B=299 N",
        "vehicle.parameters.K_prop=0 N*m",
    ),
}
# Rows of the equations of which it tells.
_ROWS = "XYKN"
_PRIORS = {
    "zero mean": ("identification.prior.mean=zero",),
    "zero mean, ten times as wide": ("identification.prior.mean=zero", "identification.prior.factor=10"),
    "geometry": ("identification.prior=geometry",),
    "vehicle file": ("identification.prior.mean=vehicle", "identification.prior.relative=30 %"),
}
_CASES = {f"{m}, {p}": (m, p) for m in _MANOEUVRES for p in _PRIORS}


def simulated(manoeuvre: str, seed: int) -> Dataset:
    """Simulate a vehicle off the file, the first drawn that survives the manoeuvre; settings say what the file does."""
    told = auvid.load_experiment("remus100", *_SENSORS, *_MANOEUVRES[manoeuvre], f"seed={seed}")
    random = np.random.default_rng(seed)
    while True:
        stated = told.vehicle.all_coefficients()
        off = dict(zip(stated, np.exp(_OFF * random.standard_normal(len(stated))), strict=True))
        vehicle = told.vehicle.with_coefficients({symbol: off[symbol] * value for symbol, value in stated.items()})
        try:
            dataset = auvid.simulate(told.model_copy(update={"vehicle": vehicle}))
        except SimulationError:
            continue
        return replace(dataset, experiment=told)


def outcome(case: str, seed: int) -> pd.DataFrame:
    """Identify a run from a prior: errors in percent, in standard deviations, and what is identified, in one row."""
    manoeuvre, prior = _CASES[case]
    dataset = simulated(manoeuvre, seed)
    asking = replace(dataset, experiment=_with(dataset.experiment, _PRIORS[prior]))
    evaluation = auvid.evaluate(asking, auvid.identify(asking, "smoother"))
    (summary,) = evaluation.summary
    there = [c for c in evaluation.coefficients if c.true]
    off = np.array([c.estimate - c.true for c in there if c.true])
    size, deviation = np.array([[c.true, c.standard_deviation] for c in there]).T
    row = {
        "grade": str(summary.judgement.grade),
        "reason": summary.judgement.reason,
        "median_percent": 100.0 * np.median(np.abs(off / size)),
        "lateral_percent": 100.0 * np.median(np.abs(off / size)[[c.coefficient[0] in _ROWS for c in there]]),
        "within": np.mean(np.abs(off) <= 2.0 * deviation),
        "identified": sum(c.identified for c in there),
        "coefficients": len(there),
    }
    return pd.DataFrame([row])


def _with(experiment: RunSettings, settings: tuple[str, ...]) -> RunSettings:
    return parse_experiment(dump_experiment(experiment), "prior", settings)


def table(rows: pd.DataFrame) -> list[str]:
    """Compare the priors, manoeuvre by manoeuvre."""
    lines = [
        "| manoeuvre | prior | seeds | sound | error, median of coefficients, % | within 2 sd | identified of 22 |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for case, (manoeuvre, prior) in _CASES.items():
        if manoeuvre != _LATERAL:
            each = rows[rows["case"] == case]
            lines.append(
                f"| {manoeuvre} | {prior} | {len(each)} | {(each['grade'] == 'sound').sum()} | "
                f"{each['median_percent'].median():.2g} | {each['within'].mean():.1%} | "
                f"{each['identified'].mean():.1f} |"
            )
    return lines


def lateral_table(rows: pd.DataFrame) -> list[str]:
    """Compare the priors on a run that tells little of heave and pitch; errors are of the fits that settled."""
    lines = [
        "| prior | seeds | sound | did not converge | error, median of X, Y, K, N, % | of all 22, % | within 2 sd | "
        "identified of 22 |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for case, (manoeuvre, prior) in _CASES.items():
        if manoeuvre == _LATERAL:
            each = rows[rows["case"] == case]
            settled = each[each["grade"] != "diverged"]
            lines.append(
                f"| {prior} | {len(each)} | {(each['grade'] == 'sound').sum()} | {len(each) - len(settled)} | "
                f"{settled['lateral_percent'].median():.2g} | {settled['median_percent'].median():.2g} | "
                f"{settled['within'].mean():.1%} | {each['identified'].mean():.1f} |"
            )
    return lines


def main() -> None:
    """Go through all seeds and write the section."""
    seeds = asked_seeds(__doc__, 20)
    runs = [(case, seed) for seed in range(1, seeds + 1) for case in _CASES]
    rows = all_rows("prior", runs, outcome)
    replace_section("prior", "\n".join(table(rows)), "studies")
    replace_section("prior of a lateral run", "\n".join(lateral_table(rows)), "studies")


if __name__ == "__main__":
    main()
