"""Sensors on a common time grid, and regression of the kinematic relations between them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.data.signals import TURN_RATE_WINDOW, rate_of_change
from auvid_cli.errors import DataError
from auvid_cli.inspection.single_sensor import continuous
from auvid_cli.vehicle.kinematics import GRAVITY
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, SENSORS

Array = NDArray[np.float64]
# s
_STEP, _LONGEST = 0.1, 14 * 86400.0
# Usual intervals that may be bridged.
_LONGEST_BRIDGE = 3.0
_MOST_ROWS = 20_000
_FEWEST_WINDOWS = 15
# Of Huber's weights: 95 % as good as least squares where the noise is normal.
_TUNING, _ROUNDS = 1.345, 12


class Grid(NamedTuple):
    """Cells of equal length, s."""

    start: float
    step: float
    cells: int

    def centres(self) -> Array:
        """Return the times in the middle of each cell, s."""
        return self.start + self.step * (0.5 + np.arange(self.cells, dtype=np.float64))


class Signals(NamedTuple):
    """All measured components and all inputs by symbol, on a grid; NaN where nothing was measured."""

    grid: Grid
    values: dict[str, Array]
    interval: dict[str, float]

    def has(self, *symbols: str) -> bool:
        """Say whether all of these were measured at some time."""
        return all(symbol in self.values for symbol in symbols)

    def blank(self, symbol: str, start: float, end: float) -> None:
        """Take out the cells that lie in part between two times, s."""
        first, last = (int((time - self.grid.start) / self.grid.step) for time in (start, end))
        if symbol in self.values:
            self.values[symbol][max(first, 0) : last + 1] = np.nan

    def window(self, *symbols: str, least: float = 1.0) -> int:
        """Say how many cells to average over, so that the slowest of some components has a few measurements there."""
        longest = max(self.interval.get(symbol, 0.0) for symbol in symbols)
        return max(round(max(least, _LONGEST_BRIDGE * longest) / self.grid.step), 1)


def signals_of(inputs: InputRecord, sensors: Mapping[str, SensorRecord], span: tuple[float, float]) -> Signals:
    """Put inputs and sensors on a grid over a span of time, s.

    Raises
    ------
    DataError
        If it lasts for weeks: some time stamps are no times.
    """
    if span[1] - span[0] > _LONGEST:
        raise DataError(
            f"the measurements are from t = {span[0]:.6g} s to {span[1]:.6g} s, over two weeks: some of these times "
            "must be wrong; cut the log to the rest (`use` in its map)"
        )
    grid = Grid(span[0], _STEP, max(int((span[1] - span[0]) / _STEP), 1))
    values = {
        symbol: _input_on(grid, inputs.time, inputs.values[:, column]) for column, symbol in enumerate(INPUT_SYMBOLS)
    }
    intervals = {}
    for name, record in sensors.items():
        for component, quantity in enumerate(SENSORS[name]):
            column = record.values[:, component]
            time = record.time[np.isfinite(column)]
            # Of two sensors of one state the first, as those of a vehicle's motion stand before others.
            if time.size > 1 and quantity.symbol not in intervals:
                values[quantity.symbol] = _on(grid, time, continuous(column, quantity))
                intervals[quantity.symbol] = float(np.median(np.diff(time)))
    return Signals(grid, values, intervals)


def span_of(inputs: InputRecord, sensors: Mapping[str, SensorRecord]) -> tuple[float, float]:
    """Return the first and the last time, s, of inputs and sensors."""
    times = [inputs.time, *(record.time for record in sensors.values())]
    return min(float(time[0]) for time in times), max(float(time[-1]) for time in times)


def _on(grid: Grid, time: Array, values: Array) -> Array:
    """Return the mean of each cell, or of slow measurements the line between two."""
    usual = float(np.median(np.diff(time)))
    if usual <= 0.5 * grid.step:
        cell = ((time - grid.start) / grid.step).astype(np.int64)
        inside = (cell >= 0) & (cell < grid.cells)
        count = np.bincount(cell[inside], minlength=grid.cells)
        total = np.bincount(cell[inside], weights=values[inside], minlength=grid.cells)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)
    centres = grid.centres()
    after = np.searchsorted(time, centres)
    between = (after > 0) & (after < time.size)
    after = np.clip(after, 1, time.size - 1)
    bridged = time[after] - time[after - 1] <= _LONGEST_BRIDGE * usual
    return np.where(between & bridged, np.interp(centres, time, values), np.nan)


def _input_on(grid: Grid, time: Array, values: Array) -> Array:
    """Return the mean over each cell of what is held from each time to the next; NaN before the first."""
    edges = grid.start + grid.step * np.arange(grid.cells + 1)
    total = np.append(0.0, np.cumsum(np.diff(time) * values[:-1]))
    beyond = np.maximum(edges - time[-1], 0.0) * values[-1]
    return np.diff(np.interp(edges, time, total, left=np.nan) + beyond) / grid.step


def smoothed(values: Array, window: int) -> Array:
    """Average over `window` cells from each on; NaN where one of them is missing or beyond the end."""
    finite = np.isfinite(values)
    total = np.append(0.0, np.cumsum(np.where(finite, values, 0.0)))
    count = np.append(0, np.cumsum(finite))
    result = np.full(values.size, np.nan)
    if values.size >= window:
        whole = count[window:] - count[:-window] == window
        result[: whole.size] = np.where(whole, (total[window:] - total[:-window]) / window, np.nan)
    return result


def derivative(values: Array, step: float) -> Array:
    """Return the central difference; NaN at both ends and beside what is missing."""
    result = np.full(values.size, np.nan)
    result[1:-1] = (values[2:] - values[:-2]) / (2.0 * step)
    return result


def change(values: Array, window: int) -> Array:
    """Return what is added over `window` cells from each on; NaN beyond the end."""
    result = np.full(values.size, np.nan)
    if values.size > window:
        result[:-window] = values[window:] - values[:-window]
    return result


def without_mean(values: Array, window: int) -> Array:
    """Take off the mean over `window` cells about each; NaN where one of them is missing."""
    means = smoothed(values, window)
    return values - np.concatenate([np.full(window // 2, np.nan), means[: values.size - window // 2]])


class Regression(NamedTuple):
    """Regression of one signal on another, those beside it taken into account.

    Attributes
    ----------
    gain, error : float
        Slope and its standard error; samples within one window count as one.
    correlation : float
        Partial.
    spread : float
        Standard deviation of what the others do not explain of the regressor.
    independent : float
        How many windows would tell as much if each told the same: few where a single event tells all.
    """

    gain: float
    error: float
    correlation: float
    spread: float
    independent: float


def fit(
    values: Array, regressor: Array, others: Sequence[Array], window: int, constant: bool = True
) -> Regression | None:
    """Regress on one signal, on others beside it, and on a constant.

    Parameters
    ----------
    values, regressor : ndarray, shape (n,)
        NaN where not known.
    others : sequence of ndarray
    window : int
        Samples over which the signals were averaged.
    constant : bool
        Whether there is one beside: not where the regressor itself is as good as constant.

    Returns
    -------
    Regression or None
        None if too little is known.
    """
    columns = np.stack([values, regressor, *others])
    complete = np.flatnonzero(np.isfinite(columns).all(axis=0))
    windows = complete.size / window
    if windows < _FEWEST_WINDOWS + len(others):
        return None
    y, *rows = columns[:, complete[:: 1 + complete.size // _MOST_ROWS]]
    beside = np.stack([*(_unit(row) for row in rows[1:]), *[np.ones(y.size)] * constant], axis=1)
    x = rows[0]
    weighted = _weighted(y, x, beside, np.ones(y.size))
    for _ in range(_ROUNDS):
        residual = np.abs(weighted.residual)
        scale = _TUNING * 1.4826 * float(np.median(residual))
        if scale == 0.0:
            break
        weighted = _weighted(y, x, beside, np.minimum(1.0, scale / np.maximum(residual, scale)))
    if not weighted.power > 0.0:
        return Regression(0.0, np.inf, 0.0, 0.0, 0.0)
    correlation = (
        weighted.gain * np.sqrt(weighted.power / weighted.power_of_values) if weighted.power_of_values > 0.0 else 0.0
    )
    error = np.sqrt(weighted.variance / weighted.power / (windows - len(rows)))
    return Regression(
        weighted.gain, float(error), float(correlation), float(np.sqrt(weighted.power)), weighted.evenness * windows
    )


class _Weighted(NamedTuple):
    """A weighted least-squares fit; powers are those of what the others leave.

    Evenness is the share of samples that would tell as much if each told the same.
    """

    gain: float
    residual: Array
    variance: float
    power: float
    power_of_values: float
    evenness: float


def _weighted(y: Array, x: Array, beside: Array, weights: Array) -> _Weighted:
    y_left, x_left = _left(np.stack([y, x], axis=1), beside, weights).T
    share = weights / weights.sum()
    power = float(share @ x_left**2)
    # What is left of a signal that the others hold whole is rounding.
    gain, power = (float(share @ (x_left * y_left)) / power, power) if power > 1e-20 * float(x @ x) else (0.0, 0.0)
    residual = y_left - gain * x_left
    told = share * x_left**2
    evenness = power**2 / (x.size * float(told @ told)) if power > 0.0 else 0.0
    return _Weighted(gain, residual, float(share @ residual**2), power, float(share @ y_left**2), evenness)


def _unit(values: Array) -> Array:
    size = float(np.sqrt(np.mean(values**2)))
    return values / size if size > 0.0 else values


def _left(values: Array, beside: Array, weights: Array) -> Array:
    """Return what weighted least squares leave of each signal, a column of `values`."""
    root = np.sqrt(weights)[:, None]
    solution = np.linalg.lstsq(root * beside, root * values, rcond=1e-10)[0]
    return values - beside @ solution


class Relation(NamedTuple):
    """Terms whose sum a signal equals: `main` plus `others`."""

    main: Array
    others: tuple[Array, ...]

    def total(self) -> Array:
        """Return the sum."""
        return sum(self.others, self.main)


def attitude_rates(signals: Signals, heading: str = "psi") -> dict[str, Relation]:
    """Return body rates by the change of attitude, Fossen (2011), eq. (2.26) inverted; by symbol.

    What stands first contains the angle about the same axis. Only rates about whose axis an angle is measured; another
    angle that is not is taken as zero. The changes are those over `attitude_window`.
    """
    value, step = signals.values, signals.grid.step
    level, half = np.zeros(signals.grid.cells), attitude_window(signals, heading) // 2
    phi, theta, psi = (value.get(symbol, level) for symbol in ("phi", "theta", heading))
    phi_dot, theta_dot, psi_dot = (rate_of_change(angle, step, half) for angle in (phi, theta, psi))
    relations = {
        ("p", "phi"): Relation(phi_dot, (-psi_dot * np.sin(theta),)),
        ("q", "theta"): Relation(theta_dot * np.cos(phi), (psi_dot * np.cos(theta) * np.sin(phi),)),
        ("r", heading): Relation(psi_dot * np.cos(theta) * np.cos(phi), (-theta_dot * np.sin(phi),)),
    }
    return {rate: relation for (rate, angle), relation in relations.items() if signals.has(angle)}


def attitude_window(signals: Signals, heading: str = "psi") -> int:
    """Say over how many cells a change of attitude tells a rate: a second, or a few measurements of an angle."""
    return signals.window("phi", "theta", heading, least=TURN_RATE_WINDOW)


def rates_by_sensor(signals: Signals, symbol: str) -> dict[str, Array]:
    """Return a rate as each sensor has it: "gyroscope", and "attitude", or where there is none "magnetometer"."""
    by_sensor = {"gyroscope": signals.values[symbol]} if signals.has(symbol) else {}
    for name, heading in (("attitude", "psi"), ("magnetometer", "heading")):
        rates = attitude_rates(signals, heading)
        if symbol in rates:
            return by_sensor | {name: rates[symbol].total()}
    return by_sensor


def measured_forces(signals: Signals) -> dict[str, Relation]:
    """Return specific force by the symbol of the velocity whose change it contains; needs attitude and DVL."""
    if not signals.has("phi", "theta", "psi", "u", "v", "w", "fx", "fy", "fz"):
        return {}
    rates = attitude_rates(signals)
    value = signals.values
    p, q, r = (rates[symbol].total() for symbol in "pqr")
    u, v, w, phi, theta = (value[symbol] for symbol in ("u", "v", "w", "phi", "theta"))
    u_dot, v_dot, w_dot = (derivative(each, signals.grid.step) for each in (u, v, w))
    return {
        "u": Relation(u_dot, (q * w, -r * v, GRAVITY * np.sin(theta))),
        "v": Relation(v_dot, (r * u, -p * w, -GRAVITY * np.cos(theta) * np.sin(phi))),
        "w": Relation(w_dot, (p * v, -q * u, -GRAVITY * np.cos(theta) * np.cos(phi))),
    }


def measured_depth_rate(signals: Signals) -> Array:
    """Return the change of the measured depth, m/s."""
    return derivative(signals.values["down"], signals.grid.step)


def diving_speed(signals: Signals) -> Relation | None:
    """Return the depth rate by pitch and surge, and by heave and sway as far as they and roll are measured."""
    if not signals.has("u", "theta"):
        return None
    value, level = signals.values, np.zeros(signals.grid.cells)
    phi, theta = value.get("phi", level), value["theta"]
    v, w = value.get("v", level), value.get("w", level)
    return Relation(-value["u"] * np.sin(theta), (w * np.cos(theta) * np.cos(phi), v * np.cos(theta) * np.sin(phi)))


def regress_relation(values: Array, main: Array, others: Sequence[Array], window: int) -> Regression | None:
    """Regress averages over a window on the main term of a relation; the others have gains of their own."""
    # Of the others only the signs and scales of what is looked at elsewhere could be wrong.
    return fit(smoothed(values, window), smoothed(main, window), [smoothed(each, window) for each in others], window)


def lever_arm_acceleration(signals: Signals) -> dict[str, Array]:
    """Return the acceleration that turning adds per metre of lever arm along the hull, by the symbol of the velocity.

    Empty without attitude.
    """
    rates = attitude_rates(signals)
    if len(rates) < 3:
        return {}
    p, q, r = (signals.values.get(symbol, rates[symbol].total()) for symbol in "pqr")
    q_dot, r_dot = (derivative(each, signals.grid.step) for each in (q, r))
    return {"v": r_dot + p * q, "w": p * r - q_dot}
