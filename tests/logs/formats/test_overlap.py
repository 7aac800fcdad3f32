"""Files that should continue each other."""

import numpy as np
import pytest

from auvid_cli.logs.formats.log import Overlap, find_overlaps


def found(*files):
    """Overlaps of files, each a list of times and a list of values."""
    number = np.repeat(np.arange(1.0, len(files) + 1), [len(times) for times, _ in files])
    times, values = (np.concatenate([np.array(file[k], float) for file in files]) for k in (0, 1))
    return find_overlaps(times, number, values[:, None])


@pytest.mark.parametrize(
    "second", [([4, 5], [0, 0]), ([3, 4], [9, 9]), ([-3, -2], [1, 2]), ([np.nan, 7], [1, 2])], ids=str
)
def test_files_one_after_the_other_do_not_overlap(second):
    assert found(([0, 1, 2, 3], [5, 6, 7, 8]), second) == []


@pytest.mark.parametrize(
    ("times", "values", "own"),
    [
        ([1, 2, 3, 4], [6, 7, np.nan, 9], False),  # the same measurements
        ([2, 3, 4], [7, np.nan, 9], False),
        ([1, 3, 4], [6, np.nan, 9], False),  # the same, one missing
        ([1, 2, 3, 4], [6, 7.5, np.nan, 9], True),  # another measurement at the same time
        ([1.5, 2.5, 4], [6, 7, 9], True),
    ],
)
def test_repeats_of_measurements_are_told_from_others_at_the_same_time(times, values, own):
    end = 3.0
    assert found(([0, 1, 2, 3], [5, 6, 7, np.nan]), (times, values)) == [Overlap(2, times[0], end, own)]


def test_a_file_between_two_others_overlaps_neither():
    assert found(([0, 1], [0, 0]), ([10, 11], [0, 0]), ([5, 6], [0, 0])) == []
    assert found(([0, 1], [0, 0]), ([10, 12], [0, 0]), ([11, 13], [0, 0])) == [Overlap(3, 11.0, 12.0, True)]
