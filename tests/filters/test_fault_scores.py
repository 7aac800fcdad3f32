"""Score tests of faults against one Gaussian about all measurements, in which a fault is one more known column."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters.fault_scores import most_likely_sizes, needed_faults
from auvid_cli.filters.problem import OK, FaultScores, Gaussian, JointProblem, joint_gaussian, segment_indices
from auvid_cli.filters.signatures import FaultEffects
from auvid_cli.filters.smoother import run_smoother

N_MOVING, N_FAULTS = 4, 3
LABELS = "pushed", "measured", "both"


class SomeFaults:
    """One that pushes, one that is measured, and one that is both, at random."""

    labels = LABELS

    def __init__(self, timeline):
        rng = np.random.default_rng(11)
        self.timeline = timeline
        self.pushed = rng.standard_normal((timeline.time.size, N_MOVING, N_FAULTS))
        self.added = rng.standard_normal((*timeline.measurement.shape, N_FAULTS))
        self.pushed[..., 1], self.added[..., 0] = 0.0, 0.0

    def effects(self, segment, timeline, about):
        first = int(np.searchsorted(self.timeline.time, timeline.time[0]))
        k = self.timeline.measurement_offset[first]
        events, measurements = slice(first, first + timeline.time.size), slice(k, k + len(timeline.measurement))
        return FaultEffects(self.pushed[events].copy(), self.added[measurements].copy())


@pytest.fixture(params=["one segment", "two segments"])
def dense(request, linear_problem, events_of):
    """Scores from the covariance of all measurements; segments and their joint prior."""
    p, t, n = linear_problem, linear_problem.timeline, linear_problem.prior.mean.size
    n_parameters, faults = n - N_MOVING, SomeFaults(linear_problem.timeline)
    cuts, p.joint = [0, 30], p.prior
    if request.param == "two segments":
        rng, factor = np.random.default_rng(5), p.prior.factor.copy()
        factor[n_parameters:] = np.tril(rng.standard_normal((n, n)))[n_parameters:] + 2.0 * np.eye(n)[n_parameters:]
        second = Gaussian(np.append(p.prior.mean[:n_parameters], rng.standard_normal(N_MOVING)), factor)
        cuts, p.joint = [0, 13, 30], joint_gaussian([p.prior, second], N_MOVING)
    p.segments = [[events_of(t, k, min(k + 6, last)) for k in range(first, last, 6)] for first, last in pairwise(cuts)]
    n_joint = p.joint.mean.size
    of_faults, of_noise = slice(n_joint, n_joint + N_FAULTS), n_joint + N_FAULTS
    columns, variances = of_noise + 30 * N_MOVING, np.zeros(30 * N_MOVING)
    rows, heard, noise = [], [], []
    starts = dict(zip(cuts, segment_indices(n_joint, N_MOVING, len(p.segments)), strict=False))
    state, mean = np.zeros((n, columns)), np.zeros(n)
    for event in range(30):
        if event in starts:
            state, mean = np.eye(columns)[starts[event]], p.joint.mean[starts[event]].copy()
        pieces = slice(*t.substep_offset[event : event + 2])
        if pieces.stop > pieces.start:
            matrix, given = np.eye(n), (t.substep_input[pieces], t.substep_duration[pieces])
            p.process.transition(mean, t.inputs, *given, p.process.constants, p.process.selection, matrix, np.zeros(1))
            own = slice(of_noise + event * N_MOVING, of_noise + (event + 1) * N_MOVING)
            state = matrix @ state
            state[n_parameters:, own] += np.eye(N_MOVING)
            state[n_parameters:, of_faults] += faults.pushed[event]
            variances[own.start - of_noise : own.stop - of_noise] = p.process.noise_density**2 * given[1].sum()
        for k in range(*t.measurement_offset[event : event + 2]):
            sensor, present = t.measurement_sensor[k], ~np.isnan(t.measurement[k])
            effect = p.sensors.matrix[sensor] @ state
            effect[:, of_faults] += faults.added[k]
            rows.append(effect[present])
            heard.append((t.measurement[k] - p.sensors.matrix[sensor] @ mean)[present])
            noise.append(p.sensors.variance[sensor, present])
    design, new = np.vstack(rows), np.concatenate(heard)
    known, fault, pushed = design[:, :n_joint], design[:, of_faults], design[:, of_noise:]
    prior = p.joint.factor @ p.joint.factor.T
    covariance = known @ prior @ known.T + pushed * variances @ pushed.T + np.diag(np.concatenate(noise))
    weighted = np.linalg.solve(covariance, fault)
    return SimpleNamespace(
        problem=p,
        faults=faults,
        score=weighted.T @ new,
        information=weighted.T @ fault,
        effect=-(prior @ known.T @ weighted)[:n_parameters],
        deviation=np.sqrt(np.diagonal(prior))[:n_parameters],
        covariance=covariance,
        fault=fault,
        new=new,
    )


def outcome_of(dense, faults):
    p = dense.problem
    outcome = run_smoother(JointProblem(p.process, p.sensors, p.segments, p.joint), lambda *chunk: None, faults=faults)
    assert outcome.failure == OK
    return outcome


def scores_of(dense, faults):
    return outcome_of(dense, faults).faults


def test_scores_are_those_of_generalised_least_squares(dense):
    found = scores_of(dense, dense.faults)
    assert found.labels == LABELS
    assert_allclose(found.information, dense.information, rtol=1e-8, atol=1e-8 * np.abs(dense.information).max())
    sigma = np.diagonal(dense.information) ** -0.5
    assert_allclose(found.score * sigma, dense.score * sigma, atol=1e-8)
    one = sigma / dense.deviation[:, None]
    assert_allclose(found.effect * one, dense.effect * one, atol=1e-8)


@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_score_is_linear_in_a_fault(dense):
    """A fault added to the data adds its size to the estimate."""
    before, measured = scores_of(dense, dense.faults), dense.problem.timeline.measurement
    measured += 0.7 * dense.faults.added[..., 1]
    after = scores_of(dense, dense.faults)
    assert_allclose(after.information, before.information, rtol=1e-10, atol=1e-10 * before.information.max())
    size = [scores.score[1] / scores.information[1, 1] for scores in (before, after)]
    assert size[1] - size[0] == pytest.approx(0.7, rel=1e-7)


def test_innovations_without_faults_have_the_squares_of_the_data_without_them(dense):
    """Innovations are independent, so that their NIS is the square of all measurements by their covariance."""
    outcome = outcome_of(dense, dense.faults)
    for sizes in (np.zeros(N_FAULTS), np.array([0.7, -1.3, 0.4])):
        left = dense.new - dense.fault @ sizes
        chunks = [records for _, records in outcome.without_faults(sizes)]
        assert_allclose(sum(records.nis.sum() for records in chunks), left @ np.linalg.solve(dense.covariance, left))
        of_all = np.concatenate([records.innovation_variance for records in chunks])
        assert np.isfinite(of_all).sum() == left.size


def test_the_most_likely_sizes_are_those_of_least_squares_with_their_tolerances_as_prior(dense):
    tolerance = np.array([0.5, 0.0, 2.0])
    root = np.linalg.cholesky(dense.covariance)
    design, heard = (np.linalg.solve(root, of_all) for of_all in (dense.fault[:, [0, 2]], dense.new))
    matrix, value = np.vstack([design, np.diag(1.0 / tolerance[[0, 2]])]), np.append(heard, np.zeros(2))
    expected, *_ = np.linalg.lstsq(matrix, value)
    found = most_likely_sizes(scores_of(dense, dense.faults), tolerance)
    assert_allclose(found[[0, 2]], expected, rtol=1e-7)
    assert found[1] == 0.0


@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_no_faults_give_no_scores(dense):
    assert scores_of(dense, None) is None


@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_conditional_scores_are_those_of_least_squares(dense):
    """Against the same least squares, of which the fault that was found is one unknown more with a prior of its own."""
    spread, found = 0.3, scores_of(dense, dense.faults)
    others = found.conditional_on({LABELS[0]: spread})
    assert others.labels == LABELS[1:]
    known = dense.information + np.diag([spread**-2, *np.zeros(len(LABELS) - 1)])
    assert_allclose(np.linalg.inv(others.information), np.linalg.inv(known)[1:, 1:], rtol=1e-6)
    one = np.linalg.solve(known[:1, :1], known[:1, 1:])
    assert_allclose(others.effect, dense.effect[:, 1:] - dense.effect[:, :1] @ one, rtol=1e-6, atol=1e-9)
    assert found.conditional_on({}) is found


@pytest.mark.parametrize(("angle", "alternatives"), [(1e-3, (1,)), (1.0, ())])
def test_faults_with_the_same_signature_are_alternatives(angle, alternatives):
    """Of two unit signatures at an angle, the first is in the data; the third is unrelated."""
    signatures = np.array([[1.0, 0.0, 0.0], [np.cos(angle), np.sin(angle), 0.0], [0.0, 0.0, 1.0]])
    data = 20.0 * signatures[0]
    scores = FaultScores(("a", "b", "c"), signatures @ data, signatures @ signatures.T, np.zeros((1, 3)))
    (needed,) = needed_faults(scores, np.zeros(3), 3.5)
    assert (needed.place, needed.alternatives) == (0, alternatives)
    assert_allclose(needed.size, 20.0)


def test_needed_faults_are_significant_in_their_joint_estimate():
    """By least squares of the data on their signatures."""
    for seed in range(50):
        rng = np.random.default_rng(seed)
        signatures = rng.standard_normal((6, 8))
        data = 8.0 * signatures[0] - 6.0 * signatures[1] + rng.standard_normal(8)
        scores = FaultScores(tuple("abcdef"), signatures @ data, signatures @ signatures.T, np.zeros((1, 6)))
        needed = needed_faults(scores, np.zeros(6), 3.5)
        own = signatures[[fault.place for fault in needed]]
        covariance = np.linalg.inv(own @ own.T)
        sizes = covariance @ own @ data
        assert_allclose([fault.size for fault in needed], sizes, rtol=1e-6)
        assert (np.abs(sizes) / np.sqrt(np.diagonal(covariance)) > 3.5).all()
