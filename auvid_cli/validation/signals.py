"""Measurements as one signal for each measured motion state."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, SENSORS, state_of

Array = NDArray[np.float64]

_ANGLES = MOTION_SYMBOLS[6:]
# s; times that differ by less are the same: those of events are whole nanoseconds, half of one from a measurement's.
SAME = 0.75e-9


class MeasuredSignal(NamedTuple):
    """Measurements of one motion state.

    Attributes
    ----------
    time, values : ndarray, shape (n,)
        Finite measurements only, s and SI; angles without jumps of a turn.
    deviation : float
        Stated standard deviation of a measurement, SI.
    """

    time: Array
    values: Array
    deviation: float

    def since(self, time: float) -> int:
        """Return the index of the first measurement at or after a time."""
        return int(np.searchsorted(self.time, time - SAME))

    def turns(self, time: float, value: float) -> float:
        """Return what to add to a value to be on the same turn as the measurements, rad; a multiple of a turn."""
        measurement = self.values[max(int(np.searchsorted(self.time, time + SAME)) - 1, 0)]
        return 2.0 * np.pi * float(np.round((measurement - value) / (2.0 * np.pi)))


def is_angle(symbol: str) -> bool:
    """Say whether a motion state is known modulo a turn."""
    return symbol in _ANGLES


def measured_signals(measuring: Mapping[str, SensorRecord]) -> dict[str, MeasuredSignal]:
    """Return signals by motion symbol, in the order of the motion states; those that are measured."""
    signals = {}
    for name, record in measuring.items():
        for component, quantity in enumerate(SENSORS[name]):
            values = record.values[:, component]
            finite = np.isfinite(values)
            if finite.any():
                symbol = state_of(quantity)
                continuous = np.unwrap(values[finite]) if is_angle(symbol) else values[finite]
                deviation = float(record.standard_deviation[component])
                signals[symbol] = MeasuredSignal(record.time[finite], continuous, deviation)
    return {symbol: signals[symbol] for symbol in MOTION_SYMBOLS if symbol in signals}
