"""What a sensor says by itself: spikes, quantisation, noise floor."""

from math import comb, inf

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

from auvid_cli.data.check import Check
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.noise import quantisation_step
from auvid_cli.inspection.inspection import judged
from auvid_cli.vehicle.parameters import SENSORS, Quantity

Array = NDArray[np.float64]

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
