"""Most probable parameters with the motion integrated out: cost gradients added to the linear smoothing problem."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.fault_scores import FaultEffects, Faults, score_faults
from auvid_cli.filters.influence_functions import ConditionalFilter
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing, Trajectory, gauss_newton, with_process_memory
from auvid_cli.filters.problem import TIMELINE, ConvergenceStatus, FaultScores, Gaussian, ModelData, Timeline
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.smoother_backward import ADJOINT, Adjoint, adjoint_predict, adjoint_update
from auvid_cli.filters.smoother_forward import (
    FORWARD_PASS,
    LINEARISED,
    Linearised,
    SmootherWorkspace,
    linearise_measurements,
    linearise_process,
)

Array = NDArray[np.float64]
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]
# By which a state is changed for a difference quotient, SI: what depends on the parameters is nearly a polynomial.
_CHANGE = 1e-4
# Standard deviations that the last step may have.
_SMALL = 0.05
# Times the prior's spread of parameters that are held, and passes in which the motion follows these.
_HELD, _PASSES = 1e-8, 10


class GradientResponse(NamedTuple):
    """Effect of a gradient, times minus one.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters,)
        Effect on the parameters.
    shown : list of list of ndarray, shape (n_measurements, c)
        Effect on innovations, by segment and chunk; zero where missing.
    """

    parameters: Array
    shown: list[list[Array]]


def apply_gradient(smoothing: LinearSmoothing, filtered: Filtered, gradient: Trajectory) -> GradientResponse:
    """Return the effect of a gradient on parameters and innovations.

    Parameters
    ----------
    smoothing : LinearSmoothing
    filtered : Filtered
    gradient : Trajectory
        At each state of the trajectory.
    """
    n, n_moving = gradient.parameters.size, gradient.initial[0].size
    moved, scratch = np.zeros(n + n_moving), np.zeros(n_moving)
    shown = list[list[Array]]()
    for segment, timeline, about, forward_pass in smoothing.forward_passes(filtered):
        if segment == len(shown):
            # As in `score_faults`; a gradient at the beginning of the segment acts before its first event.
            moved[n:] = filtered.by_parameters[segment] @ moved[:n]
            moved += filtered.before[segment][0].covariance()[:, n:] @ gradient.initial[segment]
            shown.append([])
        of_chunk = np.zeros(about.residual.shape)
        _propagate(timeline, about, forward_pass, gradient.moving[segment][len(shown[-1])], moved, of_chunk, scratch)
        shown[-1].append(of_chunk)
    return GradientResponse(moved[:n] + filtered.final.covariance()[:n, :n] @ gradient.parameters, shown)


def gradient_scores(smoothing: LinearSmoothing, filtered: Filtered, gradient: Trajectory, faults: Faults) -> Array:
    """Return the change of the linear terms by the effect of faults on the estimate, per unit of each fault.

    Parameters
    ----------
    smoothing, filtered, gradient
        As of `apply_gradient`.
    faults : Faults
    """
    n, n_moving = gradient.parameters.size, gradient.initial[0].size
    shown, changes = apply_gradient(smoothing, filtered, gradient).shown, np.zeros(len(faults.labels))
    adjoint = Adjoint.zeros(n + n_moving, with_variance=False)
    adjoint.mean[:n] = gradient.parameters
    for segment, timeline, about, forward_pass in smoothing.forward_passes_back(filtered, adjoint):
        by_pushed, by_added, scratch = (np.zeros(a.shape) for a in (about.moving, about.residual, about.residual))
        chunk = len(shown[segment]) - 1
        opposed = forward_pass._replace(error=-shown[segment].pop())
        _propagate_back(
            timeline, about, opposed, gradient.moving[segment][chunk], adjoint, by_pushed, by_added, scratch
        )
        if chunk == 0:
            adjoint.mean[n:] += gradient.initial[segment]
        effects = faults.effects(segment, timeline, about)
        changes += np.einsum("ki,kif->f", by_pushed, effects.on_states) + np.einsum(
            "kc,kcf->f", by_added, effects.on_measurements
        )
    return changes


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, _matrix, _vector, _matrix, _vector), reassociate=True)
def _propagate(timeline, about, forward_pass, gradient, moved, shown, scratch):
    """Carry the effect of a gradient through a chunk.

    Parameters
    ----------
    timeline, about, forward_pass
        Of the chunk.
    gradient : ndarray, shape (n_events, n_moving)
    moved : ndarray, shape (n,)
        The filter's mean, times minus one: before the chunk, and afterwards at its end.
    shown : ndarray, shape (n_measurements, c)
        Filled in; zero where missing.
    scratch : ndarray, shape (n_moving,)
        Overwritten.
    """
    n, n_moving = moved.size, scratch.size
    n_parameters = n - n_moving
    for event in range(timeline.time.size):
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                scratch[i] = 0.0
                for j in range(n):
                    scratch[i] += about.transition[event, i, j] * moved[j]
            for i in range(n_moving):
                moved[n_parameters + i] = scratch[i]
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            for c in range(about.residual.shape[1]):
                if np.isnan(about.residual[k, c]):
                    continue
                for j in range(n):
                    shown[k, c] += about.rows[k, c, j] * moved[j]
                share = shown[k, c] / forward_pass.total[k, c]
                for j in range(n):
                    moved[j] -= forward_pass.gain[k, c, j] * share
        for i in range(n_moving):
            for j in range(n):
                moved[j] += forward_pass.covariance[event, i, j] * gradient[event, i]


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, _matrix, ADJOINT, _matrix, _matrix, _matrix), reassociate=True)
def _propagate_back(timeline, about, forward_pass, gradient, adjoint, by_pushed, by_added, scratch):
    """Carry a gradient back through a chunk, to additions to the states and to the measurements.

    Parameters
    ----------
    timeline, about, forward_pass
        Of the chunk; errors are minus the effect of the gradient on innovations.
    gradient : ndarray, shape (n_events, n_moving)
    adjoint : Adjoint
        After the chunk, then before it.
    by_pushed, by_added : ndarray, shape (n_events, n_moving) and (n_measurements, c)
        Filled in; zero where nothing leads and where missing.
    scratch : ndarray, shape (n_measurements, c)
        Overwritten.
    """
    mean, n_moving = adjoint.mean, gradient.shape[1]
    n_parameters = mean.size - n_moving
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        for i in range(n_moving):
            mean[n_parameters + i] += gradient[event, i]
        adjoint_update(event, timeline, about, forward_pass, adjoint, by_added, scratch)
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                by_pushed[event, i] = mean[n_parameters + i]
            adjoint_predict(about.transition[event], n_parameters, adjoint)


class MarginalEstimate(NamedTuple):
    """The most probable parameters whatever the motion was, and what they were found by.

    Attributes
    ----------
    problem : JointProblem
        Whose process noise is forgotten as fast as the motion is, see `auvid_cli.filters.linear_smoother`.
    answer : Filtered
    convergence : ConvergenceStatus or None
        As of `integrate_out_motion`.
    """

    problem: JointProblem
    answer: Filtered
    convergence: ConvergenceStatus | None


def marginal_estimate(
    problem: JointProblem, smoothing: LinearSmoothing, joint: Filtered, max_steps: int
) -> MarginalEstimate | None:
    """Go from the joint answer to the most probable parameters, by process noise as `auvid tune` finds it.

    Parameters
    ----------
    problem : JointProblem
    smoothing : LinearSmoothing
        Of the problem; afterwards of that of the answer.
    joint : Filtered
        About the joint answer.
    max_steps : int

    Returns
    -------
    MarginalAnswer or None
        None where the motion cannot follow the parameters.
    """
    forgotten = with_process_memory(problem, joint.trajectory.parameters, joint.trajectory.moving)
    smoothing.change_noise(forgotten.process, forgotten.sensors)
    again = smoothing.filter(joint.trajectory)
    found = None if again is None else integrate_out_motion(forgotten, smoothing, again, max_steps)
    return None if found is None else MarginalEstimate(forgotten, *found)


def integrate_out_motion(
    problem: JointProblem, smoothing: LinearSmoothing, joint: Filtered, max_steps: int
) -> tuple[Filtered, ConvergenceStatus | None] | None:
    """Go from the joint answer to the most probable parameters; None where the motion cannot follow these.

    Parameters
    ----------
    problem : JointProblem
    smoothing : LinearSmoothing
        Of the problem.
    joint : Filtered
        About the joint answer.
    max_steps : int

    Returns
    -------
    answer : Filtered
        About the parameters, and the motion that is most probable with them: the answer is this trajectory itself.
    convergence : ConvergenceStatus or None
        Where `max_steps` are not enough.
    """
    n, answer, convergence = problem.n_parameters, joint, None
    covariance = joint.final.covariance()[:n, :n]
    deviation = np.sqrt(np.diagonal(covariance))
    for _ in range(max_steps):
        # Back to the joint answer, as it seems from here, and on from there.
        step = answer.final.mean[:n] + marginal_step(problem, smoothing, answer)
        found = _most_probable_motion(problem, answer, answer.trajectory.parameters + step)
        filtered = None if found is None else smoothing.filter(found[0])
        if found is None or filtered is None:
            return None
        answer = filtered
        if found[1] and (np.abs(step) <= _SMALL * deviation).all():
            return answer, None
        convergence = ConvergenceStatus(float(step @ np.linalg.solve(covariance, step)), step / deviation)
    return answer, convergence


def _most_probable_motion(problem: JointProblem, answer: Filtered, parameters: Array) -> tuple[Trajectory, bool] | None:
    """Return the motion given the parameters, and whether it converged; None where its cost is not finite."""
    n, mean, factor = problem.n_parameters, problem.prior.mean.copy(), problem.prior.factor.copy()
    for place, owed in zip(problem.indices, answer.by_parameters, strict=True):
        mean[place[n:]] += owed @ (parameters - mean[:n])
    mean[:n] = parameters
    factor[:, :n] *= _HELD
    smoothing = LinearSmoothing(problem._replace(prior=Gaussian(mean, factor)))
    found = gauss_newton(smoothing, replace(answer.trajectory, parameters=parameters), _PASSES)
    if found is None:
        return None
    filtered, converged = found
    moved = filtered.trajectory.stepped(smoothing.step(filtered), 1.0)
    return replace(moved, parameters=parameters), converged


def marginal_step(problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered) -> Array:
    """Find the step from the joint answer to the most probable parameters, shape (n_parameters,)."""
    slopes, _ = _slopes(problem, smoothing, filtered, None)
    return -0.5 * apply_gradient(smoothing, filtered, slopes).parameters


def marginal_scores(problem: JointProblem, smoothing: LinearSmoothing, answer: Filtered, faults: Faults) -> FaultScores:
    """Find what the data say of faults, with the motion integrated out.

    The sum of logarithms depends on faults as it does on parameters, and what parameters and motion take up of a fault
    changes it: a scale of what measures a velocity changes this, and all damping with it.

    Parameters
    ----------
    problem : JointProblem
    smoothing : LinearSmoothing
        Of the problem.
    answer : Filtered
        From `integrate_out_motion`.
    faults : Faults
    """
    scores = score_faults(smoothing, answer, faults)
    slopes, by_faults = _slopes(problem, smoothing, answer, faults)
    taken_up = gradient_scores(smoothing, answer, slopes, faults)
    return scores._replace(score=scores.score - 0.5 * (by_faults + taken_up))


def _slopes(
    problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered, faults: Faults | None
) -> tuple[Trajectory, Array]:
    """Return the derivatives of the sum of logarithms by parameters and motion, and by faults."""
    n, n_moving = problem.n_parameters, problem.n_moving
    n_states = n + n_moving
    slopes = np.zeros(n_states + (0 if faults is None else len(faults.labels)))
    data = ModelData.of(problem.process, problem.sensors)
    work = SmootherWorkspace.of(problem.process, n_states, problem.sensors.matrix.shape[1])
    initial, moving, times = list[Array](), list[list[Array]](), 2.0 / _CHANGE
    for segment in range(len(problem.segments)):

        def columns(timeline: Timeline, about: Linearised, segment: int = segment) -> FaultEffects:
            """Return what parameters, moving states, then faults, do to a chunk."""
            if faults is None:
                return FaultEffects(about.transition, about.rows)
            pairs = zip((about.transition, about.rows), faults.effects(segment, timeline, about), strict=True)
            return FaultEffects(*(np.concatenate(pair, axis=-1) for pair in pairs))

        adjoint = Adjoint.zeros(n_moving, with_variance=True)
        moving.append([])
        # By the state before the chunk that was looked at last: at an event of the chunk before, or where it all began.
        by_last = np.zeros(n_moving)
        for timeline, about, motion, _, before, forward_pass in ConditionalFilter(
            problem, smoothing, filtered, segment
        ).backward():
            by_transition, by_rows = np.zeros(motion.transition.shape), np.zeros(motion.rows.shape)
            scratch = np.zeros((n_moving + adjoint.root.shape[1], n_moving))
            variance = problem.sensors.variance[timeline.measurement_sensor] / forward_pass.weight
            _backward_pass(timeline, motion, forward_pass, adjoint, before, variance, by_transition, by_rows, scratch)
            here = columns(timeline, about)
            # A transition leads from the event before its own.
            seen_at = 1 + np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
            by_states = np.zeros((1 + timeline.time.size, n_moving))
            by_states[-1] = by_last
            for state in range(n_moving):
                beside = columns(timeline, _beside(problem, data, timeline, about, state, work))
                led = np.einsum("ki,kij->kj", by_transition[..., state], beside.on_states - here.on_states)
                seen = np.einsum("kc,kcj->kj", by_rows[..., state], beside.on_measurements - here.on_measurements)
                slopes += led.sum(axis=0) + seen.sum(axis=0)
                by_states[:-1] += led[:, n:n_states]
                np.add.at(by_states, seen_at, seen[:, n:n_states])
            moving[-1].insert(0, times * by_states[1:])
            by_last = by_states[0]
        initial.append(times * by_last)
    slopes *= times
    return Trajectory(slopes[:n], initial, moving), slopes[n_states:]


def _beside(
    problem: JointProblem, data: ModelData, timeline: Timeline, about: Linearised, state: int, work: SmootherWorkspace
) -> Linearised:
    """Linearise a chunk about a trajectory of which one state is everywhere a little larger."""
    larger = np.zeros(problem.n_moving)
    larger[state] = _CHANGE
    beside = about._replace(
        before=about.before + larger,
        moving=about.moving + larger,
        **{name: np.zeros_like(getattr(about, name)) for name in ("residual", "rows", "defect", "transition")},
    )
    linearise_process(problem.process.transition, data, timeline, beside, work)
    linearise_measurements(problem.process.linearise, data, timeline, beside, work)
    return beside


@compiled(
    types.void(TIMELINE, LINEARISED, FORWARD_PASS, ADJOINT, _matrix, _matrix, _stack, _stack, _matrix), reassociate=True
)
def _backward_pass(timeline, motion, forward_pass, adjoint, before, variance, by_transition, by_rows, scratch):
    """Carry the adjoint back over a chunk; write down how half the sum of logarithms depends on it.

    Parameters
    ----------
    timeline, motion, forward_pass
        Of the motion alone.
    adjoint : Adjoint
        After the chunk, then before it.
    before : ndarray, shape (n, n)
        Covariance before the chunk.
    variance : ndarray, shape (n_measurements, c)
        Of the noise.
    by_transition, by_rows : ndarray, shape as of `transition` and `rows`
        Filled in: derivatives by these, zero where nothing leads and of components that are missing.
    scratch : ndarray, shape (n + columns of the adjoint's root, n)
        Overwritten.
    """
    n, root = before.shape[0], adjoint.root
    moved, said = scratch[:n], scratch[n:]
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        n_columns = adjoint.n_columns[0]
        covariance = forward_pass.covariance[event]
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            for c in range(motion.residual.shape[1]):
                if np.isnan(motion.residual[k, c]):
                    continue
                # h' P (I - Lambda P) / r
                row, known, owed, told = motion.rows[k, c], moved[0], moved[1], by_rows[k, c]
                for i in range(n):
                    known[i] = 0.0
                    for j in range(n):
                        known[i] += covariance[i, j] * row[j]
                    owed[i] = 0.0
                for column in range(n_columns):
                    share = 0.0
                    for i in range(n):
                        share += root[i, column] * known[i]
                    for i in range(n):
                        owed[i] += share * root[i, column]
                for i in range(n):
                    total = known[i]
                    for j in range(n):
                        total -= covariance[i, j] * owed[j]
                    told[i] = total / variance[k, c]
        adjoint_update(event, timeline, motion, forward_pass, adjoint, variance[:0], variance[:0])
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            n_columns = adjoint.n_columns[0]
            transition, covariance = (
                motion.transition[event],
                forward_pass.covariance[event - 1] if event > 0 else before,
            )
            for i in range(n):
                for j in range(n):
                    moved[i, j] = 0.0
                    for m in range(n):
                        moved[i, j] += transition[i, m] * covariance[m, j]
            for column in range(n_columns):
                for j in range(n):
                    said[column, j] = 0.0
                    for i in range(n):
                        said[column, j] += root[i, column] * moved[i, j]
            for i in range(n):
                for j in range(n):
                    for column in range(n_columns):
                        by_transition[event, i, j] += root[i, column] * said[column, j]
            adjoint_predict(transition, 0, adjoint)
