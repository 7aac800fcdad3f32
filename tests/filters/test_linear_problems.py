"""On a linear problem every filter is the Kalman filter."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters import ekf
from auvid_cli.filters.ekf import run_extended_filter
from auvid_cli.filters.problem import OK, PREDICTION, Gaussian
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature, transformed, unscented

POINT_SETS = {
    "ckf": cubature,
    "tukf": transformed,
    "ukf": lambda n: unscented(n, 0.5, 2.0, 0.0),
    "ukf, close": lambda n: unscented(n, 1e-2, 2.0, 1.0),
}


@pytest.fixture
def run(run_whole):
    """Function: run a filter by name."""

    def with_name(name, problem, **options):
        if name == "ekf":
            return run_whole(run_extended_filter, problem, **options)
        return run_whole(partial(run_square_root_filter, POINT_SETS[name](problem.prior.mean.size)), problem, **options)

    return with_name


@pytest.fixture(params=["ekf", *POINT_SETS])
def filter_kind(request):
    return request.param


def test_every_filter_is_the_textbook_kalman_filter(filter_kind, linear_problem, textbook, run):
    history = run(filter_kind, linear_problem)
    assert history.failure == OK
    assert history.n_good == linear_problem.timeline.time.size
    assert_allclose(history.records.mean, textbook.mean, rtol=1e-9, atol=1e-9)
    assert_allclose(history.records.standard_deviation, textbook.standard_deviation, rtol=1e-9, atol=1e-9)
    assert_allclose(history.covariance, textbook.covariance, rtol=1e-9, atol=1e-9)
    assert_allclose(history.records.innovation, textbook.innovation, rtol=1e-9, atol=1e-9)
    assert_allclose(history.records.innovation_variance, textbook.innovation_variance, rtol=1e-9, atol=1e-9)


def test_normalised_innovations_are_those_of_the_textbook(filter_kind, linear_problem, textbook, run):
    nis = run(filter_kind, linear_problem).records.nis
    present = ~np.isnan(linear_problem.timeline.measurement).all(axis=1)
    assert not present.all(), "the problem should have measurements that are missing altogether"
    assert_allclose(nis[present], textbook.nis[present], rtol=1e-9)
    assert np.all(np.nan_to_num(nis[~present]) == 0.0)


def test_prior_and_timeline_are_not_modified(filter_kind, linear_problem, run):
    prior, timeline = linear_problem.prior, linear_problem.timeline
    before = prior.mean.copy(), prior.factor.copy(), timeline.measurement.copy()
    run(filter_kind, linear_problem)
    assert np.array_equal(prior.mean, before[0])
    assert np.array_equal(prior.factor, before[1])
    assert np.array_equal(timeline.measurement, before[2], equal_nan=True)


def test_on_chunk_receives_every_chunk(filter_kind, linear_problem, run):
    assert run(filter_kind, linear_problem, chunk=12).told == [(12, 12), (12, 12), (6, 6)]


@pytest.mark.parametrize("kind", POINT_SETS)
def test_chunks_change_nothing(kind, linear_problem, run):
    whole, chunks = run(kind, linear_problem, chunk=30), run(kind, linear_problem, chunk=7)
    assert len(chunks.told) == 5
    for a, b in zip(whole.records, chunks.records, strict=True):
        assert np.array_equal(a, b, equal_nan=True)


def with_timeline(problem, **changes):
    problem.timeline = problem.timeline._replace(**changes)
    return problem


@pytest.fixture
def until(events_of):
    """Function: the problem cut off after the first `stop` events."""

    def cut(problem, stop):
        problem.timeline = events_of(problem.timeline, 0, stop)
        return problem

    return cut


@pytest.mark.parametrize("event", [5, 8, 29])
def test_a_failed_prediction_is_reported_and_leaves_the_last_good_state(filter_kind, event, linear_problem, run, until):
    t = linear_problem.timeline
    inputs = np.vstack([t.inputs, np.full((1, t.inputs.shape[1]), np.nan)])
    substep_input = t.substep_input.copy()
    substep_input[t.substep_offset[event]] = 5
    history = run(filter_kind, with_timeline(linear_problem, inputs=inputs, substep_input=substep_input))
    assert (history.n_good, history.failure) == (event, PREDICTION)
    assert np.isfinite(history.records.mean[:event]).all()
    assert np.isnan(history.records.mean[event:]).all()
    assert np.isnan(history.records.standard_deviation[event:]).all()
    assert_allclose(history.covariance, run(filter_kind, until(linear_problem, event)).covariance, rtol=1e-12)


def test_failed_update_is_reported_with_its_sensor(filter_kind, linear_problem, run, until):
    t = linear_problem.timeline
    event = next(k for k in range(8, 30) if t.measurement_offset[k + 1] > t.measurement_offset[k])
    first = t.measurement_offset[event]
    measurement = t.measurement.copy()
    measurement[first] = np.inf
    with np.errstate(invalid="ignore"):
        history = run(filter_kind, with_timeline(linear_problem, measurement=measurement))
    assert (history.n_good, history.failure) == (event, t.measurement_sensor[first])
    assert np.isfinite(history.records.mean[:event]).all()
    assert np.isnan(history.records.mean[event:]).all()
    assert_allclose(history.covariance, run(filter_kind, until(linear_problem, event)).covariance, rtol=1e-12)


@pytest.mark.parametrize("together", [1, 7])
@pytest.mark.parametrize("broken", [False, True])
def test_block_size_of_ekf_changes_nothing(together, broken, linear_problem, run, monkeypatch):
    if broken:
        measurement = linear_problem.timeline.measurement.copy()
        measurement[linear_problem.timeline.measurement_offset[20]] = np.inf
        linear_problem = with_timeline(linear_problem, measurement=measurement)
    whole = run("ekf", linear_problem)
    monkeypatch.setattr(ekf, "BLOCK", together)
    parts = run("ekf", linear_problem)
    assert (parts.n_good, parts.failure) == (whole.n_good, whole.failure)
    assert (whole.failure != OK) == broken
    assert np.array_equal(parts.covariance, whole.covariance)
    for a, b in zip(whole.records[:-1], parts.records[:-1], strict=True):
        assert_allclose(a, b, rtol=1e-12)


@pytest.mark.parametrize("turns", [-3, 1, 2])
def test_angle_is_measured_modulo_a_turn(filter_kind, turns, linear_problem, run):
    problem = linear_problem
    wrapping = problem.sensors._replace(angular=np.ones_like(problem.sensors.angular))
    # Small errors only: no innovation near half a turn, where the wrap itself would jump.
    small = Gaussian(0.01 * problem.prior.mean, 0.01 * problem.prior.factor)
    t = problem.timeline
    problem.timeline = t._replace(measurement=0.01 * t.measurement, inputs=0.0 * t.inputs)
    problem.prior = small
    plain = run(filter_kind, problem)
    assert np.nanmax(np.abs(plain.records.innovation)) < 3.0
    problem.sensors = wrapping
    problem.timeline = problem.timeline._replace(measurement=problem.timeline.measurement + 2 * np.pi * turns)
    turned = run(filter_kind, problem)
    assert_allclose(turned.records.mean, plain.records.mean, rtol=1e-9, atol=1e-12)
    assert_allclose(turned.records.innovation, plain.records.innovation, rtol=1e-9, atol=1e-12)
