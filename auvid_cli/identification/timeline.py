"""From a dataset to events in time order, each sensor at its own times."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import SENSORS, Dataset, SensorRecord
from auvid_cli.errors import DataError
from auvid_cli.filters.problem import Sensors, Timeline
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, N_MOTION

Array = NDArray[np.float64]

# Heading is known modulo a turn; roll and pitch are treated alike, which costs nothing.
_ANGULAR = ("phi", "theta", "psi")
_NANOSECOND = 1e-9


def measuring_sensors(dataset: Dataset) -> dict[str, SensorRecord]:
    """The sensors that measure motion states and have at least one valid sample.

    Raises
    ------
    DataError
        If there is none, or one states no positive noise.
    """
    measuring = {}
    for name, record in dataset.sensors.items():
        symbols = [quantity.symbol for quantity in SENSORS[name]]
        if set(symbols) <= set(MOTION_SYMBOLS) and np.isfinite(record.values).any():
            if not (record.standard_deviation > 0.0).all():
                raise DataError(f"sensor {name}: its standard deviation must be greater than 0 for a filter")
            measuring[name] = record
    if not measuring:
        raise DataError("the dataset has no valid sample of a sensor that measures motion (dvl, gyroscope, attitude)")
    return measuring


def measurement_model(measuring: dict[str, SensorRecord], n_parameters: int) -> Sensors:
    """Rows that select the measured motion states from an augmented state with parameters first."""
    width = max(record.values.shape[1] for record in measuring.values())
    matrix = np.zeros((len(measuring), width, n_parameters + N_MOTION))
    variance = np.ones((len(measuring), width))
    angular = np.zeros((len(measuring), width), dtype=np.bool_)
    for sensor, (name, record) in enumerate(measuring.items()):
        for component, quantity in enumerate(SENSORS[name]):
            matrix[sensor, component, n_parameters + MOTION_SYMBOLS.index(quantity.symbol)] = 1.0
            variance[sensor, component] = record.standard_deviation[component] ** 2
            angular[sensor, component] = quantity.symbol in _ANGULAR
    return Sensors(matrix, variance, angular, np.zeros(len(measuring), dtype=np.bool_))


def initial_motion(dataset: Dataset, measuring: dict[str, SensorRecord]) -> tuple[float, Array]:
    """Where a filter starts: when every sensor has spoken, and what each said last by then.

    Returns
    -------
    time : float
        s, not before the first input.
    motion : ndarray, shape (9,)
        Zero for what no sensor measures.
    """
    firsts = [record.time[np.isfinite(record.values).all(axis=1)] for record in measuring.values()]
    start = max([float(dataset.inputs.time[0]), *(float(times[0]) for times in firsts if times.size)])
    motion = np.zeros(N_MOTION)
    for name, record in measuring.items():
        for component, quantity in enumerate(SENSORS[name]):
            said = np.isfinite(record.values[:, component]) & (record.time <= start)
            if said.any():
                motion[MOTION_SYMBOLS.index(quantity.symbol)] = record.values[said, component][-1]
    return start, motion


def build_timeline(dataset: Dataset, measuring: dict[str, SensorRecord], start: float, step: float) -> Timeline:
    """Merge all readings from `start` on; nothing is resampled.

    Parameters
    ----------
    dataset : Dataset
        Its inputs are constant from each of their times to the next.
    measuring : dict of SensorRecord
    start : float
        s.
    step : float
        Longest piece of integration, s. Times are compared in whole nanoseconds, so that two clocks
        that mean the same instant share an event.
    """
    width = max(record.values.shape[1] for record in measuring.values())
    ticks, sensors, readings = [], [], []
    for sensor, record in enumerate(measuring.values()):
        used = (record.time >= start) & np.isfinite(record.values).any(axis=1)
        ticks.append(_nanoseconds(record.time[used]))
        sensors.append(np.full(int(used.sum()), sensor))
        padded = np.full((int(used.sum()), width), np.nan)
        padded[:, : record.values.shape[1]] = np.where(np.isfinite(record.values), record.values, np.nan)[used]
        readings.append(padded)
    tick = np.concatenate(ticks)
    if tick.size == 0:
        raise DataError(f"no reading is left at or after t = {start:g} s, where inputs and all sensors have begun")
    order = np.lexsort((np.concatenate(sensors), tick))
    events, first_reading = np.unique(tick[order], return_index=True)

    changes = _nanoseconds(dataset.inputs.time)
    _check_coverage(changes, events)
    inside = changes[(changes > events[0]) & (changes < events[-1])]
    cuts = np.union1d(events, inside)
    gaps = np.diff(cuts)
    parts = np.maximum(np.ceil(gaps * _NANOSECOND / step - 1e-6).astype(np.int64), 1)
    held = np.maximum(np.searchsorted(changes, cuts[:-1], side="right") - 1, 0)
    # Pieces between consecutive cuts; an event's pieces are those since the event before.
    pieces_before_cut = np.concatenate([[0], np.cumsum(parts)])
    offset = pieces_before_cut[np.searchsorted(cuts, events)]
    return Timeline(
        time=events * _NANOSECOND,
        piece_offset=np.concatenate([[0], offset]),
        piece_duration=np.repeat(gaps * _NANOSECOND / parts, parts),
        piece_input=np.repeat(held, parts),
        inputs=np.ascontiguousarray(dataset.inputs.values),
        reading_offset=np.concatenate([first_reading, [tick.size]]),
        reading_sensor=np.concatenate(sensors)[order],
        reading=np.concatenate(readings)[order],
    )


def _check_coverage(changes: NDArray[np.int64], events: NDArray[np.int64]) -> None:
    """Inputs hold until the next one, but not for ever: a second, or as long as they ever did."""
    longest = max(1.0, float(np.diff(changes).max(initial=0)) * _NANOSECOND)
    if events[-1] - changes[-1] > longest / _NANOSECOND:
        raise DataError(
            f"the inputs end at t = {changes[-1] * _NANOSECOND:g} s, the readings go on to "
            f"{events[-1] * _NANOSECOND:g} s: cut the readings or extend the inputs"
        )


def _nanoseconds(time: Array) -> NDArray[np.int64]:
    return np.rint(time / _NANOSECOND).astype(np.int64)
