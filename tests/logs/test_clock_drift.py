"""The better of a message's two clocks."""

import numpy as np
import pytest

from auvid_cli.logs.clock import find_clock_drift

EVEN = 1e9 + 0.1 * np.arange(1000)
NAMES = "taken", "other"


def delayed(rng, size):
    """Each message up to `size` s late, and all of them by six days."""
    return EVEN + 5e5 + rng.uniform(0.0, size, EVEN.size)


def test_clock_with_jitter_drifts_from_even_clock(rng):
    late = delayed(rng, 0.08)
    found = find_clock_drift(late, EVEN, NAMES)
    assert found is not None
    assert (found.clock, found.other, found.unsteady) == (*NAMES, True)
    assert found.later == pytest.approx(5e5, abs=0.1)
    # A uniform distribution has 90 % within 0.9 of its width, and none is further from the middle than half of it.
    assert found.spread == pytest.approx(0.9 * 0.08, rel=0.05)
    assert found.furthest == pytest.approx(0.5 * 0.08, rel=0.05)
    assert find_clock_drift(EVEN, late, NAMES) is None


@pytest.mark.parametrize(("interval", "size", "said"), [(0.1, 0.03, False), (0.1, 0.06, True), (0.01, 0.012, True)])
def test_drift_counts_from_half_interval_or_20_ms(rng, interval, size, said):
    even = interval * np.arange(1, 1000)
    late = even + rng.uniform(0.0, size, even.size)
    assert (find_clock_drift(late, even, NAMES) is not None) == said


def test_stamp_that_jumps_is_worse_than_log_time(rng):
    late, jumping = delayed(rng, 0.005), EVEN.copy()
    jumping[700:] += 30.0
    found = find_clock_drift(jumping, late, NAMES)
    assert found is not None
    assert found.furthest == pytest.approx(30.0, abs=0.01)
    assert not find_clock_drift(late, jumping, NAMES).unsteady


@pytest.mark.parametrize("other", [np.zeros(1000), np.full(1000, np.nan), np.full(1000, 5.0)])
def test_unset_stamp_gives_no_drift(rng, other):
    assert find_clock_drift(delayed(rng, 0.08), other, NAMES) is None


def test_missing_times_do_not_count(rng):
    late, stamps = delayed(rng, 0.08), EVEN.copy()
    late[3], stamps[[5, 6]] = np.nan, 0.0
    found = find_clock_drift(late, stamps, NAMES)
    assert found is not None
    assert found.furthest < 0.05


@pytest.mark.parametrize(
    ("later", "since", "said"), [(5e5, 1e9, True), (30.0, 1e9, False), (-5e5, 1e9, False), (5e5, 10.0, False)]
)
def test_played_back_log_is_recognised_by_epoch(later, since, said):
    stamps = since + 0.1 * np.arange(100)
    found = find_clock_drift(stamps + later, stamps, NAMES)
    assert (found is not None) == said
    if found is not None:
        assert found.later == pytest.approx(later)
        assert not found.unsteady
