"""Process noise accumulated over an interval, against van Loan's exact discretisation."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm

from auvid_cli.filters.problem import JointProblem, Process, joint_gaussian
from auvid_cli.filters.process_noise import noise_variance, with_process_memory

RATE = st.floats(-3.0, 20.0)


def van_loan(rates, density, duration):
    """Exact covariance of linear states under white noise (van Loan 1978)."""
    n = len(density)
    both = expm(duration * np.block([[-rates, np.diag(density**2)], [np.zeros((n, n)), rates.T]]))
    return both[n:, n:].T @ both[:n, n:]


def left(decay, density, duration):
    """Noise after an interval of two substeps, and at an event without substeps."""
    timeline = SimpleNamespace(
        substep_duration=np.array([0.25, 0.75]) * duration, substep_offset=np.array([0, 0, 2]), time=np.zeros(2)
    )
    process = Process(None, None, np.zeros(0), np.zeros(0, dtype=np.int64), density, decay=decay)
    before, at_the_end = noise_variance(process, timeline)
    assert (before == 0.0).all()
    return at_the_end


@given(st.lists(st.tuples(RATE, st.floats(1e-3, 10.0)), min_size=1, max_size=4), st.floats(1e-4, 1.0))
def test_noise_of_independent_states_is_exact(states, duration):
    decay, density = (np.array(each) for each in zip(*states, strict=True))
    exact = np.diagonal(van_loan(-np.diag(decay), density, duration))
    assert_allclose(left(decay, density, duration), exact, rtol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_noise_of_coupled_states_has_third_order_error(seed):
    rng = np.random.default_rng(seed)
    rates, density = rng.uniform(-3.0, 3.0, (3, 3)), rng.uniform(0.5, 1.0, 3)

    def error(duration):
        exact = np.diagonal(van_loan(rates, density, duration))
        return np.abs(left(-np.diagonal(rates), density, duration) - exact).max()

    # Times 8 for twice the interval, but for what is of fourth order; all of the noise would err with its square.
    assert error(2e-3) < 10.0 * error(1e-3) + 1e-13
    assert error(1e-3) < 100.0 * 1e-9


def test_unknown_rates_keep_all_noise():
    assert_allclose(left(np.zeros(0), np.array([2.0, 3.0]), 0.1), [0.4, 0.9])


@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_rates_are_those_of_the_motion_in_the_mean_of_all_segments(linear_problem, events_of):
    """A process that forgets as fast as its first position says, three times as fast in the second segment."""
    p = linear_problem

    def transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
        matrix[2:] = np.eye(6)[2:] - substep_duration.sum() * mean[2] * np.diag([0.0, 0.0, 1.0, 2.0, 3.0, 0.0])[2:]

    segments = [[events_of(p.timeline, 0, 15)], [events_of(p.timeline, 15, 30)]]
    problem = JointProblem(
        p.process._replace(transition=transition), p.sensors, segments, joint_gaussian([p.prior] * 2, 4)
    )
    moving = [[np.full((15, 4), 1.0)], [np.full((15, 4), 3.0)]]
    found = with_process_memory(problem, np.zeros(2), moving).process.decay
    assert_allclose(found, [2.0, 4.0, 6.0, 0.0], rtol=1e-8, atol=1e-8)
