"""Random faults in simulated runs, found by `auvid fit`, into docs/studies.md: `python -m docs.make_fit`.

Each seed draws none to three faults. A run takes some 30 s; results are kept in a file, and finished seeds are not
repeated.
"""

from collections.abc import Callable
from dataclasses import replace
from time import process_time

import numpy as np
import pandas as pd

import auvid_cli as auvid
from auvid_cli.data.dataset import Dataset
from auvid_cli.errors import AuvidError, SimulationError
from docs.resumable import all_rows, asked
from docs.section import replace_section

# Standard deviations up to which a coefficient is right, and beyond which it is wrong.
_RIGHT = 4.0
_WRONG = 5.0
_MAX_FAULTS = 3
_WIDER = "width of the prior"
_SPEEDS = {"vt690": "3.9 m/s", "remus100": "1.54 m/s", "lauv": "1.43 m/s"}
_SPIRALS = {"vt690": "spiral_gentle", "remus100": "spiral_remus100", "lauv": "spiral_lauv"}
_MANOEUVRES = "spiral", "zigzag_10_10", "multisine"
_RUN = (
    "manoeuvre.duration=90 s",
    "sensors.attitude={source: direct, rate: 20 Hz, noise: 0.1 deg}",
    *(f"sensors.{name}.rate=20 Hz" for name in ("gyroscope", "accelerometer")),
)


def _late_inputs(dataset: Dataset) -> Dataset:
    """Return the data with inputs stamped 40 ms before they act."""
    return replace(dataset, inputs=replace(dataset.inputs, time=dataset.inputs.time - 0.04))


def _weak_thrust(dataset: Dataset) -> Dataset:
    """Return the data with a recorded thrust 10 % above the actual one."""
    return replace(dataset, inputs=replace(dataset.inputs, values=dataset.inputs.values * [1.0, 1.0, 1.1, 1.0]))


def _stated_noise(sensor: str, factor: float) -> Callable[[Dataset], Dataset]:
    def change(dataset: Dataset) -> Dataset:
        record = dataset.sensors[sensor]
        stated = replace(record, standard_deviation=factor * record.standard_deviation)
        return replace(dataset, sensors={**dataset.sensors, sensor: stated})

    return change


# Settings of the simulation, change of the data, and kinds of additions that explain each fault.
_FAULTS: dict[str, tuple[tuple[str, ...], Callable[[Dataset], Dataset] | None, tuple[str, ...]]] = {
    "current": (("manoeuvre.current_north=0.15", "manoeuvre.current_east=-0.1"), None, ("current",)),
    "fin_trim": (
        ("manoeuvre.fin_trim.rudder=1 deg", "manoeuvre.fin_trim.elevator=-0.5 deg"),
        None,
        ("trim of the fins",),
    ),
    "dvl_yaw": (("sensors.dvl.mounting_yaw=0.7 deg",), None, ("scale and yaw of the DVL",)),
    "dvl_scale": (("sensors.dvl.scale_error=0.01",), None, ("scale and yaw of the DVL", "scale of the thrust")),
    "gyro": (("sensors.gyroscope.bias=0.1 deg/s",), None, ("bias of the gyroscope",)),
    "late gyroscope": (("sensors.gyroscope.delay=20 ms",), None, ("delay of the gyroscope",)),
    "late dvl": (("sensors.dvl.delay=60 ms",), None, ("delay of the dvl",)),
    "late inputs": ((), _late_inputs, ("delay of the inputs", "lag of the fins")),
    "thrust": ((), _weak_thrust, ("scale of the thrust", "scale and yaw of the DVL")),
    "disturbance": (
        (
            "manoeuvre.disturbance.force.standard_deviation=2 N",
            "manoeuvre.disturbance.moment.standard_deviation=0.6 N*m",
        ),
        None,
        ("disturbance",),
    ),
    "loud gyroscope": ((), _stated_noise("gyroscope", 0.5), ("noise of the gyroscope",)),
    "quiet dvl": ((), _stated_noise("dvl", 2.0), ("noise of the dvl",)),
    "lag": (
        ("vehicle.actuators.fins.time_constant=0.1 s",),
        None,
        ("lag of the fins", "delay of the inputs"),
    ),
    "missing term": (
        ("vehicle.terms=[{name: 'N_|v|r', row: N, factors: ['|v|', r], value: -30}]",),
        None,
        ("term N_|v|r", "term Y_|v|r"),
    ),
}

_COLUMNS = ["faults", "attitude", "grade", "reason", "added", "missed", "worst", "sigmas", "trial", "cpu_time"]


def found(case: str, seed: int) -> pd.DataFrame:
    """Fit a run with the faults of a seed: one row."""
    rng = np.random.default_rng([seed, 48])
    vehicle, manoeuvre = case.split()
    faults = sorted(rng.choice([*_FAULTS], rng.integers(0, _MAX_FAULTS + 1), replace=False).tolist())
    if vehicle == "remus100" and manoeuvre == "multisine":
        manoeuvre = "doublets"  # it capsizes in the multisine
    path = _SPIRALS[vehicle] if manoeuvre == "spiral" else manoeuvre
    run = [f"vehicle=vehicles/{vehicle}.yaml", f"manoeuvre=manoeuvres/{path}.yaml", f"seed={seed}", *_RUN]
    if manoeuvre != "spiral":
        run.append(f"manoeuvre.speed={_SPEEDS[vehicle]}")
    if rng.random() < 0.25:
        run.append("identification.attitude_from=inertial")
    nominal = auvid.load_experiment("spiral", *run)
    try:
        faulted = auvid.load_experiment("spiral", *run, *(s for name in faults for s in _FAULTS[name][0]))
        dataset = auvid.simulate(faulted)
    except SimulationError:
        return pd.DataFrame([dict.fromkeys(_COLUMNS) | {"faults": "; ".join(faults), "grade": "not simulated"}])
    for name in faults:
        change = _FAULTS[name][1]
        dataset = dataset if change is None else change(dataset)
    begin = process_time()
    truth = dataset.truth
    assert truth is not None, "a simulation has a truth"
    row = {"faults": "; ".join(faults), "attitude": nominal.identification.attitude_from}
    try:
        fit = auvid.fit(replace(dataset, experiment=nominal, truth=None))
    except AuvidError as error:
        return pd.DataFrame([dict.fromkeys(_COLUMNS) | row | {"grade": "failed", "reason": str(error)}])
    estimate = fit.estimate
    values, deviations = estimate.final_coefficients(), estimate.final_deviations()
    distances = {
        s: abs(values[s] - truth.coefficients[s]) / deviations[s] for s in deviations if s in truth.coefficients
    }
    worst = max(distances, key=lambda symbol: distances[symbol])
    row |= {"grade": fit.judgement.grade.value, "reason": fit.judgement.reason, "added": "; ".join(fit.added)}
    missed = [name for name in faults if not {*_FAULTS[name][2]} & {*fit.added}]
    row |= {"missed": "; ".join(missed), "worst": worst, "sigmas": distances[worst]}
    return pd.DataFrame([{**row, "trial": fit.trial, "cpu_time": process_time() - begin}], columns=_COLUMNS)


def _names(text: str) -> list[str]:
    return text.split("; ") if text else []


def _unneeded(faults: str, added: str) -> str:
    """Return the additions of a run that explain none of its faults; a wider prior is counted by itself."""
    expected = {_WIDER, *(name for fault in _names(faults) for name in _FAULTS[fault][2])}
    return "; ".join(name for name in _names(added) if name not in expected)


def _numbers(texts: pd.Series) -> str:
    """Return how often each name occurs."""
    counts = pd.Series([name for text in texts for name in _names(text)], dtype=str).value_counts()
    return ", ".join(f"{name} ({count})" for name, count in counts.items()) or "none"


def _share(of: pd.Series) -> str:
    return f"{int(of.sum())} of {len(of)}"


def main() -> None:
    """Go through all seeds and write the section."""
    seeds, file = asked(__doc__, "fit", 80)
    cases = [f"{vehicle} {manoeuvre}" for manoeuvre in _MANOEUVRES for vehicle in _SPEEDS]
    rows = all_rows(file, [(cases[seed % len(cases)], seed) for seed in range(1, seeds + 1)], found)
    rows = rows[rows["grade"] != "not simulated"].fillna({"faults": "", "added": "", "missed": ""})
    sound, number = rows["grade"] == "sound", rows["faults"].map(lambda text: len(_names(str(text))))
    rows = rows.assign(unneeded=[_unneeded(*pair) for pair in zip(rows["faults"], rows["added"], strict=True)])
    lines = [
        f"{len(rows)} runs with seeds from 1 to {rows['seed'].max()}. Right: no coefficient beyond {_RIGHT:g} standard "
        f"deviations; wrong: one beyond {_WRONG:g}.",
        "",
        "| runs | sound and right | sound and wrong | all faults found | nothing else added | processor time |",
        "| --- | --- | --- | --- | --- | ---: |",
    ]
    parts = [(f"{count} fault{'' if count == 1 else 's'}", rows[number == count]) for count in sorted(number.unique())]
    parts += [(vehicle, rows[rows["case"].str.startswith(vehicle)]) for vehicle in _SPEEDS]
    for count, own in [*parts, ("all", rows)]:
        lines.append(
            f"| {count} | {_share((own['grade'] == 'sound') & (own['sigmas'] <= _RIGHT))} "
            f"| {_share((own['grade'] == 'sound') & (own['sigmas'] > _WRONG))} | {_share(own['missed'] == '')} "
            f"| {_share(own['unneeded'] == '')} | {own['cpu_time'].median():.0f} s |"
        )
    widened = rows["added"].map(lambda text: _WIDER in _names(str(text)))
    lines += [
        "",
        f"Sound: {_share(sound)}. Not found: {_numbers(rows['missed'])}. Added without need: "
        f"{_numbers(rows['unneeded'])}. Prior widened: {_share(widened)}, of remus100 "
        f"{_share(widened[rows['case'].str.startswith('remus100')])}.",
        "",
        "Not sound:",
        "",
        *(
            f"- {row.case}, seed {row.seed} ({row.faults or 'no fault'}): {row.grade}, {row.reason}"
            for row in rows[~sound].itertuples()
        ),
    ]
    replace_section("fit", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
