"""Segments that share their parameters, against one set of linear equations in all that is unknown."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.filters.ekf import run_extended_filter
from auvid_cli.filters.least_squares import Information, join_segments
from auvid_cli.filters.output_error import run_output_error
from auvid_cli.filters.problem import (
    OK,
    PREDICTION,
    Gaussian,
    JointProblem,
    filter_sequentially,
    joint_gaussian,
    segment_gaussian,
    segment_indices,
)
from auvid_cli.filters.smoother import run_smoother
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature

N_MOVING = 4
CUT = 13


@pytest.fixture
def cut_in_two(linear_problem, events_of, by_hand):
    """The problem as two segments, and its measurements as linear equations in parameters and both motions.

    The second begins at the last event of the first, of which it has no measurement.
    """
    p, rng = linear_problem, np.random.default_rng(5)
    t, n = p.timeline, p.prior.mean.size
    n_parameters = n - N_MOVING
    p.segments = [[events_of(t, 0, 6), events_of(t, 6, CUT)], [events_of(t, CUT, 30)]]
    factor = p.prior.factor.copy()
    factor[n_parameters:] = np.tril(rng.standard_normal((n, n)))[n_parameters:] + 2.0 * np.eye(n)[n_parameters:]
    second = Gaussian(np.append(p.prior.mean[:n_parameters], rng.standard_normal(N_MOVING)), factor)
    p.joint = joint_gaussian([p.prior, second], N_MOVING)

    back = np.linalg.inv(by_hand.transition[CUT - 1])
    p.transition = [by_hand.transition[:CUT], by_hand.transition[CUT:] @ back]
    p.offset = [by_hand.offset[:CUT], by_hand.offset[CUT:] - p.transition[1] @ by_hand.offset[CUT - 1]]
    split = t.measurement_offset[CUT]
    matrices = by_hand.matrix[:split], by_hand.matrix[split:] @ back
    measurements = by_hand.measurement[:split], by_hand.measurement[split:] + matrices[1] @ by_hand.offset[CUT - 1]
    deviation = np.sqrt(p.sensors.variance[t.measurement_sensor])
    present = ~np.isnan(t.measurement)
    p.places = [np.arange(n), np.append(np.arange(n_parameters), np.arange(n, n + N_MOVING))]
    rows = np.zeros((*t.measurement.shape, n + N_MOVING))
    rows[:split, :, p.places[0]], rows[split:, :, p.places[1]] = matrices
    p.rows = (rows / deviation[..., None])[present]
    p.heard = (np.concatenate(measurements) / deviation)[present]
    return p


def best(p):
    """Joint state that fits measurements and prior best, and its covariance."""
    weight = np.linalg.inv(p.joint.factor)
    left, values, right = np.linalg.svd(np.vstack([p.rows, weight]), full_matrices=False)
    root = right.T / values
    return root @ (left.T @ np.append(p.heard, weight @ p.joint.mean)), root @ root.T


def received():
    """An `on_chunk` that keeps what it receives."""
    means, deviations = [], []

    def on_chunk(timeline, records):
        means.append(records.mean)
        deviations.append(records.standard_deviation)

    return on_chunk, means, deviations


def test_segment_states_share_the_parameters():
    assert [place.tolist() for place in segment_indices(8, 2, 3)] == [[0, 1, 2, 3], [0, 1, 4, 5], [0, 1, 6, 7]]


def test_joint_gaussian_has_the_marginals_of_segments(cut_in_two):
    p = cut_in_two
    n = p.prior.mean.size
    covariance = p.joint.factor @ p.joint.factor.T
    for place, gaussian in zip(p.places, [p.prior, segment_gaussian(p.joint, p.places[1])], strict=True):
        assert_allclose(covariance[np.ix_(place, place)], gaussian.factor @ gaussian.factor.T, rtol=1e-12)
    assert np.array_equal(segment_gaussian(p.joint, p.places[0]).factor, p.prior.factor)
    # Motions are correlated only through the parameters.
    known = n - N_MOVING
    by_parameters = [p.prior.factor[known:, :known], p.joint.factor[n:, :known]]
    assert_allclose(covariance[known:n, n:], by_parameters[0] @ by_parameters[1].T, rtol=1e-12)


def test_all_are_fitted_at_once(cut_in_two):
    p = cut_in_two
    state, covariance = best(p)
    on_chunk, means, deviations = received()
    outcome = run_output_error(JointProblem(p.process, p.sensors, p.segments, p.joint), on_chunk, use_prior=True)
    assert (outcome.n_good, outcome.failure) == (30, OK)
    mean = np.concatenate([o + t @ state[place] for o, t, place in zip(p.offset, p.transition, p.places, strict=True)])
    own = [
        t @ covariance[np.ix_(place, place)] @ t.swapaxes(-1, -2)
        for t, place in zip(p.transition, p.places, strict=True)
    ]
    deviation = np.sqrt(np.diagonal(np.concatenate(own), axis1=1, axis2=2))
    assert_allclose(np.concatenate(deviations), deviation, rtol=1e-6)
    assert np.abs((np.concatenate(means) - mean) / deviation).max() < 1e-5
    size = np.sqrt(np.diagonal(own[1][-1]))
    assert_allclose(outcome.covariance / np.outer(size, size), own[1][-1] / np.outer(size, size), atol=1e-6)


@pytest.mark.parametrize("kind", ["square root", "extended"])
def test_filter_without_process_noise_ends_at_the_fit(kind, cut_in_two):
    """The parameters go on from the first to the second, and with them what they say of its motion."""
    p = cut_in_two
    state, covariance = best(p)
    process = p.process._replace(noise_density=np.zeros(N_MOVING))
    run = {
        "square root": partial(run_square_root_filter, cubature(p.prior.mean.size), process, p.sensors),
        "extended": partial(run_extended_filter, process, p.sensors),
    }[kind]
    on_chunk, means, _ = received()
    outcome = filter_sequentially(run, JointProblem(process, p.sensors, p.segments, p.joint), on_chunk)
    assert (outcome.n_good, outcome.failure) == (30, OK)
    own = p.transition[1][-1] @ covariance[np.ix_(p.places[1], p.places[1])] @ p.transition[1][-1].T
    deviation = np.sqrt(np.diag(own))
    assert_allclose(
        outcome.covariance / np.outer(deviation, deviation), own / np.outer(deviation, deviation), atol=1e-6
    )
    expected = p.offset[1][-1] + p.transition[1][-1] @ state[p.places[1]]
    assert np.abs((means[-1][-1] - expected) / deviation).max() < 1e-5


def test_diverging_segment_ends_the_fit(cut_in_two):
    p = cut_in_two
    (second,) = p.segments[1]
    substep_input = second.substep_input.copy()
    substep_input[second.substep_offset[4]] = 5
    inputs = np.vstack([second.inputs, np.full((1, second.inputs.shape[1]), np.nan)])
    p.segments[1] = [second._replace(inputs=inputs, substep_input=substep_input)]
    on_chunk, means, _ = received()
    outcome = run_output_error(JointProblem(p.process, p.sensors, p.segments, p.joint), on_chunk, use_prior=True)
    assert (outcome.n_good, outcome.failure) == (CUT + 4, PREDICTION)
    assert [len(mean) for mean in means] == [6, 7, 4]


seeds = st.integers(0, 2**32 - 1)


def random_parts(rng, n_parameters, n_moving, n_segments):
    """Rows of segments in their own states, and together in the joint one."""
    n_joint = n_parameters + n_segments * n_moving
    own = [
        rng.standard_normal((40, n_parameters + n_moving + 1)) * 10.0 ** rng.uniform(-3, 3, n_parameters + n_moving + 1)
        for _ in range(n_segments)
    ]
    joint = np.zeros((40 * n_segments, n_joint + 1))
    for k, rows in enumerate(own):
        first = n_parameters + k * n_moving
        block = joint[40 * k : 40 * (k + 1)]
        block[:, :n_parameters], block[:, first : first + n_moving], block[:, -1] = (
            rows[:, :n_parameters],
            rows[:, n_parameters:-1],
            rows[:, -1],
        )
    return own, joint


def of_rows(rows):
    return Information.empty(rows.shape[1] - 1).with_rows(rows, len(rows))


@given(seed=seeds, n_parameters=st.integers(1, 8), n_moving=st.integers(1, 5), n_segments=st.integers(1, 4))
def test_information_of_all_is_that_of_all_rows(seed, n_parameters, n_moving, n_segments):
    own, rows = random_parts(np.random.default_rng(seed), n_parameters, n_moving, n_segments)
    found = join_segments([of_rows(chunk) for chunk in own], n_parameters)
    assert found.n_measurements == len(rows)
    size = np.linalg.norm(rows, axis=0)
    whole = np.vstack(
        [np.column_stack([found.factor, found.projected]), np.append(np.zeros(rows.shape[1] - 1), found.remaining)]
    )
    assert_allclose(whole.T @ whole / np.outer(size, size), rows.T @ rows / np.outer(size, size), atol=1e-12)
    more = found.join(of_rows(rows))
    assert_allclose(
        more.factor.T @ more.factor / np.outer(size, size)[:-1, :-1],
        2.0 * (rows.T @ rows / np.outer(size, size))[:-1, :-1],
        atol=1e-12,
    )


@given(seed=seeds, n_parameters=st.integers(1, 8), n_moving=st.integers(1, 5))
def test_split_gives_the_schur_complement(seed, n_parameters, n_moving):
    (rows,), _ = random_parts(np.random.default_rng(seed), n_parameters, n_moving, 1)
    _, rest = of_rows(rows).split(n_parameters)
    size = np.linalg.norm(rows, axis=0)
    normal = (rows.T @ rows / np.outer(size, size))[:-1, :-1]
    a, b, c = (
        normal[:n_parameters, :n_parameters],
        normal[:n_parameters, n_parameters:],
        normal[n_parameters:, n_parameters:],
    )
    expected = np.zeros_like(normal)
    expected[:n_parameters, :n_parameters] = a - b @ np.linalg.solve(c, b.T)
    assert_allclose(rest.factor.T @ rest.factor / np.outer(size, size)[:-1, :-1], expected, atol=1e-11)


def test_unobserved_motion_keeps_information_on_parameters(rng):
    """One of its states is not observed at all, of two others only the sum."""
    rows = rng.standard_normal((40, 7))
    rows[:, 3], rows[:, 5] = 0.0, rows[:, 4]
    _, rest = of_rows(rows).split(2)
    observed = np.delete(rows, [3, 5], axis=1)[:, :-1]
    expected = np.linalg.inv(np.linalg.inv(observed.T @ observed)[:2, :2])
    assert_allclose((rest.factor.T @ rest.factor)[:2, :2], expected, rtol=1e-9)


def test_an_uncertainty_of_some_is_that_of_the_whole(rng):
    rows = rng.standard_normal((40, 8))
    rows[:, 6] = 0.0
    whole = of_rows(rows).uncertainty()
    place = np.array([0, 3, 6])
    chunk = whole.of(place)
    assert chunk.root.shape == (3, 3)
    assert_allclose(chunk.deviation(np.eye(3)), whole.deviation(np.eye(7))[place])
    assert_allclose(chunk.covariance(np.eye(3)), whole.covariance(np.eye(7))[np.ix_(place, place)], atol=1e-14)


def test_a_smoother_solves_the_joint_problem_of_segments(cut_in_two):
    """With process noise that does nothing it is the least squares over parameters and both first motions."""
    p = cut_in_two
    process = p.process._replace(noise_density=1e-7 * p.process.noise_density)
    state, covariance = best(p)
    on_chunk, means, deviations = received()
    outcome = run_smoother(JointProblem(process, p.sensors, p.segments, p.joint), on_chunk)
    assert (outcome.failure, outcome.n_good) == (OK, 30)
    assert len(means) == 3
    n_parameters = p.prior.mean.size - N_MOVING
    deviation = np.sqrt(np.diagonal(covariance))[:n_parameters]
    for chunk, spread in zip(means, deviations, strict=True):
        assert np.abs((chunk[:, :n_parameters] - state[:n_parameters]) / deviation).max() < 1e-4
        assert_allclose(spread[:, :n_parameters], np.tile(deviation, (len(spread), 1)), rtol=1e-5)
    expected = [o + t @ state[place] for o, t, place in zip(p.offset, p.transition, p.places, strict=True)]
    assert_allclose(np.vstack(means), np.vstack(expected), atol=1e-4 * np.abs(np.vstack(expected)).max())
