"""Whether sensors that kinematics tie to each other are stamped by the same clock: rates, angles, depth, velocity."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.check import Check
from auvid_cli.data.rate_of_change import rate_of_change, response_to_rates
from auvid_cli.inspection.grid import Signals
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_ties import attitude_rates, attitude_window, diving_speed, measured_forces
from auvid_cli.inspection.lags import likeliest_lag, shifted

Array = NDArray[np.float64]

# s: what filters of an attitude reference may make, what spoils coefficients of any vehicle, the longest looked for.
_USUAL, _LARGEST, _LONGEST = 0.075, 0.15, 1.5
# Share of the vehicle's time constant, its length over its speed: a depth sensor that far aft sees depth so much later.
_AFT = 0.25
# How well signals agree that tell a lag.
_LEAST_CORRELATION, _FEWEST = 0.8, 15.0
# What looks like a delay and is none.
_OTHERWISE = {
    "depth": " Or the depth sensor sits ahead or aft.",
    "dvl": " Or the DVL sits ahead or aft of the accelerometer.",
}


class _Pair(NamedTuple):
    """What a sensor says, and what others make of it, both smoothed over as long."""

    sensor: str
    other: str
    measured: Array
    expected: Array


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
    # A DVL ahead of the accelerometer swings like one that is late: of these two a lag is only noted.
    largest = {"depth": _LARGEST + _AFT * (time_constant or 0.0), "dvl": np.inf}
    checks = (
        _check(signals, sensor, other, pairs, window, largest.get(sensor, _LARGEST))
        for (sensor, other), pairs in by_sensors.items()
    )
    return [check for check in checks if check is not None]


def _pairs(signals: Signals, half: int) -> Iterator[_Pair]:
    step, value = signals.grid.step, signals.values
    for rate, tie in attitude_rates(signals).items():
        if signals.has(rate):
            yield _Pair("gyroscope", "attitude", response_to_rates(value[rate], step, half), tie.total())
    dive = diving_speed(signals)
    if dive is not None and signals.has("down", "w"):
        measured = rate_of_change(value["down"], step, half)
        yield _Pair("depth", "attitude", measured, response_to_rates(dive.total(), step, half))
    for velocity, force in measured_forces(signals).items():
        # What is left of the specific force beside gravity and the turning is the change of a velocity.
        left = value[f"f{'xyz'['uvw'.index(velocity)]}"] - sum(force.others)
        changing = rate_of_change(value[velocity], step, half)
        yield _Pair("dvl", "accelerometer", changing, response_to_rates(left, step, half))


def _check(signals: Signals, sensor: str, other: str, pairs: list[_Pair], window: int, largest: float) -> Check | None:
    lags = np.arange(-round(_LONGEST / signals.grid.step), round(_LONGEST / signals.grid.step) + 1)
    likelihood = np.zeros(lags.size)
    for pair in pairs:
        correlations, cells = _correlations(pair, lags)
        if cells / window >= _FEWEST and correlations.max() >= _LEAST_CORRELATION:
            likelihood -= 0.5 * cells / window * np.log1p(-(np.clip(correlations, 0.0, 1.0 - 1e-9) ** 2))
    if not likelihood.any():
        return None
    cells, error = likeliest_lag(likelihood)
    lag, unsure = cells * signals.grid.step, error * signals.grid.step
    beyond = abs(lag) - 2.0 * unsure
    late, early = (sensor, other) if lag > 0.0 else (other, sensor)
    return judged(
        sensor,
        f"delay against {other}",
        statistic=f"{late} is {abs(lag):.2f} +- {unsure:.1g} s later than {early}",
        threshold=f"<= {_USUAL:g} s" + (f"; fails beyond {largest:.2g} s" if np.isfinite(largest) else ""),
        passed=False if beyond > largest else None if beyond > _USUAL else True,
        advice=f"{late} is stamped late, or {early} early: shift the times, state it (`identification.delays`), or let "
        "it be found (`identification.estimate.biases: [delay]`)." + _OTHERWISE.get(sensor, ""),
    )


def _correlations(pair: _Pair, lags: NDArray[np.int64]) -> tuple[Array, int]:
    """Correlate what is measured so many cells later with what is expected, at cells that are known at every lag."""
    rows = np.stack([shifted(pair.measured, int(lag)) for lag in lags])
    complete = np.isfinite(rows).all(axis=0) & np.isfinite(pair.expected)
    known = int(complete.sum())
    if known < 2:
        return np.zeros(lags.size), 0
    rows, expected = rows[:, complete], pair.expected[complete]
    rows, expected = rows - rows.mean(axis=1, keepdims=True), expected - expected.mean()
    sizes = np.linalg.norm(rows, axis=1) * np.linalg.norm(expected)
    return np.divide(rows @ expected, sizes, out=np.zeros(lags.size), where=sizes > 0.0), known
