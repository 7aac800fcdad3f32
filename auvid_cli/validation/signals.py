"""Measurements as one signal for each measured motion state, and of the depth."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.rate_of_change import WHILE_TURNING, rate_noise, rate_of_change
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS, MOTION_SYMBOLS, SENSORS, state_of

Array = NDArray[np.float64]

_ANGLES = MOTION_SYMBOLS[6:]
# s; times that differ by less are the same: those of events are whole nanoseconds, half of one from a measurement's.
SAME = 0.75e-9
# Headings before and after one of which the yaw rate is told, at least.
_FEWEST_AROUND = 2


class MeasuredSignal(NamedTuple):
    """Measurements of one motion state, or of the depth.

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


class SignalSize(NamedTuple):
    """What the measurements of one signal are like, over all segments.

    Attributes
    ----------
    deviation : float
        Stated standard deviation of a measurement, SI; of several, root of the mean square.
    variance : float
        Of the measurements about the mean of their segment, SI.
    """

    deviation: float
    variance: float


def is_angle(symbol: str) -> bool:
    """Say whether a motion state is known modulo a turn."""
    return symbol in _ANGLES


def measured_signals(measuring: Mapping[str, SensorRecord]) -> dict[str, MeasuredSignal]:
    """Return signals by symbol, motion states in their order and the depth; those that are measured."""
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
    if "r" not in signals and (yaw_rate := _yaw_rate_by_attitude(signals)) is not None:
        signals["r"] = yaw_rate
    return {symbol: signals[symbol] for symbol in MOTION_AND_DEPTH_SYMBOLS if symbol in signals}


def signal_sizes(segments: Sequence[Mapping[str, MeasuredSignal]]) -> dict[str, SignalSize]:
    """Return what signals of several segments are like, by symbol, in the order of `measured_signals`."""
    sizes = {}
    for symbol in MOTION_AND_DEPTH_SYMBOLS:
        if own := [signals[symbol] for signals in segments if symbol in signals]:
            weights = [signal.values.size for signal in own]
            noise, variance = ([s.deviation**2 for s in own], [float(s.values.var()) for s in own])
            sizes[symbol] = SignalSize(
                float(np.sqrt(np.average(noise, weights=weights))), float(np.average(variance, weights=weights))
            )
    return sizes


def _yaw_rate_by_attitude(signals: Mapping[str, MeasuredSignal]) -> MeasuredSignal | None:
    """Take the yaw rate from how the attitude changes, by cubics through a second of it.

    ``r = psi_dot cos phi cos theta - theta_dot sin phi`` (Fossen 2011, eq. 2.28); an angle that is not measured at the
    times of the heading is taken as zero. None if there is no heading, or it comes too seldom.
    """
    if "psi" not in signals or signals["psi"].time.size < 3:
        return None
    time, heading, deviation = signals["psi"]
    interval = float(np.median(np.diff(time)))
    half = round(0.5 * WHILE_TURNING / interval)
    # Half a window before and after, and a little more, measurements come without a gap.
    ends = np.concatenate([[True], np.diff(time) > 0.5 * WHILE_TURNING, [True]])
    last_begin = np.maximum.accumulate(np.where(ends[:-1], time, -np.inf))
    next_end = np.minimum.accumulate(np.where(ends[1:], time, np.inf)[::-1])[::-1]
    good = np.minimum(time - last_begin, next_end - time) >= (half + 0.9) * interval
    if half < _FEWEST_AROUND or not good.any():
        return None
    # One more than there are headings, so that the last is between two.
    even = time[0] + interval * np.arange(int((time[-1] - time[0]) / interval) + 2)

    def rate(angle: Array) -> Array:
        return np.interp(time, even, rate_of_change(np.interp(even, time, angle), interval, half))

    angles = (signals.get(symbol) for symbol in ("phi", "theta"))
    roll, pitch = (
        angle.values if angle is not None and np.array_equal(angle.time, time) else np.zeros(time.size)
        for angle in angles
    )
    yaw_rate = rate(heading) * np.cos(roll) * np.cos(pitch) - rate(pitch) * np.sin(roll)
    return MeasuredSignal(time[good], yaw_rate[good], rate_noise(interval, half) * deviation)
