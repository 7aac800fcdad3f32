"""Angles that jump away from what the rates allow, and pitch near the gimbal."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from auvid_cli.angles import wrap
from auvid_cli.data.check import Check
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.gaps import gap_limit
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.single_sensor import continuous
from auvid_cli.vehicle.kinematics import euler_rates
from auvid_cli.vehicle.parameters import SENSORS

Array = NDArray[np.float64]

_LEAST_STEP = np.deg2rad(3.0)
_ROBUST_SIGMAS = 10.0
# s: what comes back within this time was an excursion.
_LONGEST_EXCURSION = 5.0
_LARGEST_PITCH, _GIMBAL = np.deg2rad(75.0), np.deg2rad(85.0)


def angle_steps(sensors: Mapping[str, SensorRecord], name: str, component: int) -> tuple[Array, Array, Array]:
    """Find jumps of an angle between two measurements that the turn rates do not explain.

    Parameters
    ----------
    sensors : mapping of SensorRecord
        The rates are those of the gyroscope if there is one, else 0.
    name : str
    component : int

    Returns
    -------
    before, after : ndarray, shape (n,)
        Times of the measurements, s.
    size : ndarray, shape (n,)
        rad.
    """
    record, quantity = sensors[name], SENSORS[name][component]
    column = record.values[:, component]
    time, turned = record.time[np.isfinite(column)], np.diff(continuous(column, quantity))
    unexplained = turned
    if "gyroscope" in sensors:
        unexplained = turned - _integrated(*_euler_rate(sensors, quantity.symbol), time)
    if quantity.symbol != "theta":
        unexplained = wrap(unexplained)
    # Where gyroscope or angle were silent there is no saying.
    intervals = np.diff(time)
    unexplained[~np.isfinite(unexplained) | (intervals > gap_limit(intervals))] = 0.0
    limit = max(_LEAST_STEP, _ROBUST_SIGMAS * 1.4826 * float(np.median(np.abs(unexplained))))
    at = np.flatnonzero(np.abs(unexplained) > limit)
    return time[at], time[at + 1], unexplained[at]


def _euler_rate(sensors: Mapping[str, SensorRecord], symbol: str) -> tuple[Array, Array]:
    """Return times, s, and rate of an angle, rad/s, by gyroscope and attitude, Fossen (2011), eq. (2.26)."""
    gyroscope = sensors["gyroscope"]
    finite = np.isfinite(gyroscope.values).all(axis=1)
    time = gyroscope.time[finite]
    tilt = [_tilt_at(time, sensors.get("attitude"), component) for component in (0, 1)]
    angles = np.column_stack((*tilt, np.zeros(time.size)))
    # A compass says the yaw under a name of its own.
    return time, euler_rates(gyroscope.values[finite], angles)[:, {"phi": 0, "theta": 1}.get(symbol, 2)]


def _tilt_at(time: Array, attitude: SensorRecord | None, component: int) -> Array:
    """Return roll or pitch at some times, level if it is not measured."""
    if attitude is None:
        return np.zeros(time.size)
    finite = np.isfinite(attitude.values[:, component])
    return np.interp(time, attitude.time[finite], attitude.values[finite, component]) if finite.any() else 0.0 * time


def _integrated(time: Array, rate: Array, until: Array) -> Array:
    """Integrate a rate between each two of some times; none beyond its own time."""
    total = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time)))
    if not time.size:
        return np.full(until.size - 1, np.nan)
    return np.diff(np.interp(until, time, total, left=np.nan, right=np.nan))


def step_check(name: str, symbol: str, before: Array, size: Array) -> Check:
    """Judge the steps of an angle; excursions are named: away and back within seconds."""
    starts = _excursions(before, size)
    statistic = "none"
    if starts.size:
        lasted = before[starts + 1] - before[starts]
        times = ", ".join(f"{before[i]:.6g}" for i in starts[:3])
        statistic = (
            f"{starts.size} times away by {np.rad2deg(np.median(np.abs(size[starts]))):.3g} deg and back after "
            f"{np.median(lasted):.3g} s: t = {times}{' ...' if starts.size > 3 else ''} s"
        )
    elif size.size:
        i = int(np.abs(size).argmax())
        statistic = f"{size.size}; largest {np.rad2deg(size[i]):.3g} deg at t = {before[i]:.6g} s"
    return judged(
        name,
        f"steps of {symbol}",
        statistic=statistic,
        threshold=f"<= {np.rad2deg(_LEAST_STEP):.2g} deg or {_ROBUST_SIGMAS:g} robust standard deviations between "
        "measurements, beyond what the rates say",
        passed=not size.size,
        advice=f"{symbol} of {name} jumps although the vehicle cannot have: the device switches between solutions, or "
        "two sources are mixed in one column. Mark those times as not valid, or use another source.",
    )


def _excursions(time: Array, size: Array) -> NDArray[np.int64]:
    """Find steps that the next one takes back; of a step away and back in turn, those that last less."""
    back = np.abs(size[1:] + size[:-1]) < 0.5 * np.abs(size[1:])
    lasted = np.where(back & (np.diff(time) <= _LONGEST_EXCURSION), np.diff(time), np.inf)
    least = np.minimum(np.append(np.inf, lasted[:-1]), np.append(lasted[1:], np.inf))
    return np.flatnonzero(np.isfinite(lasted) & (lasted < least))


def gimbal_check(record: SensorRecord) -> Check:
    """Judge the pitch of an attitude record by where Euler angles are of use."""
    theta = np.abs(record.values[:, 1])
    theta = theta[np.isfinite(theta)]
    largest = float(theta.max())
    return judged(
        "attitude",
        "gimbal",
        statistic=f"|theta| up to {np.rad2deg(largest):.3g} deg",
        threshold=f"<= {np.rad2deg(_LARGEST_PITCH):.3g} deg",
        passed=True if largest <= _LARGEST_PITCH else None if largest <= _GIMBAL else False,
        advice="Roll and yaw are not defined with the nose straight up or down, and the model's kinematics break down "
        "there: leave such times out.",
    )
