import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from auvid_cli.report.plot_data import envelope

signals = arrays(np.float64, st.integers(1, 200), elements=st.floats(-1e6, 1e6))


@given(signals, st.integers(1, 30))
def test_least_and_greatest_of_every_part_are_kept_and_nothing_else(values, spans):
    time = 0.1 * np.arange(len(values))
    at, kept = envelope(time, values, spans)
    if len(values) <= 2 * spans:
        np.testing.assert_array_equal(kept, values)
        return
    length = -(-len(values) // spans)
    for part, begin in enumerate(range(0, len(values), length)):
        block, pair = values[begin : begin + length], kept[2 * part : 2 * part + 2]
        np.testing.assert_array_equal(np.sort(pair), [block.min(), block.max()])
    assert len(kept) == len(at) <= 2 * spans
    assert (np.diff(at) >= 0.0).all()


@pytest.mark.parametrize("later", [0.0, 1000.0])
def test_the_greater_value_comes_where_it_came(later):
    values = np.r_[np.zeros(50), 1.0, np.zeros(48), -1.0]
    _, kept = envelope(np.arange(100.0) + later, values, 1)
    assert kept.tolist() == [1.0, -1.0]
    _, kept = envelope(np.arange(100.0) + later, values[::-1], 1)
    assert kept.tolist() == [-1.0, 1.0]


def test_what_is_not_finite_is_a_gap_and_hides_no_extreme():
    values = np.array([1.0, np.nan, 5.0, np.inf, *[np.nan] * 4, 2.0, 3.0, 2.5, 2.0])
    _, kept = envelope(np.arange(12.0), values, 3)
    np.testing.assert_array_equal(kept, [1.0, 5.0, np.nan, np.nan, 2.0, 3.0])


def test_no_line_bridges_a_jump_of_time():
    time = np.r_[np.arange(0.0, 5.0, 0.1), np.arange(50.0, 55.0, 0.1)]
    at, kept = envelope(time, np.ones(100), 200)
    assert np.isnan(kept[50])
    assert at[50] == 50.0
    assert np.isfinite(np.delete(kept, 50)).all()
