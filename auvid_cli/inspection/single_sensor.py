"""Checks of one sensor by itself: noise, spikes, steps, constants and Allan deviation; its record without faults."""

from collections.abc import Mapping
from math import comb, inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

from auvid_cli.arrays import Array, wrap
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.signals import gap_limit, gaps, step_between, stuck_times
from auvid_cli.inspection.inspection import Mark, judged
from auvid_cli.inspection.timing import clock_jumps
from auvid_cli.vehicle.parameters import SENSORS, Quantity
from auvid_cli.vehicle.rigid_body import MAX_SPEED, MAX_TURN_RATE, euler_rates

_MAX_AVERAGING_SHARE = 0.1  # longest averaging time as a share of the record; longer averages are too few
_MIN_INSTABILITY_SAMPLES = 100
# Ratio of the Allan deviation of flicker noise to its bias instability, IEEE Std 952-1997, annex C.
_FLICKER = (2.0 * np.log(2.0) / np.pi) ** 0.5
_MAX_SPIKE = 15.0  # robust standard deviations
_MIN_NOISE_SHARE = 0.2  # smallest scale of a spike as a share of the stated noise
_MAX_SPAN_OF_FIVE = 1.75  # median spans of five measurements
_DIFFERENCE_ORDERS = (2, 4, 6, 8)
MIN_NOISE_SAMPLES = _DIFFERENCE_ORDERS[-1]  # more samples than this determine a noise floor
_MAX_NOISE_RATIO = 2.0  # ratio of the noise floor to the stated noise
_MAX_LEVEL_SAMPLES = 100_000
_MAX_QUANTISATION_RATIO = 12.0**0.5  # ratio of the step to the stated noise; the rounding error is then as large
_MIN_ANGLE_STEP = np.deg2rad(3.0)
_MIN_ANGLE_STEP_SIGMAS = 10.0  # robust standard deviations
_MAX_EXCURSION = 5.0  # s
_LARGEST = {"gyroscope": MAX_TURN_RATE, "dvl": MAX_SPEED}
_USUAL_SHARE = 0.99  # quantile that is compared with the largest plausible value, because spikes are another check
_PITCH_NOTE = np.deg2rad(75.0)
_PITCH_FAILURE = np.deg2rad(85.0)


class Screening(NamedTuple):
    """A record without its faults, and the faults."""

    record: SensorRecord  # NaN for stuck values and spikes; ends at the first jump of the clock
    jumps: NDArray[np.int64]  # index of the sample before each jump of the clock
    spikes: NDArray[np.bool_]  # shape (n, c); in the original record
    # By component: size of the largest spike, in robust standard deviations, and its time, s
    largest: dict[str, tuple[float, float]]
    marks: list[Mark]


def screen(name: str, record: SensorRecord) -> Screening:
    """Find and remove the faults of a sensor that show without other sensors."""
    time, values = record.time, record.values.copy()
    stuck = stuck_times(record)
    for start, end in stuck:
        # The first of the repeated values was measured.
        values[slice(*np.searchsorted(time, [start, end], side="right"))] = np.nan
    moving = SensorRecord(time, values, record.standard_deviation)
    mask, largest = spikes(moving, name)
    values[mask] = np.nan
    jumps = clock_jumps(record)
    leaps = np.stack([time[jumps], time[jumps + 1]], axis=1).tolist()
    marks = [Mark(name, "clock", *times) for times in leaps]
    marks += [Mark(name, "gap", *times) for times in gaps(record.measured_times).tolist() if times not in leaps]
    marks += [Mark(name, "stuck", *times) for times in stuck.tolist()]
    marks += [Mark(name, "spike", at, at) for at in time[mask.any(axis=1)].tolist()]
    end = int(jumps[0]) + 1 if jumps.size else time.size
    return Screening(SensorRecord(time[:end], values[:end], record.standard_deviation), jumps, mask, largest, marks)


def allan_deviation(rate: Array, step: float, points: int = 30) -> tuple[Array, Array]:
    """Return averaging times, s, and the overlapping Allan deviation, IEEE Std 952-1997, annex C.

    Parameters
    ----------
    rate : ndarray, shape (n,)
        Evenly spaced by `step`, s, without gaps.
    points : int
        Approximate number of averaging times, evenly spaced in their logarithm.
    """
    angle = np.append(0.0, np.cumsum(rate)) * step
    longest = max(int(_MAX_AVERAGING_SHARE * rate.size), 1)
    counts = np.unique(np.geomspace(1, longest, points).astype(np.int64))
    times = step * counts.astype(np.float64)
    squares = [np.mean((angle[2 * m :] - 2.0 * angle[m:-m] + angle[: -2 * m]) ** 2) for m in counts]
    return times, np.sqrt(np.array(squares) / 2.0) / times


def bias_instability(rate: Array, step: float) -> tuple[float, float] | None:
    """Return the bias instability of a rate and its averaging time, s.

    None if the Allan deviation still falls at the longest averaging time.
    """
    if rate.size < _MIN_INSTABILITY_SAMPLES:
        return None
    times, deviation = allan_deviation(rate, step)
    least = int(deviation.argmin())
    if least == times.size - 1:
        return None
    return float(deviation[least]) / _FLICKER, float(times[least])


def continuous(values: Array, quantity: Quantity) -> Array:
    """Return the finite values; angles without jumps of a turn."""
    finite = values[np.isfinite(values)]
    return np.unwrap(finite) if quantity.unit == "rad" and quantity.symbol != "theta" else finite


def noise_floor(values: Array) -> float:
    """Return an upper bound of the standard deviation of white noise.

    It is the smallest median absolute difference over several orders of differences: neither spikes nor motion count.
    """
    # `logs.noise` states noise for a filter from second differences alone. They contain some motion; there too much
    # noise is safe. This function checks a stated noise, so motion must not count.
    least = inf
    difference = values
    for order in range(1, _DIFFERENCE_ORDERS[-1] + 1):
        difference = np.diff(difference)
        if difference.size and order in _DIFFERENCE_ORDERS:
            least = min(least, 1.4826 * float(np.median(np.abs(difference))) / comb(2 * order, order) ** 0.5)
    return least


def level_distance(values: Array) -> float:
    """Return the quantisation step of a signal; 0 if there is none, or only two levels."""
    levels = np.unique(values[:_MAX_LEVEL_SAMPLES])
    return step_between(levels) if levels.size > 2 else 0.0


def spike_sizes(time: Array, values: Array, noise: float) -> Array:
    """Return the distance of each measurement from its neighbours, in robust standard deviations of that distance.

    It is the smaller of the distances to the median of five and to the cubic through two neighbours on either side. The
    median ignores the ends of a step, the cubic a smooth extreme. A distance counts if it is larger than the change
    between these neighbours, as at the sharp extreme of a slow record. Of five in a row only the largest counts,
    because a spike distorts the cubics next to it; none counts next to a gap.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
        s; measurements without NaN, angles without jumps of a turn.
    noise : float
        Stated noise. The scale is at least a fifth of it, because a smoother signal may be rougher at times.
    """
    distance = np.zeros(values.size)
    if values.size < 5:
        return distance
    a, b, x, d, e = (values[i : values.size - 4 + i] for i in range(5))
    from_cubic = np.abs(x - (4.0 * (b + d) - a - e) / 6.0)
    duration = time[4:] - time[:-4]
    whole = duration < _MAX_SPAN_OF_FIVE * float(np.median(duration))
    scale = 1.4826 * float(np.median(from_cubic[whole]))
    # A constant without noise has no scale of its own.
    floor = max(scale, level_distance(values), _MIN_NOISE_SHARE * noise) or 1.0
    from_median = np.abs(x - median_filter(values, 5, mode="nearest")[2:-2])
    nearest = np.minimum(from_cubic, from_median)
    stands_out = nearest > np.maximum(np.abs(b - a), np.abs(e - d))
    distance[2:-2] = np.where(whole & stands_out, nearest, 0.0) / floor
    # The cubic of its neighbours moves by two thirds of a spike, and may be the only difference between them.
    farthest = np.zeros(values.size)
    farthest[2:-2] = from_cubic
    return np.where(maximum_filter1d(farthest, 5) == farthest, distance, 0.0)


def spikes(record: SensorRecord, name: str) -> tuple[NDArray[np.bool_], dict[str, tuple[float, float]]]:
    """Return the spikes of a sensor, shape (n, c), and by component the largest: size in robust sigmas, time in s."""
    mask = np.zeros(record.values.shape, np.bool_)
    largest = {}
    for component, quantity in enumerate(SENSORS[name]):
        column = record.values[:, component]
        finite = np.flatnonzero(np.isfinite(column))
        if finite.size:
            time, noise = record.time[finite], record.standard_deviation[component]
            sizes = spike_sizes(time, continuous(column, quantity), noise)
            mask[finite, component] = sizes > _MAX_SPIKE
            at = int(sizes.argmax())
            largest[quantity.symbol] = float(sizes[at]), float(time[at])
    return mask, largest


def measurement_checks(name: str, record: SensorRecord, screening: Screening) -> list[Check]:
    """Check spikes, quantisation and noise floor of a sensor."""
    symbol = max(screening.largest, key=lambda component: screening.largest[component][0])
    size, at = screening.largest[symbol]
    count = int(screening.spikes.any(axis=1).sum())
    checks = [
        judged(
            name,
            "spikes",
            statistic=f"{count}; largest {symbol} {size:.3g} at t = {at:.6g} s",
            threshold=f"none beyond {_MAX_SPIKE:g} robust standard deviations from its neighbours",
            passed=not count,
            advice="Some measurements are far from their neighbours. Set `limits` in the map, or let the filter reject "
            "them (`identification.gate`); smoother and output_error can give them less weight "
            "(`identification.robust=huber`).",
        )
    ]
    steps, floors = {}, {}
    for component, quantity in enumerate(SENSORS[name]):
        values, noise = continuous(record.values[:, component], quantity), record.standard_deviation[component]
        if values.size > MIN_NOISE_SAMPLES and noise > 0.0:
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
            limit=_MAX_QUANTISATION_RATIO,
            unit="times",
            meaning="the stated noise",
            advice=f"{name} is rounded more coarsely than its stated noise: set `standard_deviation` to at least step "
            "/ sqrt(12). In the next log, record more digits.",
            fails=False,
        ),
        Check.of_values(
            "",
            name,
            "noise floor",
            floors,
            limit=_MAX_NOISE_RATIO,
            unit="times",
            meaning="the stated noise",
            advice=f"{name} is noisier than stated: set a larger `standard_deviation` in the map, or correct its unit "
            "or `scale`.",
            fails=False,
        ),
    ]


def angle_steps(sensors: Mapping[str, SensorRecord], name: str, component: int) -> tuple[Array, Array, Array]:
    """Return the jumps of an angle between two measurements that the turn rates do not explain.

    Turn rates are those of the gyroscope, or 0 without one.

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
    # Without a gyroscope or an angle a jump is unknown.
    intervals = np.diff(time)
    unexplained[~np.isfinite(unexplained) | (intervals > gap_limit(intervals))] = 0.0
    limit = max(_MIN_ANGLE_STEP, _MIN_ANGLE_STEP_SIGMAS * 1.4826 * float(np.median(np.abs(unexplained))))
    at = np.flatnonzero(np.abs(unexplained) > limit)
    return time[at], time[at + 1], unexplained[at]


def _euler_rate(sensors: Mapping[str, SensorRecord], symbol: str) -> tuple[Array, Array]:
    """Return times, s, and the rate of an angle, rad/s, from gyroscope and attitude, Fossen (2011), eq. (2.26)."""
    gyroscope = sensors["gyroscope"]
    finite = np.isfinite(gyroscope.values).all(axis=1)
    time = gyroscope.time[finite]
    tilt = [_tilt_at(time, sensors.get("attitude"), component) for component in (0, 1)]
    angles = np.column_stack((*tilt, np.zeros(time.size)))
    # Symbols other than phi and theta are headings.
    return time, euler_rates(gyroscope.values[finite], angles)[:, {"phi": 0, "theta": 1}.get(symbol, 2)]


def _tilt_at(time: Array, attitude: SensorRecord | None, component: int) -> Array:
    """Return roll or pitch at some times, rad; 0 if not measured."""
    if attitude is None:
        return np.zeros(time.size)
    finite = np.isfinite(attitude.values[:, component])
    return np.interp(time, attitude.time[finite], attitude.values[finite, component]) if finite.any() else 0.0 * time


def _integrated(time: Array, rate: Array, until: Array) -> Array:
    """Return the integral of a rate between successive times `until`; NaN outside its record."""
    total = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time)))
    if not time.size:
        return np.full(until.size - 1, np.nan)
    return np.diff(np.interp(until, time, total, left=np.nan, right=np.nan))


def step_check(name: str, symbol: str, before: Array, size: Array) -> Check:
    """Check an angle for steps; count those that are reversed within seconds."""
    starts = _excursions(before, size)
    statistic = "none"
    if starts.size:
        duration = before[starts + 1] - before[starts]
        times = ", ".join(f"{before[i]:.6g}" for i in starts[:3])
        statistic = (
            f"{starts.size} times away by {np.rad2deg(np.median(np.abs(size[starts]))):.3g} deg and back after "
            f"{np.median(duration):.3g} s: t = {times}{' ...' if starts.size > 3 else ''} s"
        )
    elif size.size:
        i = int(np.abs(size).argmax())
        statistic = f"{size.size}; largest {np.rad2deg(size[i]):.3g} deg at t = {before[i]:.6g} s"
    return judged(
        name,
        f"steps of {symbol}",
        statistic=statistic,
        threshold=f"<= {np.rad2deg(_MIN_ANGLE_STEP):.2g} deg or {_MIN_ANGLE_STEP_SIGMAS:g} robust standard deviations "
        "between measurements, beyond the integrated turn rates",
        passed=not size.size,
        advice=f"{symbol} of {name} jumps, but the vehicle cannot: the device switches its solution, or one column "
        "mixes two sources. Exclude those times (`exclude` in the map), or use another source.",
    )


def _excursions(time: Array, size: Array) -> NDArray[np.int64]:
    """Return the steps that the next step reverses; of several in a row, the one with the shortest duration."""
    back = np.abs(size[1:] + size[:-1]) < 0.5 * np.abs(size[1:])
    duration = np.where(back & (np.diff(time) <= _MAX_EXCURSION), np.diff(time), np.inf)
    least = np.minimum(np.append(np.inf, duration[:-1]), np.append(duration[1:], np.inf))
    return np.flatnonzero(np.isfinite(duration) & (duration < least))


def range_check(name: str, record: SensorRecord) -> Check | None:
    """Check that rates and speeds are possible for an underwater vehicle; None for other sensors."""
    if name not in _LARGEST:
        return None
    sizes, unit = np.abs(record.values[np.isfinite(record.values)]), SENSORS[name][0].unit
    reached = float(np.quantile(sizes, _USUAL_SHARE))
    return judged(
        name,
        "range",
        statistic=f"reaches {reached:.3g} {unit}",
        threshold=f"<= {_LARGEST[name]:g} {unit}",
        passed=reached <= _LARGEST[name],
        advice="No underwater vehicle moves like this: correct the `unit` in the map.",
    )


def gimbal_check(record: SensorRecord) -> Check:
    """Check that the pitch stays where Euler angles are defined."""
    theta = np.abs(record.values[:, 1])
    theta = theta[np.isfinite(theta)]
    largest = float(theta.max())
    return judged(
        "attitude",
        "gimbal",
        statistic=f"|theta| up to {np.rad2deg(largest):.3g} deg",
        threshold=f"<= {np.rad2deg(_PITCH_NOTE):.3g} deg",
        passed=True if largest <= _PITCH_NOTE else None if largest <= _PITCH_FAILURE else False,
        advice="Roll and yaw are undefined with the nose straight up or down, and the equations of the model fail "
        "there: leave such times out (`--use`).",
    )
