"""Turns, and standard manoeuvres found in the data: overshoots of a zigzag, steady turn of a turning circle."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.data.dataset import InputRecord
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.validation.motion_prediction import MeasuredSignal
from auvid_cli.validation.results import ManoeuvreNumber
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, MOTION_SYMBOLS
from auvid_cli.vehicle.rigid_body import body_to_earth

_RUDDER = INPUT_SYMBOLS.index("rudder")
_MIN_RUDDER = np.deg2rad(2.0)  # rad, smallest maximum of the rudder in a manoeuvre
_HOLD_TOLERANCE = 0.1  # tolerance of a held rudder, as a share of its level
_MIN_HELD_SHARE = 0.8  # share of the samples of a hold within the tolerance
_MIN_HOLD = 1.0  # s
_MAX_REVERSAL = 3.0  # s
_MAX_HEADING_SPREAD = 0.2  # spread of the heading at reversals of a zigzag, relative to its mean size
_TRANSIENT = np.pi  # rad, change of heading before a turn is steady
_MIN_STEADY_TURN = np.pi  # rad
_FIT_TIME = 0.5  # s on either side, fitted by a parabola of the heading
_MIN_FIT = 5  # measurements
_APPROACH = 10.0  # s before a turn, over which the approach speed is averaged
_TURN_WINDOW = 2.0  # s, over which the heading changes
_MIN_TURN_SHARE = 0.3  # turn rate from which the vehicle turns, as a share of the large ones
_LARGE_QUANTILE = 0.95  # quantile of the turn rates that is a large one
_MIN_TURN_RATE = np.deg2rad(1.0)  # rad/s; slower is the wander of a straight course
TILT = "phi", "theta"


class TurningTimes(NamedTuple):
    """Whether the vehicle turns."""

    time: Array  # s, shape (n,), increasing
    turning: NDArray[np.bool_]  # shape (n,)

    def at(self, time: float) -> bool:
        """Return whether the vehicle turns at a time, s."""
        return bool(self.turning[min(int(np.searchsorted(self.time, time)), self.time.size - 1)])


def turning_times(signals: Mapping[str, MeasuredSignal]) -> TurningTimes | None:
    """Return when the vehicle turns, from the heading, else from the yaw rate; None if neither is measured."""
    if "psi" in signals:
        time, heading = signals["psi"].time, signals["psi"].values
    elif "r" in signals:
        time, rate = signals["r"].time, signals["r"].values
        heading = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])
    else:
        return None
    half = 0.5 * _TURN_WINDOW
    change = np.interp(time + half, time, heading) - np.interp(time - half, time, heading)
    rates = np.abs(change) / _TURN_WINDOW
    return TurningTimes(time, rates > max(_MIN_TURN_SHARE * np.quantile(rates, _LARGE_QUANTILE), _MIN_TURN_RATE))


class Hold(NamedTuple):
    """A rudder that is held at a level, rad, from begin to end, s."""

    begin: float
    end: float
    level: float


def rudder_holds(inputs: InputRecord) -> list[Hold]:
    """Return the time spans in which the rudder is deflected and constant."""
    rudder = inputs.values[:, _RUDDER]
    largest = float(np.abs(rudder).max())
    if largest < _MIN_RUDDER:
        return []
    side = np.where(np.abs(rudder) > 0.5 * largest, np.sign(rudder), 0.0)
    edges = np.concatenate([[0], 1 + np.flatnonzero(np.diff(side)), [side.size]])
    holds = []
    for first, last in pairwise(edges):
        level = float(np.median(rudder[first:last]))
        held = np.flatnonzero(np.abs(rudder[first:last] - level) <= _HOLD_TOLERANCE * abs(level)) + first
        if side[first] == 0.0 or held.size < _MIN_HELD_SHARE * (last - first):
            continue
        end = min(int(held[-1]) + 1, rudder.size - 1)
        if inputs.time[end] - inputs.time[held[0]] >= _MIN_HOLD:
            holds.append(Hold(float(inputs.time[held[0]]), float(inputs.time[end]), level))
    return holds


def manoeuvre_numbers(
    inputs: InputRecord, signals: Mapping[str, MeasuredSignal], run: FreeRun
) -> list[ManoeuvreNumber]:
    """Return the measured and predicted numbers of all zigzags and turning circles in the data.

    `signals` are measurements by motion symbol; `run` has the same inputs, and only its measured signals are used.
    """
    if "psi" not in signals:
        return []
    predicted = {
        s: MeasuredSignal(run.time, run.motion[:, i], 0.0) for i, s in enumerate(MOTION_SYMBOLS) if s in signals
    }
    begin, end = signals["psi"].time[[0, -1]]
    holds = [hold for hold in rudder_holds(inputs) if begin <= hold.begin and hold.end <= end + _FIT_TIME]
    numbers = []
    for chain in _chains(holds):
        numbers += _zigzag(chain, signals["psi"], predicted["psi"])
    for hold in holds:
        numbers += _turning_circle(hold, signals, predicted)
    return numbers


def _chains(holds: Sequence[Hold]) -> list[list[Hold]]:
    """Return chains of at least three holds to alternating sides, with quick reversals."""
    chains: list[list[Hold]] = []
    for hold in holds:
        before = chains[-1][-1] if chains else None
        follows = before is not None and hold.begin - before.end <= _MAX_REVERSAL
        if before is not None and follows and np.isclose(hold.level, -before.level, rtol=_HOLD_TOLERANCE):
            chains[-1].append(hold)
        else:
            chains.append([hold])
    return [chain for chain in chains if len(chain) >= 3]


def _zigzag(chain: Sequence[Hold], measured: MeasuredSignal, predicted: MeasuredSignal) -> list[ManoeuvreNumber]:
    """Return the overshoot of the heading after each reversal."""
    course = heading_at(measured, chain[0].begin)
    turned = np.array([heading_at(measured, hold.end) - course for hold in chain[:-1]])
    alternates = bool((np.diff(np.sign(turned)) != 0.0).all())
    sizes = np.abs(turned)
    if not alternates or np.ptp(sizes) > _MAX_HEADING_SPREAD * sizes.mean():
        return []
    numbers = []
    for i, (hold, after) in enumerate(pairwise(chain), 1):
        side = float(np.sign(turned[i - 1]))
        angle = overshoot(measured, hold.end, after.end, side)
        if angle is not None:
            expected = overshoot(predicted, hold.end, after.end, side)
            name = f"zigzag {np.rad2deg(abs(hold.level)):.3g}"
            numbers.append(ManoeuvreNumber(name, f"overshoot {i}", hold.end, "rad", angle, expected))
    return numbers


def overshoot(heading: MeasuredSignal, reversal: float, end: float, side: float) -> float | None:
    """Return the change of a heading to a side, 1 or -1, after a reversal, rad; None if it does not come back."""
    span = slice(*np.searchsorted(heading.time, [reversal, end]))
    time, values = heading.time[span], side * heading.values[span]
    if time.size < 3 or not np.isfinite(values).all():
        return None
    farthest = float(time[values.argmax()])
    if farthest > end - _FIT_TIME:
        return None
    return side * (heading_at(heading, farthest) - heading_at(heading, reversal))


def heading_at(heading: MeasuredSignal, time: float) -> float:
    """Return the heading at a time, from a parabola through the measurements around it, rad."""
    around = slice(*np.searchsorted(heading.time, [time - _FIT_TIME, time + _FIT_TIME]))
    offset, values = heading.time[around] - time, heading.values[around]
    if offset.size < _MIN_FIT:
        return float(np.interp(time, heading.time, heading.values))
    return float(np.linalg.lstsq(np.stack([np.ones(offset.size), offset, offset**2], axis=1), values)[0][0])


def _turning_circle(
    hold: Hold, measured: Mapping[str, MeasuredSignal], predicted: Mapping[str, MeasuredSignal]
) -> list[ManoeuvreNumber]:
    """Return the numbers of the steady turn: turn rate, and with measured velocity radius, speed and speed lost."""
    heading = measured["psi"]
    inside = slice(*np.searchsorted(heading.time, [hold.begin, hold.end]))
    turned = np.abs(heading.values[inside] - heading_at(heading, hold.begin))
    if not turned.size or turned[-1] < _TRANSIENT + _MIN_STEADY_TURN:
        return []
    begin = float(heading.time[inside][np.argmax(turned >= _TRANSIENT)])
    numbers, expected = (steady_turn(signals, hold.begin, begin, hold.end) for signals in (measured, predicted))
    name = f"turning circle {np.rad2deg(abs(hold.level)):.3g}"
    units = {"turn rate": "rad/s", "speed": "m/s", "radius": "m", "speed lost": "1"}
    return [
        ManoeuvreNumber(name, number, begin, units[number], value, _finite(expected.get(number)))
        for number, value in numbers.items()
    ]


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def steady_turn(signals: Mapping[str, MeasuredSignal], execute: float, begin: float, end: float) -> dict[str, float]:
    """Return the numbers of a turn that is steady from begin to end, s.

    Parameters
    ----------
    signals : mapping of MeasuredSignal
        Heading, and u, v, w for more than the turn rate. Without roll or pitch the path is level.
    execute : float
        Time of the rudder deflection, s; the approach is before it.
    begin, end : float

    Returns
    -------
    dict of float
        Turn rate, rad/s; horizontal speed, m/s; radius of the path, m; lost share of the approach speed.
    """
    heading = signals["psi"]
    inside = slice(*np.searchsorted(heading.time, [begin, end]))
    elapsed = heading.time[inside] - begin
    slope = np.linalg.lstsq(np.stack([np.ones(elapsed.size), elapsed], axis=1), heading.values[inside])[0][1]
    numbers = {"turn rate": float(slope)}
    if not {"u", "v", "w"} <= set(signals):
        return numbers
    speed = _horizontal_speed(signals)
    steady, before = (
        speed.values[slice(*np.searchsorted(speed.time, span))]
        for span in ([begin, end], [execute - _APPROACH, execute])
    )
    if steady.size:
        numbers |= {"speed": float(steady.mean()), "radius": float(steady.mean() / abs(slope))}
        if before.size and before.mean() > 0.0:
            numbers["speed lost"] = float(1.0 - steady.mean() / before.mean())
    return numbers


def _horizontal_speed(signals: Mapping[str, MeasuredSignal]) -> MeasuredSignal:
    """Return the horizontal speed at the times of u, m/s; the speed along the path without roll or pitch."""
    time = signals["u"].time

    def at_its_times(symbol: str) -> Array:
        return np.interp(time, signals[symbol].time, signals[symbol].values)

    u, v, w = (at_its_times(symbol) for symbol in "uvw")
    down = np.zeros(time.size)
    if set(TILT) <= set(signals):
        angles = np.column_stack((*(at_its_times(symbol) for symbol in TILT), np.zeros(time.size)))
        down = body_to_earth(angles, np.column_stack((u, v, w)))[:, 2]
    return MeasuredSignal(time, np.sqrt(u**2 + v**2 + w**2 - down**2), 0.0)
