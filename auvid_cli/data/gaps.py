"""When a sensor is silent for long, or repeats itself."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.noise import quantisation_step

Array = NDArray[np.float64]

# s, and times the usual interval.
_LONGEST, _INTERVALS = 1.0, 10.0
# s; a sensor with noise does not repeat itself to the last bit, and some quantised ones do for a while.
LONGEST_REPEAT = 2.0
# Steps by which a rounded measurement changes that hardly does.
_NEIGHBOURS, _BY_NOISE = 1.5, 2.5


def gap_limit(intervals: Array) -> float:
    """Return the longest interval between measurements that is not a gap, s.

    Parameters
    ----------
    intervals : ndarray, shape (n,)
        Those between all measurements, s; at least one.
    """
    return max(_LONGEST, _INTERVALS * float(np.median(intervals)))


def longer_intervals(time: Array, longest: float) -> Array:
    """Return begin and end, s, of the intervals between times that are longer than a limit, shape (n, 2)."""
    long = np.flatnonzero(np.diff(time) > longest)
    return np.stack([time[long], time[long + 1]], axis=1)


def gaps(time: Array) -> Array:
    """Return begin and end, s, of each gap between times of measurement, shape (n, 2); see `gap_limit`."""
    intervals = np.diff(time)
    return longer_intervals(time, gap_limit(intervals) if intervals.size else np.inf)


def repeats(record: SensorRecord) -> Array:
    """Find first and last time, s, of every run of the same measurement, shape (n, 2); one alone is a run, too."""
    time, _, edges = _runs(record)
    return np.stack([time[edges[:-1]], time[edges[1:] - 1]], axis=1)


def stuck_times(record: SensorRecord) -> Array:
    """Return those of the `repeats` that last too long, and not because measurements are rounded."""
    runs = repeats(record)
    long = runs[:, 1] - runs[:, 0] > LONGEST_REPEAT
    # Whether measurements are rounded takes sorting them all, and hardly ever matters.
    return runs[long & ~rounded_repeats(record)] if long.any() else runs[long]


def rounded_repeats(record: SensorRecord) -> NDArray[np.bool_]:
    """Say of each of the `repeats` whether it is one of a rounded measurement that changed by less than a step.

    It then comes from a neighbouring step and goes on to one. Noise may take it two steps to one side, and what it
    begins or ends the record with has but one: these are no longer than those with neighbours on both.
    """
    time, values, edges = _runs(record)
    steps = rounding_steps(record)
    runs = values[edges[:-1]]
    if not steps.any():
        return np.zeros(len(runs), np.bool_)
    # A component that is missing says nothing.
    jumps = np.abs(np.diff(runs, axis=0))
    near, by_noise = ((np.isnan(jumps) | (jumps <= most * steps)).all(axis=1) for most in (_NEIGHBOURS, _BY_NOISE))
    lasted = time[edges[1:] - 1] - time[edges[:-1]]
    before, after = np.append(False, near), np.append(near, False)
    surely = before & after
    longest = float(lasted.max(initial=0.0, where=surely))
    perhaps = (before | after) & np.append(True, by_noise) & np.append(by_noise, True)
    return surely | (perhaps & (lasted <= longest))


def rounding_steps(record: SensorRecord) -> Array:
    """Return the step in which each component is recorded, shape (c,); 0 where it is in none that shows."""
    levels = (np.unique(column[np.isfinite(column)]) for column in record.values.T)
    # Two levels alone are no grid.
    return np.array([quantisation_step(level) if level.size > 2 else 0.0 for level in levels])


def _runs(record: SensorRecord) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return times and values that are there, and where each run of the same measurement begins and the last ends."""
    present = np.isfinite(record.values).any(axis=1)
    time, values = record.time[present], record.values[present]
    moved = np.flatnonzero(np.any((values[1:] != values[:-1]) & np.isfinite(values[1:]), axis=1)) + 1
    return time, values, np.concatenate([[0], moved, [len(values)]])
