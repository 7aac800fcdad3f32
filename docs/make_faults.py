"""Study: faults against tolerances, and honest runs. Writes docs/studies.md: `python -m docs.make_faults`.

Data with one planted fault each, of kinds and sizes that users meet, are identified by the smoother with the default
settings; the same without faults. About forty minutes on one core. Interrupted, it continues where it was;
`--seeds 0` only writes the runs that there are.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from auvid_cli.config.enums import FilterName
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.evaluation.accuracy import coefficient_results
from auvid_cli.evaluation.judgement import judge
from auvid_cli.identification.run import identify
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.rigid_body import dvl_axes
from docs.resumable import all_rows, asked_seeds
from docs.section import replace_section

_SPEED = 3.9  # m/s
_HONEST = "none"
# Standard deviations: an estimate all of whose coefficients are nearer to the truth is right, one beyond is wrong.
_RIGHT, _WRONG = 3.0, 5.0
_MANOEUVRES = {
    "spiral": ("manoeuvre.duration=60 s",),
    "multisine": ("manoeuvre=manoeuvres/multisine.yaml", f"manoeuvre.speed={_SPEED} m/s", "manoeuvre.duration=60 s"),
    "zigzag": ("manoeuvre=manoeuvres/zigzag_20_20.yaml", f"manoeuvre.speed={_SPEED} m/s"),
}
_ATTITUDES = {
    "white": "sensors.attitude.source=direct",
    "inertial": "identification.attitude_from=inertial",
    "ahrs": "sensors.attitude.source=ahrs",
}
_DEGREE = np.pi / 180.0

Settings = Callable[[float], str]
Change = Callable[[Dataset, float], Dataset]


class Kind(NamedTuple):
    """A kind of fault: what is simulated otherwise, or how the data are changed."""

    sizes: tuple[float, float, float]
    settings: Settings | None = None  # of the simulation; the smoother has the settings without it
    change: Change | None = None


def _vehicle(symbol: str, *sizes: float, is_share: bool = True) -> Kind:
    known = load_experiment(find_experiment(None), []).vehicle.known_parameters()[symbol]

    def settings(size: float) -> str:
        value = known * (1.0 + size) if is_share else known + size
        return f"vehicle.parameters.{symbol}.value={value!r}"

    return Kind(sizes, settings)  # type: ignore[arg-type]


def _term(name: str, factors: str, unit: float, *sizes: float) -> Kind:
    """Return a missing term; sizes are multiples of a unit, SI."""

    def settings(size: float) -> str:
        return f"vehicle.terms=[{{name: {name}, row: {name[0]}, factors: [{factors}], value: {size * unit!r}}}]"

    return Kind(sizes, settings)  # type: ignore[arg-type]


def _inputs(column: int, *sizes: float, is_gain: bool = False) -> Kind:
    def change(dataset: Dataset, size: float) -> Dataset:
        values = dataset.inputs.values.copy()
        values[:, column] = values[:, column] / (1.0 + size) if is_gain else values[:, column] - size
        return replace(dataset, inputs=replace(dataset.inputs, values=values))

    return Kind(sizes, change=change)  # type: ignore[arg-type]


def _sensor(name: str, by: Callable[[Dataset, np.ndarray, float], np.ndarray], *sizes: float) -> Kind:
    def change(dataset: Dataset, size: float) -> Dataset:
        if name not in dataset.sensors:
            return dataset
        record = dataset.sensors[name]
        return replace(
            dataset, sensors=dataset.sensors | {name: replace(record, values=by(dataset, record.values, size))}
        )

    return Kind(sizes, change=change)  # type: ignore[arg-type]


def _late(name: str, *sizes: float) -> Kind:
    def change(dataset: Dataset, size: float) -> Dataset:
        if name == "inputs":
            return replace(dataset, inputs=replace(dataset.inputs, time=dataset.inputs.time - size))
        record = dataset.sensors[name]
        inside = record.time + size < dataset.inputs.time[-1]
        later = replace(record, time=record.time[inside] + size, values=record.values[inside])
        return replace(dataset, sensors=dataset.sensors | {name: later})

    return Kind(sizes, change=change)  # type: ignore[arg-type]


def _offset(axis: int, dataset: Dataset, values: np.ndarray, size: float) -> np.ndarray:
    return values + size * np.eye(3)[axis]


def _gain(axis: int, dataset: Dataset, values: np.ndarray, size: float) -> np.ndarray:
    return values * (1.0 + size * np.eye(3)[axis])


def _turned(axis: int, dataset: Dataset, values: np.ndarray, size: float) -> np.ndarray:
    return values + np.cross(values, size * np.eye(3)[axis])


def _arm(axis: int, dataset: Dataset, values: np.ndarray, size: float) -> np.ndarray:
    assert dataset.truth is not None
    time = dataset.sensors["dvl"].time
    rates = np.column_stack([np.interp(time, dataset.truth.time, column) for column in dataset.truth.motion[:, 3:6].T])
    return values + np.cross(rates, size * np.eye(3)[axis])


def _outliers(dataset: Dataset, values: np.ndarray, size: float) -> np.ndarray:
    rng = np.random.default_rng(1)
    return values + size * (rng.random(values.shape) < 0.01) * rng.standard_normal(values.shape)


def _drift(dataset: Dataset, values: np.ndarray, size: float) -> np.ndarray:
    """Add a current to the north."""
    assert dataset.truth is not None
    time = dataset.sensors["dvl"].time
    heading = np.interp(time, dataset.truth.time, np.unwrap(dataset.truth.motion[:, 8]))
    return values + size * np.column_stack([np.cos(heading), -np.sin(heading), np.zeros(time.size)])


def _held(dataset: Dataset, size: float) -> Dataset:
    time = dataset.inputs.time
    kept = np.searchsorted(time, np.floor(time / size + 1e-6) * size - 1e-6)
    return replace(dataset, inputs=replace(dataset.inputs, values=dataset.inputs.values[kept]))


def _stuck(dataset: Dataset, size: float) -> Dataset:
    values = dataset.inputs.values.copy()
    inside = (dataset.inputs.time > 30.0) & (dataset.inputs.time < 30.0 + size)
    values[inside, 0] = 0.0
    return replace(dataset, inputs=replace(dataset.inputs, values=values))


KINDS: dict[str, Kind] = {
    **{symbol: _vehicle(symbol, 0.02, 0.05, 0.1) for symbol in ("Ixx", "Iyy", "Izz")},
    "m": _vehicle("m", 0.005, 0.01, 0.03),
    **{
        symbol: _vehicle(symbol, 0.03, 0.1, 0.2)
        for symbol in ("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot")
    },
    "B": _vehicle("B", 0.001, 0.003, 0.01),
    **{symbol: _vehicle(symbol, 1e-4, 3e-4, 1e-3, is_share=False) for symbol in ("xG", "yG")},
    "zG": _vehicle("zG", 1e-3, 2e-3, 5e-3, is_share=False),
    "linear drag": _term("X_u", "u", -4.85 * _SPEED, 0.01, 0.03, 0.1),
    "thrust that falls with speed": _term("X_uT", "u, thrust", -1.0 / _SPEED, 0.02, 0.05, 0.1),
    "K_up": _term("K_up", "u, p", -0.43, 0.1, 0.3, 1.0),
    "N_r": _term("N_r", "r", -36.2 * _SPEED, 0.02, 0.05, 0.1),
    "M_q": _term("M_q", "q", -21.7 * _SPEED, 0.02, 0.05, 0.1),
    "N_|v|r": _term("N_|v|r", "'|v|', r", -150.0, 0.1, 0.3, 1.0),
    "Y_|v|r": _term("Y_|v|r", "'|v|', r", -150.0, 0.1, 0.3, 1.0),
    "X_vv": _term("X_vv", "v, v", -30.0, 0.1, 0.3, 1.0),
    "drag of the fins": _term("X_drdr", "u, u, rudder, rudder", -10.0, 0.1, 0.3, 1.0),
    "asymmetric hull": _term("M_uu", "u, u", 0.1, 0.1, 0.3, 1.0),
    "thrust gain": _inputs(2, 0.005, 0.01, 0.03, is_gain=True),
    "rudder gain": _inputs(0, 0.01, 0.02, 0.05, is_gain=True),
    "elevator gain": _inputs(1, 0.01, 0.02, 0.05, is_gain=True),
    "rudder trim": _inputs(0, 0.1 * _DEGREE, 0.3 * _DEGREE, _DEGREE),
    "elevator trim": _inputs(1, 0.1 * _DEGREE, 0.3 * _DEGREE, _DEGREE),
    "fin lag": Kind((0.02, 0.05, 0.1), lambda size: f"vehicle.actuators.fins.time_constant={size!r} s"),
    "stuck rudder": Kind((1.0, 3.0, 10.0), change=_stuck),
    "inputs held": Kind((0.05, 0.1, 0.2), change=_held),
    "inputs late": _late("inputs", 0.003, 0.01, 0.03),
    "gyroscope late": _late("gyroscope", 0.001, 0.003, 0.01),
    "DVL late": _late("dvl", 0.003, 0.01, 0.05),
    "attitude late": _late("attitude", 0.01, 0.03, 0.1),
    **{
        f"bias of {name}": _sensor("gyroscope", partial(_offset, axis), *(x * _DEGREE for x in (0.01, 0.03, 0.1)))
        for axis, name in enumerate("pqr")
    },
    **{
        f"scale of {name}": _sensor("gyroscope", partial(_gain, axis), 1e-3, 3e-3, 1e-2)
        for axis, name in ((1, "q"), (2, "r"))
    },
    "gyroscope mounting": _sensor("gyroscope", partial(_turned, 0), *(x * _DEGREE for x in (0.1, 0.3, 1.0))),
    "attitude offset, roll": _sensor("attitude", partial(_offset, 0), *(x * _DEGREE for x in (0.1, 0.3, 1.0))),
    "attitude offset, pitch": _sensor("attitude", partial(_offset, 1), *(x * _DEGREE for x in (0.1, 0.3, 1.0))),
    "DVL scale": _sensor("dvl", lambda _, values, size: values * (1.0 + size), 3e-4, 2e-3, 1e-2),
    "DVL yaw": _sensor("dvl", lambda _, values, size: values @ dvl_axes(0.0, size).T, 1e-3, 3.5e-3, 1.7e-2),
    "DVL arm": _sensor("dvl", partial(_arm, 0), 0.01, 0.03, 0.1),
    "current": _sensor("dvl", _drift, 0.01, 0.05, 0.2),
    "outliers of the DVL": _sensor("dvl", _outliers, 0.1, 0.3, 1.0),
}


def fault_cases() -> list[str]:
    """Return a case for each kind and size, in turn with each manoeuvre and attitude."""
    cases = []
    # The middle size of each kind first, so that an interrupted study has all kinds.
    for s in (1, 2, 0):
        for k, name in enumerate(KINDS):
            attitude = [*_ATTITUDES][(k // len(_MANOEUVRES) + s) % len(_ATTITUDES)]
            if name.startswith("attitude") and attitude == "inertial":
                # It has no such record.
                attitude = "white"
            cases.append(f"{name}; {s}; {[*_MANOEUVRES][(k + s) % len(_MANOEUVRES)]}; {attitude}")
    return cases


def honest_cases(seeds: int) -> list[tuple[str, int]]:
    """Return the runs without faults; those with an AHRS on multisine and zigzag have all seeds, others a quarter."""
    return [
        (f"{_HONEST}; 0; {manoeuvre}; {attitude}", seed)
        for seed in range(1, seeds + 1)
        for manoeuvre in _MANOEUVRES
        for attitude in _ATTITUDES
        if (attitude == "ahrs" and manoeuvre != "spiral") or seed <= seeds // 4
    ]


def data_of(case: str, seed: int) -> Dataset:
    """Simulate a case; the dataset states the settings without the fault."""
    name, place, manoeuvre, attitude = case.split("; ")
    settings = [f"seed={seed}", *_MANOEUVRES[manoeuvre], _ATTITUDES[attitude]]
    told = load_experiment(find_experiment(None), settings)
    if name == _HONEST:
        return simulate(told)
    kind = KINDS[name]
    size = kind.sizes[int(place)] * (-1.0) ** (
        seed + len(name) if kind.change is not None and "late" not in name else 0
    )
    if name in ("stuck rudder", "inputs held"):
        size = abs(size)
    other = [] if kind.settings is None else [kind.settings(size)]
    dataset = replace(simulate(load_experiment(find_experiment(None), [*settings, *other])), experiment=told)
    return dataset if kind.change is None else kind.change(dataset, size)


def result(case: str, seed: int) -> pd.DataFrame:
    """Return one row."""
    dataset = data_of(case, seed)
    estimate = identify(dataset, FilterName.SMOOTHER)
    judgement = judge([estimate])[estimate.filter]
    needed = sorted((test for test in estimate.faults if test.rank), key=lambda test: test.rank)
    rows = coefficient_results(estimate, dataset.truth, {}, judgement) if estimate.completed else []
    off = {row.coefficient: _distance(row.estimate, row.true, row.total_standard_deviation) for row in rows}
    by_data = [_distance(row.estimate, row.true, row.corrected_standard_deviation) for row in rows]
    kept = {row.coefficient: off[row.coefficient] for row in rows if row.identified}
    worst = max(kept, key=lambda symbol: kept[symbol], default="")
    named = needed[0] if needed else None
    return pd.DataFrame(
        [
            {
                "grade": str(judgement.grade),
                "named": "" if named is None else str(named.fault),
                "alternatives": "" if named is None else "; ".join(map(str, named.alternatives)),
                "largest": max(off.values(), default=np.nan),
                "largest_by_data": max(by_data, default=np.nan),
                "identified": len(kept),
                "largest_identified": kept.get(worst, np.nan),
                "worst": worst,
                "within": sum(value <= 2.0 for value in off.values()),
            }
        ]
    )


def _distance(estimate: float, true: float | None, deviation: float | None) -> float:
    assert true is not None, "simulated data have a truth"
    assert deviation is not None, "the smoother has a total standard deviation"
    return abs(estimate - true) / deviation


def fault_table(rows: pd.DataFrame) -> list[str]:
    """Return a row for each kind of fault."""
    lines = []
    for name, own in rows.groupby("kind", sort=False):
        wrong = (own["grade"] == "sound") & (own["largest_identified"] > _WRONG)
        grades = ", ".join(f"{count} {grade}" for grade, count in own["grade"].value_counts().items())
        by_data, total = (
            " / ".join("-" if np.isnan(value) else f"{value:.2g}" for value in own.sort_values("size")[column])
            for column in ("largest_by_data", "largest")
        )
        names = "; ".join(dict.fromkeys(own["named"].fillna("")[own["named"].fillna("") != ""]))
        lines.append(f"| {name} | {grades} | {by_data} | {total} | {wrong.sum()} | {names} |".replace("|v|", r"\|v\|"))
    return lines


def honest_table(rows: pd.DataFrame) -> list[str]:
    """Return a row for each manoeuvre and attitude."""
    lines = []
    for (manoeuvre, attitude), own in rows.groupby(["manoeuvre", "attitude"], sort=False):
        right, sound = own["largest"] <= _RIGHT, own["grade"] == "sound"
        lines.append(
            f"| {manoeuvre} | {attitude} | {len(own)} | {right.sum()} | {(right & sound).sum()} "
            f"| {(own['largest'] > _WRONG).sum()} | {own['within'].sum() / (22 * len(own)):.1%} "
            f"| {own['identified'].mean():.1f} | {own['largest'].max():.2g} |"
        )
    return lines


def main() -> None:
    """Do the runs that are missing, and write the section."""
    seeds = asked_seeds(__doc__, 8)
    runs = [*honest_cases(seeds), *((case, 1) for case in fault_cases() if seeds)]
    rows = all_rows("faults", runs, result)
    rows[["kind", "size", "manoeuvre", "attitude"]] = rows["case"].str.split("; ", expand=True)
    honest, faulty = rows[rows["kind"] == _HONEST], rows[rows["kind"] != _HONEST]
    sound = (faulty["grade"] == "sound").sum()
    wrong = (faulty["grade"] == "sound") & (faulty["largest_identified"] > _WRONG)
    beyond = faulty["largest_identified"] > _WRONG
    lines = [
        f"Without a fault, {len(honest)} runs of 60 s. Right: all coefficients within {_RIGHT:g} total standard",
        f"deviations; wrong: one beyond {_WRONG:g}.",
        "",
        "| manoeuvre | attitude | runs | right | right and sound | wrong | within 2 sd | identified of 22 "
        "| largest error / sd |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
        *honest_table(honest),
        "",
        f"One fault in each of {len(faulty)} runs: {faulty['kind'].nunique()} kinds, up to three sizes of each.",
        f"{sound} runs are sound. An identified coefficient is beyond {_WRONG:g} total standard deviations in",
        f"{wrong.sum()} of these, and in {beyond.sum()} of all. The columns of errors have the largest error of all",
        "coefficients for each size, smallest fault first; -: did not converge.",
        "",
        "| planted fault | verdicts | largest error / sd from data | largest error / total sd | sound and wrong "
        "| named fault |",
        "| --- | --- | --- | --- | ---: | --- |",
        *fault_table(faulty),
    ]
    replace_section("faults", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
