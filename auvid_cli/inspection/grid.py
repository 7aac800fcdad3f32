"""Everything on one time base: for comparing sensors with each other only, never for identifying."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.errors import DataError
from auvid_cli.inspection.single_sensor import continuous
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, SENSORS

Array = NDArray[np.float64]

# s
_STEP, _LONGEST = 0.1, 14 * 86400.0
# Usual intervals that may be bridged.
_LONGEST_BRIDGE = 3.0


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
