"""A sensor's record without what is wrong with it by itself, so that no fault is found twice."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.gaps import gaps, stuck_times
from auvid_cli.inspection.inspection import Mark
from auvid_cli.inspection.single_sensor import spikes
from auvid_cli.inspection.timing import clock_jumps


class Screened(NamedTuple):
    """A record that can be compared with other sensors, and what was left out.

    Attributes
    ----------
    record : SensorRecord
        NaN for stuck values and spikes; ends where the clock jumps.
    jumps : ndarray of int
        Samples before the jumps of the clock.
    spikes : ndarray of bool, shape (n, c)
        In the record as it was.
    largest : dict
        Of each component the size of the largest spike, in robust standard deviations, and its time, s.
    marks : list of Mark
    """

    record: SensorRecord
    jumps: NDArray[np.int64]
    spikes: NDArray[np.bool_]
    largest: dict[str, tuple[float, float]]
    marks: list[Mark]


def screened(name: str, record: SensorRecord) -> Screened:
    """Take out what is wrong with a sensor by itself."""
    time, values = record.time, record.values.copy()
    stuck = stuck_times(record)
    for start, end in stuck:
        # The first of them was measured.
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
    return Screened(SensorRecord(time[:end], values[:end], record.standard_deviation), jumps, mask, largest, marks)
