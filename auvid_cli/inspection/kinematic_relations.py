"""Sensors on a common time grid, and regression of the kinematic relations between them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.data.signals import TURN_RATE_WINDOW, rate_of_change
from auvid_cli.errors import DataError
from auvid_cli.inspection.single_sensor import continuous
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, SENSORS
from auvid_cli.vehicle.rigid_body import GRAVITY

_STEP = 0.1  # s, cell of the grid
_MAX_SPAN = 14 * 86400.0  # s
_MAX_EMPTY = 1_000_000  # cells that a grid may have with any number of samples
_MAX_CELLS_PER_SAMPLE = 10
_MAX_BRIDGE = 3.0  # longest interval that is interpolated, in median intervals of the sensor
_MAX_ROWS = 20_000  # largest number of samples in a regression
_MIN_WINDOWS = 15  # smallest number of windows in a regression
_HUBER_TUNING = 1.345  # robust standard deviations: 95 % as efficient as least squares for Gaussian noise
_HUBER_ITERATIONS = 12
_MIN_SHARE = 1e-10  # of a direction of the further regressors in the largest; less is rounding
_MIN_POWER = 1e-20  # unexplained share of a regressor's power; less is rounding


class Grid(NamedTuple):
    """Cells of equal length, s."""

    start: float
    step: float
    cells: int

    def centres(self) -> Array:
        """Return the middle of each cell, s."""
        return self.start + self.step * (0.5 + np.arange(self.cells, dtype=np.float64))


class Signals(NamedTuple):
    """Measured components and inputs on a grid."""

    grid: Grid
    values: dict[str, Array]  # by symbol, shape (cells,); NaN where nothing was measured
    interval: dict[str, float]  # by symbol of a measured component: median interval of its measurements, s

    def has(self, *symbols: str) -> bool:
        """Whether all these symbols were measured."""
        return all(symbol in self.values for symbol in symbols)

    def blank(self, symbol: str, start: float, end: float) -> None:
        """Set the cells that overlap a time span, s, to NaN."""
        first, last = (int((time - self.grid.start) / self.grid.step) for time in (start, end))
        if symbol in self.values:
            self.values[symbol][max(first, 0) : last + 1] = np.nan

    def window(self, *symbols: str, least: float = 1.0) -> int:
        """Return the number of cells that contain `least`, s, and a few measurements of the slowest component."""
        longest = max(self.interval.get(symbol, 0.0) for symbol in symbols)
        return max(round(max(least, _MAX_BRIDGE * longest) / self.grid.step), 1)


def signals_of(inputs: InputRecord, sensors: Mapping[str, SensorRecord], span: tuple[float, float]) -> Signals:
    """Return inputs and sensors on a grid over a time span, s; DataError if it is too long or nearly empty."""
    if span[1] - span[0] > _MAX_SPAN:
        raise DataError(
            f"measurements from t = {span[0]:.6g} s to {span[1]:.6g} s span over two weeks; some time stamps must be "
            "wrong. Cut the log to the valid part (`use` in its map)"
        )
    grid = Grid(span[0], _STEP, max(int((span[1] - span[0]) / _STEP), 1))
    samples = sum(record.time.size for record in (inputs, *sensors.values()))
    if grid.cells > max(_MAX_EMPTY, _MAX_CELLS_PER_SAMPLE * samples):
        raise DataError(
            f"only {samples} samples from t = {span[0]:.6g} s to {span[1]:.6g} s; some time stamps must be wrong. Cut "
            "the log to the valid part (`use` in its map)"
        )
    values = {
        symbol: _input_on(grid, inputs.time, inputs.values[:, column]) for column, symbol in enumerate(INPUT_SYMBOLS)
    }
    intervals = {}
    for name, record in sensors.items():
        for component, quantity in enumerate(SENSORS[name]):
            column = record.values[:, component]
            time = record.time[np.isfinite(column)]
            # The first of two sensors of one state is that of the vehicle's motion.
            if time.size > 1 and quantity.symbol not in intervals:
                values[quantity.symbol] = _on(grid, time, continuous(column, quantity))
                intervals[quantity.symbol] = float(np.median(np.diff(time)))
    return Signals(grid, values, intervals)


def span_of(inputs: InputRecord, sensors: Mapping[str, SensorRecord]) -> tuple[float, float]:
    """Return the first and the last time, s, of inputs and sensors."""
    times = [inputs.time, *(record.time for record in sensors.values())]
    return min(float(time[0]) for time in times), max(float(time[-1]) for time in times)


def _on(grid: Grid, time: Array, values: Array) -> Array:
    """Return the mean in each cell; the linear interpolation for slow measurements."""
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
    bridged = time[after] - time[after - 1] <= _MAX_BRIDGE * usual
    return np.where(between & bridged, np.interp(centres, time, values), np.nan)


def _input_on(grid: Grid, time: Array, values: Array) -> Array:
    """Return the mean in each cell of an input that is held between its times; NaN before the first."""
    edges = grid.start + grid.step * np.arange(grid.cells + 1)
    total = np.append(0.0, np.cumsum(np.diff(time) * values[:-1]))
    beyond = np.maximum(edges - time[-1], 0.0) * values[-1]
    return np.diff(np.interp(edges, time, total, left=np.nan) + beyond) / grid.step


def smoothed(values: Array, window: int) -> Array:
    """Return the mean over `window` cells from each cell on; NaN where one is missing or beyond the end."""
    finite = np.isfinite(values)
    total = np.append(0.0, np.cumsum(np.where(finite, values, 0.0)))
    count = np.append(0, np.cumsum(finite))
    result = np.full(values.size, np.nan)
    if values.size >= window:
        whole = count[window:] - count[:-window] == window
        result[: whole.size] = np.where(whole, (total[window:] - total[:-window]) / window, np.nan)
    return result


def derivative(values: Array, step: float) -> Array:
    """Return the central difference; NaN at both ends and next to missing values."""
    result = np.full(values.size, np.nan)
    result[1:-1] = (values[2:] - values[:-2]) / (2.0 * step)
    return result


def change(values: Array, window: int) -> Array:
    """Return the difference over `window` cells from each cell on; NaN beyond the end."""
    result = np.full(values.size, np.nan)
    if values.size > window:
        result[:-window] = values[window:] - values[:-window]
    return result


def mean_between_middles(values: Array, window: int) -> Array:
    """Return the mean from the middle of each cell to that of the cell `window` later; these two cells count half."""
    means = smoothed(values, window)
    return 0.5 * (means + np.append(means[1:], np.nan))


def without_mean(values: Array, window: int) -> Array:
    """Subtract the mean over `window` cells around each; NaN where one of them is missing."""
    means = smoothed(values, window)
    return values - np.concatenate([np.full(window // 2, np.nan), means[: values.size - window // 2]])


class Regression(NamedTuple):
    """Regression of one signal on another, given further regressors."""

    gain: float  # slope
    error: float  # standard error of the slope; samples within one window count as one
    correlation: float  # partial correlation
    spread: float  # standard deviation of the regressor, without the part that the further regressors explain
    independent: float  # effective number of windows: small if a single event dominates


def fit(
    values: Array, regressor: Array, others: Sequence[Array], window: int, constant: bool = True
) -> Regression | None:
    """Return the robust (Huber) regression of `values` on `regressor`, given `others`; None with too few data.

    Parameters
    ----------
    values, regressor : ndarray, shape (n,)
        NaN where unknown.
    others : sequence of ndarray, shape (n,)
    window : int
        Samples over which the signals were averaged.
    constant : bool
        Whether a constant is a further regressor; False if the regressor is nearly constant.
    """
    columns = np.stack([values, regressor, *others])
    complete = np.flatnonzero(np.isfinite(columns).all(axis=0))
    windows = complete.size / window
    if windows < _MIN_WINDOWS + len(others):
        return None
    y, x, *rows = columns[:, complete[:: 1 + complete.size // _MAX_ROWS]]
    further = _basis(np.stack([*(_unit(row) for row in rows), *[np.ones(y.size)] * constant], axis=1))
    weighted = _weighted(y, x, further, np.ones(y.size))
    for _ in range(_HUBER_ITERATIONS):
        residual = np.abs(weighted.residual)
        scale = _HUBER_TUNING * 1.4826 * float(np.median(residual))
        if scale == 0.0:
            break
        weighted = _weighted(y, x, further, np.minimum(1.0, scale / np.maximum(residual, scale)))
    if not weighted.power > 0.0:
        return Regression(0.0, np.inf, 0.0, 0.0, 0.0)
    correlation = (
        weighted.gain * np.sqrt(weighted.power / weighted.power_of_values) if weighted.power_of_values > 0.0 else 0.0
    )
    error = np.sqrt(weighted.variance / weighted.power / (windows - (1 + len(rows))))
    return Regression(
        weighted.gain, float(error), float(correlation), float(np.sqrt(weighted.power)), weighted.evenness * windows
    )


class _Weighted(NamedTuple):
    """Weighted least-squares fit."""

    gain: float
    residual: Array
    variance: float
    power: float  # mean square of the regressor, without the part that the further regressors explain
    power_of_values: float  # the same of the values
    evenness: float  # effective share of the samples: 1 if all have the same weight in the fit


def _weighted(y: Array, x: Array, further: Array, weights: Array) -> _Weighted:
    both, weighted = np.stack([y, x], axis=1), weights[:, None] * further
    # `further` is orthonormal, so that these normal equations are as well conditioned as the weights.
    y, x_unexplained = (both - further @ np.linalg.solve(weighted.T @ further, weighted.T @ both)).T
    share = weights / weights.sum()
    power = float(share @ x_unexplained**2)
    gain = 0.0
    if power > _MIN_POWER * float(x @ x):
        gain = float(share @ (x_unexplained * y)) / power
    else:
        power = 0.0
    residual = y - gain * x_unexplained
    leverage = share * x_unexplained**2
    evenness = power**2 / (x.size * float(leverage @ leverage)) if power > 0.0 else 0.0
    return _Weighted(gain, residual, float(share @ residual**2), power, float(share @ y**2), evenness)


def _basis(columns: Array) -> Array:
    """Return orthonormal columns that span the same space."""
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return basis[:, sizes > _MIN_SHARE * sizes.max(initial=0.0)]


def _unit(values: Array) -> Array:
    size = float(np.sqrt(np.mean(values**2)))
    return values / size if size > 0.0 else values


class Relation(NamedTuple):
    """Right-hand side of a kinematic relation: a signal equals `main` plus the sum of `others`."""

    main: Array
    others: tuple[Array, ...]

    def total(self) -> Array:
        """Return the sum of all terms."""
        return sum(self.others, self.main)


def attitude_rates(signals: Signals, heading: str = "psi") -> dict[str, Relation]:
    """Return body rates from the change of attitude, Fossen (2011), eq. (2.26) inverted; by symbol.

    The main term contains the angle about the same axis; a rate whose angle is not measured is left out. Other angles
    that are not measured are zero. Changes are those over `attitude_window`.
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
    """Return the number of cells over which attitude is differentiated: a second, or a few measurements of an angle."""
    return signals.window("phi", "theta", heading, least=TURN_RATE_WINDOW)


def rates_by_sensor(signals: Signals, symbol: str) -> dict[str, Array]:
    """Return a rate by sensor: "gyroscope", and "attitude" or, without a heading there, "magnetometer"."""
    by_sensor = {"gyroscope": signals.values[symbol]} if signals.has(symbol) else {}
    for name, heading in (("attitude", "psi"), ("magnetometer", "heading")):
        rates = attitude_rates(signals, heading)
        if symbol in rates:
            return by_sensor | {name: rates[symbol].total()}
    return by_sensor


def measured_forces(signals: Signals) -> dict[str, Relation]:
    """Return the specific force along u, v and w from DVL and attitude; the main term is the change of the velocity.

    Empty without these sensors or an accelerometer.
    """
    if not signals.has("phi", "theta", "psi", "u", "v", "w", "fx", "fy", "fz"):
        return {}
    rates = attitude_rates(signals)
    value = signals.values
    p, q, r = (rates[symbol].total() for symbol in "pqr")
    u, v, w, phi, theta = (value[symbol] for symbol in ("u", "v", "w", "phi", "theta"))
    u_dot, v_dot, w_dot = (derivative(values, signals.grid.step) for values in (u, v, w))
    return {
        "u": Relation(u_dot, (q * w, -r * v, GRAVITY * np.sin(theta))),
        "v": Relation(v_dot, (r * u, -p * w, -GRAVITY * np.cos(theta) * np.sin(phi))),
        "w": Relation(w_dot, (p * v, -q * u, -GRAVITY * np.cos(theta) * np.cos(phi))),
    }


def measured_depth_rate(signals: Signals) -> Array:
    """Return the change of the measured depth, m/s."""
    return derivative(signals.values["down"], signals.grid.step)


def diving_speed(signals: Signals) -> Relation | None:
    """Return the depth rate, m/s, from pitch and surge, and from heave, sway and roll if measured."""
    if not signals.has("u", "theta"):
        return None
    value, level = signals.values, np.zeros(signals.grid.cells)
    phi, theta = value.get("phi", level), value["theta"]
    v, w = value.get("v", level), value.get("w", level)
    return Relation(-value["u"] * np.sin(theta), (w * np.cos(theta) * np.cos(phi), v * np.cos(theta) * np.sin(phi)))


def regress_relation(values: Array, main: Array, others: Sequence[Array], window: int) -> Regression | None:
    """Return the regression of window means on the main term of a relation; other terms have gains of their own."""
    return fit(smoothed(values, window), smoothed(main, window), [smoothed(term, window) for term in others], window)


def lever_arm_acceleration(signals: Signals) -> dict[str, Array]:
    """Return the acceleration due to rotation per metre of lever arm along the hull, by velocity.

    Empty without attitude.
    """
    rates = attitude_rates(signals)
    if len(rates) < 3:
        return {}
    p, q, r = (signals.values.get(symbol, rates[symbol].total()) for symbol in "pqr")
    q_dot, r_dot = (derivative(values, signals.grid.step) for values in (q, r))
    return {"v": r_dot + p * q, "w": p * r - q_dot}
