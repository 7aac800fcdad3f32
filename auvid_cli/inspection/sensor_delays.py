"""Whether sensors that kinematics tie to each other are stamped by the same clock: rates, angles, depth, velocity."""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.check import Check
from auvid_cli.data.rate_of_change import rate_of_change, response_to_rates
from auvid_cli.inspection.grid import Signals
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_relations import attitude_rates, attitude_window, diving_speed, measured_forces
from auvid_cli.inspection.lags import likeliest_lag, shifted

Array = NDArray[np.float64]

# s: what filters of an attitude reference may make, what spoils coefficients of any vehicle, the longest looked for.
_USUAL, _LARGEST, _LONGEST = 0.075, 0.15, 1.5
# Share of the vehicle's time constant, its length over its speed: a depth sensor that far aft sees depth so much later.
_AFT = 0.25
# How well signals agree that tell a lag, and how much likelier, as a logarithm, than any delay a
# turned sign must be.
_LEAST_CORRELATION, _FEWEST, _LIKELIER = 0.8, 15.0, 10.0
# What looks like a delay and is none.
_OTHERWISE = {
    "depth": " Or the depth sensor sits ahead or aft.",
    "dvl": " Or the DVL sits ahead or aft of the accelerometer.",
}


class _Pair(NamedTuple):
    """What a sensor says, and what others make of it, both smoothed over as long.

    Attributes
    ----------
    sensor, other : str
    measured, expected : ndarray
    turned : mapping of ndarray
        What others make of it if the sign of one of them, whose symbol it is, is turned: that looks like a delay.
    swings : bool
        Whether a sensor that sits ahead or aft of the other looks late.
    """

    sensor: str
    other: str
    measured: Array
    expected: Array
    turned: Mapping[str, Array] = MappingProxyType({})
    swings: bool = False


def sensor_delay_checks(signals: Signals, time_constant: float | None, contradicted: bool) -> list[Check]:
    """Judge how much later than others each sensor is stamped, where signals agree well enough to tell it.

    Parameters
    ----------
    signals : Signals
    time_constant : float or None
        s, of the vehicle, if it is known.
    contradicted : bool
        Whether rates and angles contradict each other: then only their own delay is judged.
    """
    window = attitude_window(signals)
    by_sensors: dict[tuple[str, str], list[_Pair]] = {}
    for pair in _pairs(signals, window // 2):
        if contradicted and pair.sensor != "gyroscope":
            continue
        by_sensors.setdefault((pair.sensor, pair.other), []).append(pair)
    # A DVL ahead of the accelerometer swings like one that is late: of these two a lag is only noted, unless surge,
    # which does not swing, tells one by itself.
    surge = [pair for pair in by_sensors.get(("dvl", "accelerometer"), ()) if not pair.swings]
    lag = _lag(signals, surge, window)
    late = lag is not None and lag.beyond > _LARGEST
    largest = {"depth": _LARGEST + _AFT * (time_constant or 0.0), "dvl": _LARGEST if late else np.inf}
    checks = (
        _check(signals, sensor, other, pairs, window, largest.get(sensor, _LARGEST))
        for (sensor, other), pairs in by_sensors.items()
    )
    return [check for check in checks if check is not None]


def _pairs(signals: Signals, half: int) -> Iterator[_Pair]:
    step, value = signals.grid.step, signals.values
    for rate, relation in attitude_rates(signals).items():
        if signals.has(rate):
            yield _Pair("gyroscope", "attitude", response_to_rates(value[rate], step, half), relation.total())
    dive = diving_speed(signals)
    if dive is not None and signals.has("down", "w"):
        measured = rate_of_change(value["down"], step, half)
        stated, turned = (response_to_rates(dive.total() - 2.0 * by * dive.others[0], step, half) for by in (0.0, 1.0))
        yield _Pair("depth", "attitude", measured, stated, {"w": turned})
    for velocity, force in measured_forces(signals).items():
        # What is left of the specific force beside gravity and the turning is the change of a velocity.
        left = value[f"f{'xyz'['uvw'.index(velocity)]}"] - sum(force.others)
        changing = rate_of_change(value[velocity], step, half)
        yield _Pair("dvl", "accelerometer", changing, response_to_rates(left, step, half), swings=velocity != "u")


class _Lag(NamedTuple):
    """How much later what a sensor measures is than what is expected, and its standard deviation, s.

    Attributes
    ----------
    size, error : float
    turned : list of str
        Symbols of the signs that seem turned.
    """

    size: float
    error: float
    turned: list[str]

    @property
    def beyond(self) -> float:
        """Return how long it is at least, s."""
        return abs(self.size) - 2.0 * self.error


def _lag(signals: Signals, pairs: Sequence[_Pair], window: int) -> _Lag | None:
    """Find the one lag that pairs of signals have together; None where they hardly agree."""
    lags = np.arange(-round(_LONGEST / signals.grid.step), round(_LONGEST / signals.grid.step) + 1)
    usual = np.abs(lags) * signals.grid.step <= _USUAL
    likelihood, turned = np.zeros(lags.size), list[str]()
    for pair in pairs:
        best = _likelihood(pair.measured, pair.expected, lags, window)
        for symbol, expected in pair.turned.items():
            other_way = _likelihood(pair.measured, expected, lags, window)
            if other_way[usual].max() > best.max() + _LIKELIER:
                best = other_way
                turned.append(symbol)
        likelihood += best
    if not likelihood.any():
        return None
    cells, error = likeliest_lag(likelihood)
    return _Lag(cells * signals.grid.step, error * signals.grid.step, turned)


def _check(signals: Signals, sensor: str, other: str, pairs: list[_Pair], window: int, largest: float) -> Check | None:
    lag = _lag(signals, pairs, window)
    if lag is None:
        return None
    late, early = (sensor, other) if lag.size > 0.0 else (other, sensor)
    return judged(
        sensor,
        f"delay against {other}",
        statistic=f"{late} is {abs(lag.size):.2f} +- {lag.error:.1g} s later than {early}"
        + (f", if the sign of {', '.join(lag.turned)} is turned, as it seems" if lag.turned else ""),
        threshold=f"<= {_USUAL:g} s" + (f"; fails beyond {largest:.2g} s" if np.isfinite(largest) else ""),
        passed=False if lag.beyond > largest else None if lag.beyond > _USUAL else True,
        advice=f"{late} is stamped late, or {early} early: shift the times, state it (`identification.delays`), or let "
        "it be found (`identification.estimate.biases: [delay]`)." + _OTHERWISE.get(sensor, ""),
    )


def _likelihood(measured: Array, expected: Array, lags: NDArray[np.int64], window: int) -> Array:
    """Say for each lag how much likelier the signals are together than apart, as a logarithm; 0 if they hardly agree.

    What is measured so many cells later is correlated with what is expected, at cells that are known at every lag.
    """
    rows = np.stack([shifted(measured, int(lag)) for lag in lags])
    complete = np.isfinite(rows).all(axis=0) & np.isfinite(expected)
    windows = int(complete.sum()) / window
    if windows < _FEWEST:
        return np.zeros(lags.size)
    rows, expected = rows[:, complete], expected[complete]
    rows, expected = rows - rows.mean(axis=1, keepdims=True), expected - expected.mean()
    sizes = np.linalg.norm(rows, axis=1) * np.linalg.norm(expected)
    correlations = np.divide(rows @ expected, sizes, out=np.zeros(lags.size), where=sizes > 0.0)
    if correlations.max() < _LEAST_CORRELATION:
        return np.zeros(lags.size)
    return -0.5 * windows * np.log1p(-(np.clip(correlations, 0.0, 1.0 - 1e-9) ** 2))
