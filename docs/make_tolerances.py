"""Study: total standard deviations against errors of known quantities. Writes docs/studies.md.

`python -m docs.make_tolerances`: parameters, gains, scales, mountings and delays are drawn from the usual tolerances,
and the smoother has the nominal ones; about two hours on one core. Interrupted, it continues where it was.
"""

from dataclasses import replace
from zlib import crc32

import numpy as np
import pandas as pd

from auvid_cli.config.enums import FilterName
from auvid_cli.config.identification import Tolerances
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.evaluation.accuracy import coefficient_results
from auvid_cli.evaluation.judgement import judge
from auvid_cli.identification.run import identify
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.rigid_body import dvl_axes
from docs.resumable import all_rows, asked_seeds
from docs.section import replace_section

_SPEED = {"vt690": 3.9, "remus100": 1.54, "lauv": 1.43}
_ATTITUDE = {
    "white": "sensors.attitude.source=direct",
    "inertial": "identification.attitude_from=inertial",
    "ahrs": "sensors.attitude.source=ahrs",
}
# Process noise as large as the misfit of a model with such errors asks for.
_IDENTIFICATION = (
    "identification.prior.factor=1",
    "identification.process_noise={velocity: 1e-2 m/s^2/Hz^0.5, rate: 1e-2 rad/s^2/Hz^0.5, attitude: 1e-3}",
    "identification.smoother.max_passes=20",
)
# Median of the size of a standard normal variable, inverted.
_MEDIAN = 1.4826
_SHARES = {"m": "mass", "Ixx": "inertia", "Iyy": "inertia", "Izz": "inertia", "B": "buoyancy"}
_CENTRE = {"xG": "trim", "yG": "trim", "zG": "centre_of_gravity"}
# Vehicle and manoeuvre; the REMUS 100 does not survive the multisine.
CASES = [
    f"{vehicle} {manoeuvre} {attitude}"
    for manoeuvre in ("spiral", "zigzag_10_10", "multisine")
    for attitude in _ATTITUDE
    for vehicle in _SPEED
    if (vehicle, manoeuvre) != ("remus100", "multisine")
]


def settings_of(case: str, seed: int) -> list[str]:
    """Return the settings of a case."""
    vehicle, manoeuvre, attitude = case.split()
    own = "" if vehicle == "vt690" else f"_{vehicle}"
    duration = "manoeuvre.duration=60 s"
    run = (
        [f"manoeuvre=manoeuvres/spiral{own}.yaml", duration]
        if manoeuvre == "spiral"
        else [
            f"manoeuvre=manoeuvres/{manoeuvre}.yaml",
            f"manoeuvre.speed={_SPEED[vehicle]} m/s",
            *[duration] * (manoeuvre == "multisine"),
        ]
    )
    return [f"seed={seed}", f"vehicle=vehicles/{vehicle}.yaml", *run, *_IDENTIFICATION, _ATTITUDE[attitude]]


def drawn_run(case: str, seed: int, tolerances: Tolerances) -> Dataset:
    """Simulate a vehicle with drawn errors of all known quantities; the dataset states the nominal ones."""
    settings, rng = settings_of(case, seed), np.random.default_rng([seed, crc32(case.encode())])
    nominal = load_experiment(find_experiment(None), settings)
    known = nominal.vehicle.known_parameters()
    shares = {symbol: getattr(tolerances, key) for symbol, key in _SHARES.items()}
    shares |= {symbol: tolerances.added_mass for symbol in known if symbol.endswith("dot")}
    true = {symbol: known[symbol] * (1.0 + share * rng.standard_normal()) for symbol, share in shares.items()}
    true |= {s: known[s] + getattr(tolerances, key) * rng.standard_normal() for s, key in _CENTRE.items()}
    overrides = [f"vehicle.parameters.{symbol}.value={value!r}" for symbol, value in true.items()]
    speed, stated = _SPEED[case.split()[0]], nominal.vehicle.stated_coefficients()
    linear = [
        f"{{name: {row}_{signal}, row: {row}, factors: [{signal}], "
        f"value: {stated[symbol] * speed * tolerances.linear_damping * rng.standard_normal()!r}}}"
        for row, signal, symbol in (("X", "u", "X_u|u|"), ("M", "q", "M_uql"), ("N", "r", "N_url"))
    ]
    fade = -tolerances.thrust_fade / speed * rng.standard_normal()
    linear.append(f"{{name: X_uT, row: X, factors: [u, thrust], value: {fade!r}}}")
    overrides.append(f"vehicle.terms=[{', '.join(linear)}]")
    arm = tolerances.accelerometer_position * rng.standard_normal(3)
    overrides.append(f"sensors.accelerometer.position=[{', '.join(f'{x!r} m' for x in arm.tolist())}]")
    dataset = simulate(load_experiment(find_experiment(None), [*settings, *overrides]))
    experiment = dataset.experiment.model_copy(update={"vehicle": nominal.vehicle})
    return _with_errors(replace(dataset, experiment=experiment), tolerances, rng)


def _with_errors(dataset: Dataset, tolerances: Tolerances, rng: np.random.Generator) -> Dataset:
    """Return the dataset with errors of inputs, DVL, gyroscope and delays."""
    assert dataset.truth is not None
    truth, sensors = dataset.truth, dict(dataset.sensors)
    gain = np.array([tolerances.fins, tolerances.fins, tolerances.thrust, 0.0]) * rng.standard_normal(4)
    values = dataset.inputs.values.copy()
    values[:, :4] /= 1.0 + gain
    late: list[str] = ["inputs", "gyroscope", "dvl"]
    delays = dict(zip(late, tolerances.delay * rng.standard_normal(3), strict=True))
    scale, yaw = tolerances.dvl_scale * rng.standard_normal(), tolerances.dvl_yaw * rng.standard_normal()
    arm = tolerances.dvl_position * rng.standard_normal(3)
    dvl = sensors["dvl"]
    rates = np.column_stack([np.interp(dvl.time, truth.time, column) for column in truth.motion[:, 3:6].T])
    sensors["dvl"] = replace(dvl, values=(dvl.values + np.cross(rates, arm)) @ dvl_axes(scale, yaw).T)
    gyroscope = sensors["gyroscope"]
    turned = np.cross(gyroscope.values, tolerances.gyroscope_mounting * rng.standard_normal(3))
    scales = tolerances.gyroscope_scale * rng.standard_normal(3)
    sensors["gyroscope"] = replace(gyroscope, values=gyroscope.values * (1.0 + scales) + turned)
    if dataset.experiment.has_ahrs:
        attitude = sensors["attitude"]
        offset = tolerances.ahrs * rng.standard_normal(3)
        sensors["attitude"] = replace(attitude, values=attitude.values + offset)
    if "accelerometer" in sensors:
        sensors["accelerometer"] = replace(sensors["accelerometer"], position=(0.0, 0.0, 0.0))
    inputs = replace(dataset.inputs, time=dataset.inputs.time - delays["inputs"], values=values)
    begin, end = inputs.time[0] + 0.05, inputs.time[-1] - 0.05
    for name, record in sensors.items():
        time = record.time + delays.get(name, 0.0)
        inside = (time > begin) & (time < end)
        sensors[name] = replace(record, time=time[inside], values=record.values[inside])
    return replace(dataset, inputs=inputs, sensors=sensors)


def result(case: str, seed: int) -> pd.DataFrame:
    """Return a row for each coefficient."""
    dataset = drawn_run(case, seed, Tolerances())
    estimate = identify(dataset, FilterName.SMOOTHER)
    judgement = judge([estimate])[estimate.filter]
    worst = min(estimate.faults, key=lambda test: (test.rank or 99, -test.excess), default=None)
    rows = coefficient_results(estimate, dataset.truth, {}, judgement) if estimate.completed else []
    return pd.DataFrame(
        {
            "coefficient": [row.coefficient for row in rows] or [""],
            "true": [row.true for row in rows] or [np.nan],
            "estimate": [row.estimate for row in rows] or [np.nan],
            "data": [row.corrected_standard_deviation for row in rows] or [np.nan],
            "total": [row.total_standard_deviation for row in rows] or [np.nan],
            "identified": [row.identified for row in rows] or [False],
            "grade": str(judgement.grade),
            "fault": str(worst.fault) if worst is not None and worst.rank else "",
        }
    )


def table(rows: pd.DataFrame) -> list[str]:
    """Return a row for each manoeuvre, one for each attitude, and one for all."""
    rows = rows.copy()
    rows[["vehicle", "manoeuvre", "attitude"]] = rows["case"].str.split(expand=True)
    groups = [each for by in ("manoeuvre", "attitude") for each in rows.groupby(by, sort=False)]
    lines = []
    for group, own in [*groups, ("all", rows)]:
        runs = own.groupby(["case", "seed"])["total"].count()
        own = own[own["total"].notna()]
        error = (own["estimate"] - own["true"]).abs()
        ratio, kept = error / own["total"], own["identified"].astype(bool)
        grades = own.groupby(["case", "seed"])["grade"].first()
        largest = f"{ratio[kept].max():.2g}" if kept.any() else ""
        lines.append(
            f"| {group} | {len(runs)} | {(runs == 0).sum()} | {(grades == 'sound').sum()} "
            f"| {(ratio <= 2.0).mean():.1%} | {ratio.max():.2g} | {largest} | {1.0 / (_MEDIAN * ratio.median()):.2g} "
            f"| {(error / own['data'] > 5.0).mean():.0%} |"
        )
    return lines


def main() -> None:
    """Do the runs that are missing, and write the section."""
    seeds = asked_seeds(__doc__, 2)
    rows = all_rows("tolerances", ((case, seed) for seed in range(1, seeds + 1) for case in CASES), result)
    lines = [
        "Runs of 60 s of vt690, remus100 and lauv. Known quantities are drawn from the usual tolerances. The smoother",
        "has the nominal ones, and process noise of the size of the misfit: 0.01 for velocity and rates, 0.001 for",
        "angles. Runs that did not converge are left out. Total / spread: median ratio of the total standard deviation",
        "to the spread of the errors. Beyond 5 sd from data: share of errors beyond five standard deviations that are",
        "from the data alone.",
        "",
        "| runs of | runs | not converged | sound | within 2 total sd | largest error / total sd | largest, identified "
        "| total / spread | beyond 5 sd from data |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
        *table(rows),
    ]
    replace_section("tolerances", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
