import numpy as np
import pytest

from auvid_cli.logs.sensor_records import unintended_gaps

# 10 Hz, silent from 2 s to 5 s and from 7 s to 8.5 s.
TIME = np.concatenate([np.arange(0, 21), np.arange(50, 71), np.arange(85, 101)]) / 10
LONGEST, SHORTER = (2.0, 5.0), (7.0, 8.5)


@pytest.mark.parametrize(
    ("use", "exclude", "gaps"),
    [
        ((), (), (LONGEST, SHORTER)),
        (((0.0, 2.0), (5.0, 10.0)), (), (SHORTER,)),
        (((0.0, 6.0),), (), (LONGEST,)),
        ((), ((3.0, 4.0),), (SHORTER,)),
        ((), ((3.0, 4.0), (8.0, 8.1)), ()),
    ],
)
def test_gaps_outside_excluded_spans_are_unintended(use, exclude, gaps):
    assert unintended_gaps(TIME, use, exclude) == gaps


@pytest.mark.parametrize(("interval", "gap", "said"), [(0.01, 0.9, False), (0.01, 1.1, True), (1.0, 9.0, False)])
def test_gap_exceeds_one_second_and_ten_intervals(interval, gap, said):
    time = np.cumsum(np.insert(np.full(100, interval), 50, gap))
    assert bool(unintended_gaps(time, (), ())) == said
    assert unintended_gaps(time[:1], (), ()) == ()
