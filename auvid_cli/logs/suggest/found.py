"""What was found in logs by names: the numbers of each sensor with a unit, and as signals in time."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.log_columns import unit_factor
from auvid_cli.config.magnitudes import magnitude_of
from auvid_cli.logs.clock import order_rows, to_seconds
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.frames import euler_of_quaternion
from auvid_cli.logs.suggest.names import QUATERNION_NAMES, Match, named_unit
from auvid_cli.logs.suggest.rows import time_of
from auvid_cli.logs.suggest.ties import Track
from auvid_cli.vehicle.parameters import SENSORS

Array = NDArray[np.float64]

# Larger than that is not in SI; sizes of the 99 % quantile that other units have, from the largest on.
_OTHER_UNITS: dict[str, tuple[tuple[float, str], ...]] = {
    "rad": ((2.0 * np.pi, "deg"),),
    "rad/s": ((3.0, "deg/s"),),
    "m/s": ((200.0, "mm/s"), (20.0, "cm/s")),
    "m/s^2": ((3000.0, "mm/s^2"), (300.0, "cm/s^2")),
}
# What a mean specific force along the vertical is rather in g.
_ONE_G = (0.8, 1.2)


class Found(NamedTuple):
    """A sensor that was found by names.

    Attributes
    ----------
    sensor : str
    log : str
    match : Match
    numbers : dict of ndarray
        By component, as the log has them.
    unit : str
        Guessed, unless it is stated.
    comment : str
        Why that unit.
    is_stated : bool
        Whether the log or a name states the unit.
    """

    sensor: str
    log: str
    match: Match
    numbers: dict[str, Array]
    unit: str
    comment: str
    is_stated: bool

    @property
    def is_quaternion(self) -> bool:
        """Say whether it is an attitude as a quaternion."""
        return set(self.numbers) == set(QUATERNION_NAMES)

    def si(self) -> dict[str, Array]:
        """Return the components in SI, a quaternion as angles; what nothing measures is missing."""
        if self.is_quaternion:
            angles = euler_of_quaternion(np.column_stack([self.numbers[axis] for axis in "wxyz"]))
            return dict(zip(("phi", "theta", "psi"), angles.T, strict=True))
        si = SENSORS[self.sensor][0].unit
        factor = unit_factor(self.unit, si)
        most = magnitude_of(si).most / factor
        return {
            component: factor * np.where(np.abs(raw) <= most, raw, np.nan) for component, raw in self.numbers.items()
        }


def found_in(logs: Mapping[str, Log], sensor: str, name: str, match: Match) -> Found:
    """Read what was found of a sensor, and guess its unit."""
    values = logs[name].read(match.table, [column.name for column in match.columns.values()])
    numbers = {component: np.asarray(values[column.name], np.float64) for component, column in match.columns.items()}
    return Found(sensor, name, match, numbers, *_unit(list(match.columns.values()), numbers, SENSORS[sensor][0].unit))


def tracks_of(log: Log, table: str, signals: Mapping[str, Array]) -> dict[str, Track]:
    """Return signals with their times; none if the table has no column that looks like times, or one is no time."""
    flow, _ = time_of(log, table)
    if flow is None:
        return {}
    name, unit = (flow["column"], flow.get("unit")) if isinstance(flow, Mapping) else (flow, None)
    column = next(column for column in log.tables()[table] if column.name == name)
    try:
        seconds = to_seconds(
            log.read(table, [column.name])[column.name], unit_factor(str(unit or column.unit or "s"), "s")
        )
    except ValueError:
        return {}
    order = order_rows(seconds.seconds)
    time = seconds.seconds[order.rows]
    return {symbol: Track(time, values[order.rows]) for symbol, values in signals.items()} if time.size > 1 else {}


def _unit(columns: Sequence[LogColumn], numbers: Mapping[str, Array], si: str) -> tuple[str, str, bool]:
    """Guess the unit of columns, say why, and whether the log states it."""
    units = {column.unit for column in columns}
    if len(units) == 1 and (unit := units.pop()):
        try:
            unit_factor(unit, si)
        except ValueError:
            return si, f"check: the log says {unit!r}", False
        return unit, "as the log says", True
    largest = max(float(np.nanmax(np.abs(values), initial=0.0)) for values in numbers.values())
    named = {named_unit(column.name, si) for column in columns}
    if len(named) == 1 and (unit := named.pop()):
        return unit, f"as the name says; check: values reach {largest:.4g}", True
    known = np.concatenate([np.abs(values[np.isfinite(values)]) for values in numbers.values()])
    usual = float(np.quantile(known, 0.99)) if known.size else 0.0
    size = largest if si.startswith("rad") else usual
    unit = next((unit for least, unit in _OTHER_UNITS.get(si, ()) if size > least), si)
    if si == "m/s^2" and "fz" in numbers and _ONE_G[0] < abs(float(np.nanmean(numbers["fz"]))) < _ONE_G[1]:
        unit = "g"
    return unit, f"check: values reach {largest:.4g}", False
