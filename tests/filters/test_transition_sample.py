"""Events that represent the transitions of a chunk."""

import numpy as np
import pytest

from auvid_cli.filters.problem import Timeline
from auvid_cli.filters.transition_sample import TransitionSample


@pytest.fixture
def timeline():
    """Seven events; no substeps lead to the first and the fifth."""
    offset = np.array([0, 0, 1, 3, 4, 4, 6, 7])
    duration = np.array([0.1, 0.05, 0.05, 0.3, 0.05, 0.05, 0.1])
    nothing = np.zeros(0, dtype=np.int64)
    return Timeline(
        *(np.arange(7.0), offset, duration, np.arange(7), np.zeros((7, 1))),
        *(nothing, np.zeros(8, dtype=np.int64), nothing.astype(np.int8), np.zeros((0, 1))),
    )


def test_without_interval_all_events_with_substeps_are_chosen(timeline):
    sample = TransitionSample.of(timeline, 0.0)
    assert sample.events.tolist() == [1, 2, 3, 5, 6]
    gradient = np.arange(7.0)[:, None, None]
    np.testing.assert_allclose(sample.sums(gradient), gradient[[1, 2, 3, 5, 6]])
    assert sample.timeline.substep_offset.tolist() == timeline.substep_offset.tolist()


def test_sums_keep_the_total_by_duration(timeline):
    sample, elapsed = TransitionSample.of(timeline, 0.45), np.array([0.0, 0.1, 0.1, 0.3, 0.0, 0.1, 0.1])
    assert len(sample.events) < 5
    sums = sample.sums(np.ones((7, 1, 1)))[:, 0, 0]
    assert (sums * elapsed[sample.events]).sum() == pytest.approx(elapsed.sum())
    counts = np.diff(sample.timeline.substep_offset)
    assert np.flatnonzero(counts).tolist() == sample.events.tolist()
    assert sample.timeline.substep_duration.sum() == pytest.approx(elapsed[sample.events].sum())


def test_typical_event_near_the_middle_is_chosen():
    duration = np.array([0.01, 0.1, 0.1, 0.1, 0.01])
    nothing = np.zeros(0, dtype=np.int64)
    timeline = Timeline(
        *(np.arange(5.0), np.arange(6), duration, np.arange(5), np.zeros((5, 1))),
        *(nothing, np.zeros(6, dtype=np.int64), nothing.astype(np.int8), np.zeros((0, 1))),
    )
    assert TransitionSample.of(timeline, 10.0).events.tolist() == [2]
