"""Checks of one sensor by itself: noise, outliers, steps, constants and Allan deviation."""

from collections.abc import Mapping
from math import comb, inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

from auvid_cli.angles import wrap
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.signals import gap_limit, quantisation_step
from auvid_cli.inspection.inspection import judged
from auvid_cli.vehicle.kinematics import euler_rates
from auvid_cli.vehicle.parameters import SENSORS, Quantity

Array = NDArray[np.float64]
# Averages over more than this share of the record are of too few pieces.
_LONGEST_SHARE = 0.1
# What a flicker's Allan deviation is of its bias instability, IEEE Std 952-1997, annex C.
_FLICKER = (2.0 * np.log(2.0) / np.pi) ** 0.5
_LARGEST_SPIKE = 15.0
_LEAST_OF_STATED = 0.2
# Usual spans of five measurements.
_LONGEST_FIVE = 1.75
_ORDERS = (2, 4, 6, 8)
# Samples that are more than this tell a noise floor.
ENOUGH_FOR_NOISE = _ORDERS[-1]
_TIMES_STATED = 2.0
# So many samples show a quantisation step.
_ENOUGH = 100_000
# A step whose rounding error is as large as the noise that is stated.
_LARGEST_STEP = 12.0**0.5
_LEAST_STEP = np.deg2rad(3.0)
_ROBUST_SIGMAS = 10.0
# s: what comes back within this time was an excursion.
_LONGEST_EXCURSION = 5.0
_LARGEST_PITCH, _GIMBAL = np.deg2rad(75.0), np.deg2rad(85.0)


class BiasInstability(NamedTuple):
    """Least Allan deviation of a rate, over the share of it that flicker noise has, and its averaging time, s."""

    value: float
    time: float


def allan_deviation(rate: Array, step: float, points: int = 30) -> tuple[Array, Array]:
    """Return the overlapping Allan deviation, IEEE Std 952-1997, annex C.

    Parameters
    ----------
    rate : ndarray, shape (n,)
        Evenly spaced, without gaps.
    step : float
        s.
    points : int
        About how many averaging times, evenly spaced in their logarithm.

    Returns
    -------
    time, deviation : ndarray
        Averaging times, s, and deviations in the unit of the rate.
    """
    angle = np.append(0.0, np.cumsum(rate)) * step
    longest = max(int(_LONGEST_SHARE * rate.size), 1)
    counts = np.unique(np.geomspace(1, longest, points).astype(np.int64))
    times = step * counts.astype(np.float64)
    squares = [np.mean((angle[2 * m :] - 2.0 * angle[m:-m] + angle[: -2 * m]) ** 2) for m in counts]
    return times, np.sqrt(np.array(squares) / 2.0) / times


def bias_instability(rate: Array, step: float) -> BiasInstability | None:
    """Find where the Allan deviation is least, None if it still falls at the longest averaging time."""
    if rate.size < 100:
        return None
    times, deviation = allan_deviation(rate, step)
    least = int(deviation.argmin())
    if least == times.size - 1:
        return None
    return BiasInstability(float(deviation[least]) / _FLICKER, float(times[least]))


def continuous(values: Array, quantity: Quantity) -> Array:
    """Return values without what is missing; angles without jumps of a turn."""
    finite = values[np.isfinite(values)]
    return np.unwrap(finite) if quantity.unit == "rad" and quantity.symbol != "theta" else finite


def noise_floor(values: Array) -> float:
    """Return the standard deviation of what changes from sample to sample without any smooth course.

    The least over some orders of differences of their median absolute value, so that neither spikes nor motion count;
    an upper bound of white noise.
    """
    # `logs.noise` states a noise for a filter and takes second differences alone, which leave some motion in it: too
    # much is safe there. Here a noise that was stated is doubted, so no motion may count.
    least = inf
    difference = values
    for order in range(1, _ORDERS[-1] + 1):
        difference = np.diff(difference)
        if difference.size and order in _ORDERS:
            least = min(least, 1.4826 * float(np.median(np.abs(difference))) / comb(2 * order, order) ** 0.5)
    return least


def level_distance(values: Array) -> float:
    """Return the quantisation step of a signal, 0 where none shows: two levels alone are no grid."""
    levels = np.unique(values[:_ENOUGH])
    return quantisation_step(levels) if levels.size > 2 else 0.0


def spike_sizes(time: Array, values: Array, noise: float) -> Array:
    """Measure how far each measurement is from its neighbours, in robust standard deviations of that distance.

    The lesser of the distances to the median of five and to the cubic through the two on either side: the former does
    not see the ends of a step, the latter no smooth extreme. It counts where it is more than these neighbours change
    from one to the next, as they do about the sharp extreme of a slow record. Of five in a row only the farthest
    counts, for it draws the cubics beside it away, and none beside a gap.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
        s; measurements without NaN, angles without jumps of a turn.
    noise : float
        As stated; a fifth of it is the least standard deviation: what is smoother than that may be less so at times.
    """
    distance = np.zeros(values.size)
    if values.size < 5:
        return distance
    a, b, x, d, e = (values[i : values.size - 4 + i] for i in range(5))
    from_cubic = np.abs(x - (4.0 * (b + d) - a - e) / 6.0)
    lasted = time[4:] - time[:-4]
    whole = lasted < _LONGEST_FIVE * float(np.median(lasted))
    scale = 1.4826 * float(np.median(from_cubic[whole]))
    # A constant without noise has no scale of its own.
    floor = max(scale, level_distance(values), _LEAST_OF_STATED * noise) or 1.0
    from_median = np.abs(x - median_filter(values, 5, mode="nearest")[2:-2])
    nearest = np.minimum(from_cubic, from_median)
    stands_out = nearest > np.maximum(np.abs(b - a), np.abs(e - d))
    distance[2:-2] = np.where(whole & stands_out, nearest, 0.0) / floor
    # The cubic of its neighbours is two thirds as far off as a spike, and may be all there is to tell them apart.
    farthest = np.zeros(values.size)
    farthest[2:-2] = from_cubic
    return np.where(maximum_filter1d(farthest, 5) == farthest, distance, 0.0)


def spikes(record: SensorRecord, name: str) -> tuple[NDArray[np.bool_], dict[str, tuple[float, float]]]:
    """Find the spikes among the measurements of a sensor, and the largest of each component.

    Returns
    -------
    mask : ndarray of bool, shape (n, c)
    largest : dict
        By component, its size in robust standard deviations and its time, s.
    """
    mask = np.zeros(record.values.shape, np.bool_)
    largest = {}
    for component, quantity in enumerate(SENSORS[name]):
        column = record.values[:, component]
        finite = np.flatnonzero(np.isfinite(column))
        if finite.size:
            time, noise = record.time[finite], record.standard_deviation[component]
            sizes = spike_sizes(time, continuous(column, quantity), noise)
            mask[finite, component] = sizes > _LARGEST_SPIKE
            at = int(sizes.argmax())
            largest[quantity.symbol] = float(sizes[at]), float(time[at])
    return mask, largest


def measurement_checks(
    name: str, record: SensorRecord, mask: NDArray[np.bool_], largest: dict[str, tuple[float, float]]
) -> list[Check]:
    """Judge spikes, as of `spikes`, quantisation and noise floor of a sensor."""
    symbol = max(largest, key=lambda component: largest[component][0])
    size, at = largest[symbol]
    count = int(mask.any(axis=1).sum())
    checks = [
        judged(
            name,
            "spikes",
            statistic=f"{count}; largest {symbol} {size:.3g} at t = {at:.6g} s",
            threshold=f"none beyond {_LARGEST_SPIKE:g} robust standard deviations from its neighbours",
            passed=not count,
            advice="Single measurements far from their neighbours: mark them as not valid, or let the filter reject "
            "them (`identification.gate`), or smoother and output_error weigh them down "
            "(`identification.robust=huber`).",
        )
    ]
    steps, floors = {}, {}
    for component, quantity in enumerate(SENSORS[name]):
        values, noise = continuous(record.values[:, component], quantity), record.standard_deviation[component]
        if values.size > ENOUGH_FOR_NOISE and noise > 0.0:
            steps[quantity.symbol] = level_distance(values) / noise
            floors[quantity.symbol] = noise_floor(values) / noise
    if not floors:
        return checks
    return [
        *checks,
        Check.of_values(
            "",
            name,
            "quantisation",
            steps,
            limit=_LARGEST_STEP,
            unit="times",
            meaning="the stated noise",
            advice=f"The steps of {name} are coarser than its stated noise: state step / sqrt(12), or log more digits.",
            fails=False,
        ),
        Check.of_values(
            "",
            name,
            "noise floor",
            floors,
            limit=_TIMES_STATED,
            unit="times",
            meaning="the stated noise",
            advice=f"{name} scatters more than is stated: state what it does, or find the scale or unit that is wrong.",
            fails=False,
        ),
    ]


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
