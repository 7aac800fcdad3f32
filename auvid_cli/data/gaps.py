"""When a sensor is silent for long, or repeats itself."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord

Array = NDArray[np.float64]

# s, and times the usual interval.
_LONGEST, _INTERVALS = 1.0, 10.0
# s; a sensor with noise does not repeat itself to the last bit, and some quantised ones do for a while.
LONGEST_REPEAT = 2.0


def gap_limit(intervals: Array) -> float:
    """Return the longest interval between measurements that is not a gap, s.

    Parameters
    ----------
    intervals : ndarray, shape (n,)
        Those between all measurements, s; at least one.
    """
    return max(_LONGEST, _INTERVALS * float(np.median(intervals)))


def repeats(record: SensorRecord) -> Array:
    """Find first and last time, s, of every run of the same measurement, shape (n, 2); one alone is a run, too."""
    present = np.isfinite(record.values).any(axis=1)
    time, values = record.time[present], record.values[present]
    moved = np.flatnonzero(np.any((values[1:] != values[:-1]) & np.isfinite(values[1:]), axis=1)) + 1
    edges = np.concatenate([[0], moved, [len(values)]])
    return np.stack([time[edges[:-1]], time[edges[1:] - 1]], axis=1)


def stuck_times(record: SensorRecord) -> Array:
    """Return those of the `repeats` that last too long."""
    runs = repeats(record)
    return runs[runs[:, 1] - runs[:, 0] > LONGEST_REPEAT]


def gaps(record: SensorRecord) -> Array:
    """Find begin and end, s, of every time without a measurement, shape (n, 2)."""
    time = record.time[np.isfinite(record.values).any(axis=1)]
    intervals = np.diff(time)
    long = np.flatnonzero(intervals > gap_limit(intervals)) if intervals.size else []
    return np.stack([time[:-1][long], time[1:][long]], axis=1)
