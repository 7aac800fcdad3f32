"""Rejecting outliers: as if they were missing, and written down."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters.ekf import run_extended_filter
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature


@pytest.fixture(params=["ekf", "ckf"])
def run_filter(request, linear_problem):
    if request.param == "ekf":
        return run_extended_filter
    return partial(run_square_root_filter, cubature(linear_problem.prior.mean.size))


def test_a_rejected_component_counts_as_missing(run_filter, linear_problem, run_whole):
    p = linear_problem
    wild = np.zeros(p.timeline.measurement.shape, dtype=bool)
    wild[::5, 1] = wild[7, :] = True
    wild &= ~np.isnan(p.timeline.measurement)
    assert wild.sum() > 3
    measurement = p.timeline.measurement
    p.timeline = p.timeline._replace(measurement=np.where(wild, np.nan, measurement))
    without = run_whole(run_filter, p)
    p.timeline = p.timeline._replace(measurement=np.where(wild, 1e6, measurement))
    p.sensors = p.sensors._replace(gate=1e6)
    gated = run_whole(run_filter, p)
    assert_allclose(gated.records.mean, without.records.mean, rtol=1e-9, atol=1e-12)
    assert_allclose(gated.records.nis, without.records.nis, rtol=1e-9, atol=1e-12)
    assert (gated.records.innovation[wild] > 1e5).all()
    assert np.isnan(gated.records.innovation_variance[wild]).all()
    heard = ~np.isnan(measurement) & ~wild
    assert np.isfinite(gated.records.innovation_variance[heard]).all()


def test_the_gate_is_in_standard_deviations_of_the_innovation(run_filter, linear_problem, run_whole):
    p = linear_problem
    free = run_whole(run_filter, p).records
    squares = free.innovation**2 / free.innovation_variance
    first = int(np.flatnonzero(np.isfinite(squares).any(axis=1))[0])
    largest = int(np.nanargmax(squares[first]))
    for share, expected in ((0.99, 1), (1.01, 0)):
        p.sensors = p.sensors._replace(gate=share * squares[first, largest])
        gated = run_whole(run_filter, p).records
        rejected = np.isfinite(gated.innovation) & np.isnan(gated.innovation_variance)
        assert rejected[first].sum() == rejected[first, largest] == expected
