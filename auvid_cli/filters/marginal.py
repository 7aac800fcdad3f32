"""Most probable parameters with the motion integrated out (Laplace's approximation).

Minus twice the log of the marginal posterior is the minimum of the cost over all motions, plus the sum of the
logarithms of the innovations' variances given the parameters. Its minimum is found from the joint one by steps along
the gradient of that sum. The gradient is computed by one backward pass and difference quotients of the linearised
process; adjoint equations give its effect on parameters and fault scores.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array, ArrayStore
from auvid_cli.filters.fault_scores import FaultEffects, Faults, score_faults
from auvid_cli.filters.linear_smoother import (
    ConditionalFilter,
    Filtered,
    LinearSmoothing,
    Trajectory,
    gauss_newton,
    with_process_memory,
)
from auvid_cli.filters.problem import (
    TIMELINE,
    ConvergenceStatus,
    FaultScores,
    Gaussian,
    JointProblem,
    ModelData,
    Timeline,
)
from auvid_cli.filters.smoother_backward import ADJOINT, Adjoint, adjoint_predict, adjoint_update
from auvid_cli.filters.smoother_forward import (
    FORWARD_PASS,
    LINEARISED,
    Linearised,
    SmootherWorkspace,
    linearise_measurements,
    linearise_process,
)
from auvid_cli.filters.transition_sample import TransitionSample
from auvid_cli.numerics import compiled, types

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]
# Step of a state in difference quotients; transitions are nearly polynomials of the state.
_STATE_STEP = 1e-4  # SI
# Interval of the transitions whose derivatives represent all, s. The motion changes slowly.
_TRANSITION_INTERVAL = 0.2
# Largest last step of the parameters, in standard deviations.
_MAX_LAST_STEP = 0.05
# Number of previous steps by which an iteration is accelerated.
_MEMORY = 3
# Factor on the prior's standard deviations, so small that parameters remain constant.
_FIXING_FACTOR = 1e-8
# Maximum number of passes in which the motion adapts to new parameters.
_MOTION_PASSES = 5
# Predicted decrease of the objective below which it is at its minimum if no step lowers it.
_NEGLIGIBLE_DECREASE = 0.1
# Largest number of halvings of a step that raises the objective.
_MAX_HALVINGS = 8


class GradientResponse(NamedTuple):
    """Negative change of the estimate if a gradient is added to half the cost."""

    parameters: Array  # shape (n_parameters,)
    innovations: list[ArrayStore]  # shape (n_measurements, c); by segment and chunk; zero if missing


def apply_gradient(smoothing: LinearSmoothing, filtered: Filtered, gradient: Trajectory) -> GradientResponse:
    """Return the effect on parameters and innovations of a gradient with respect to all states of a trajectory."""
    n, n_moving = gradient.parameters.size, gradient.initial[0].size
    moved, scratch = np.zeros(n + n_moving), np.zeros(n_moving)
    innovations = list[ArrayStore]()
    for segment, timeline, about, forward_pass in smoothing.forward_passes(filtered):
        if segment == len(innovations):
            # The gradient by the initial motion acts before the first event.
            moved[n:] = filtered.by_parameters[segment] @ moved[:n]
            moved += filtered.before[segment][0].covariance()[:, n:] @ gradient.initial[segment]
            innovations.append(ArrayStore())
        by_motion, of_chunk = gradient.moving[segment][len(innovations[-1])], np.zeros(about.residual.shape)
        _propagate(timeline, about, forward_pass, by_motion, moved, of_chunk, scratch)
        innovations[-1].append(of_chunk)
    return GradientResponse(moved[:n] + filtered.final.covariance()[:n, :n] @ gradient.parameters, innovations)


def gradient_scores(smoothing: LinearSmoothing, filtered: Filtered, gradient: Trajectory, faults: Faults) -> Array:
    """Return the product of a gradient with the change of the estimate, per unit of each fault."""
    n, n_moving = gradient.parameters.size, gradient.initial[0].size
    innovations, changes = apply_gradient(smoothing, filtered, gradient).innovations, np.zeros(len(faults.labels))
    adjoint = Adjoint.zeros(n + n_moving, with_variance=False)
    adjoint.mean[:n] = gradient.parameters
    n_left = [len(chunks) for chunks in innovations]
    for segment, timeline, about, forward_pass in smoothing.forward_passes_back(filtered, adjoint):
        by_states, by_measurements, scratch = (
            np.zeros(a.shape) for a in (about.moving, about.residual, about.residual)
        )
        n_left[segment] -= 1
        chunk = n_left[segment]
        by_motion, opposed = gradient.moving[segment][chunk], forward_pass._replace(error=-innovations[segment][chunk])
        _propagate_back(timeline, about, opposed, by_motion, adjoint, by_states, by_measurements, scratch)
        if chunk == 0:
            adjoint.mean[n:] += gradient.initial[segment]
        effects = faults.effects(segment, timeline, about)
        of_sensors = np.einsum("kc,kcf->f", by_measurements, effects.on_measurements)
        changes += np.einsum("ki,kif->f", by_states, effects.on_states) + of_sensors
    return changes


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, _matrix, _vector, _matrix, _vector), reassociate=True)
def _propagate(timeline, about, forward_pass, gradient, moved, shown, scratch):
    """Propagate the effect of a gradient, shape (n_events, n_moving), forward through a chunk.

    Parameters
    ----------
    moved : ndarray, shape (n,)
        Effect on the filtered state, times minus one, before the chunk; afterwards at its end.
    shown : ndarray, shape (n_measurements, c)
        Filled in: effect on innovations; zero if missing.
    scratch : ndarray, shape (n_moving,)
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
def _propagate_back(timeline, about, forward_pass, gradient, adjoint, by_states, by_measurements, scratch):
    """Propagate a gradient, shape (n_events, n_moving), back through a chunk.

    Parameters
    ----------
    forward_pass : ForwardPass
        Forward pass of the chunk; its errors are minus the effect of the gradient on innovations.
    adjoint : Adjoint
        After the chunk; afterwards before it.
    by_states, by_measurements : ndarray, shape (n_events, n_moving) and (n_measurements, c)
        Filled in: derivatives by additions to states and measurements; zero without substeps and if missing.
    scratch : ndarray, shape (n_measurements, c)
    """
    mean, n_moving = adjoint.mean, gradient.shape[1]
    n_parameters = mean.size - n_moving
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        for i in range(n_moving):
            mean[n_parameters + i] += gradient[event, i]
        adjoint_update(event, timeline, about, forward_pass, adjoint, by_measurements, scratch)
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                by_states[event, i] = mean[n_parameters + i]
            adjoint_predict(about.transition[event], n_parameters, adjoint)


class MarginalEstimate(NamedTuple):
    """Maximum of the marginal posterior."""

    problem: JointProblem  # with process memory, see `auvid_cli.filters.linear_smoother`
    filtered: Filtered  # about the estimated parameters and the most probable motion given them
    convergence: ConvergenceStatus | None  # none if it converged


def marginal_estimate(
    problem: JointProblem, smoothing: LinearSmoothing, joint: Filtered, max_steps: int
) -> MarginalEstimate | None:
    """Return the marginal estimate, from the joint minimum; None if the motion diverges for the parameters.

    The process noise has the same memory as in `auvid tune`; `smoothing` has that noise afterwards.
    """
    with_memory = with_process_memory(problem, joint.trajectory.parameters, joint.trajectory.moving)
    smoothing.change_noise(with_memory)
    filtered = smoothing.filter(joint.trajectory)
    found = None if filtered is None else integrate_out_motion(with_memory, smoothing, filtered, max_steps)
    return None if found is None else MarginalEstimate(with_memory, *found[:2])


class _GivenParameters(NamedTuple):
    """Most probable motion given the parameters."""

    trajectory: Trajectory
    objective: float  # minus twice the log of the marginal posterior of the parameters, up to a constant
    converged: bool


def integrate_out_motion(
    problem: JointProblem, smoothing: LinearSmoothing, start: Filtered, max_steps: int
) -> tuple[Filtered, ConvergenceStatus | None, float] | None:
    """Maximise the marginal posterior of the parameters; None if the motion diverges for them.

    Parameters
    ----------
    problem : JointProblem
    smoothing : LinearSmoothing
        Of the problem.
    start : Filtered
        About the first parameters, for example those of the joint minimum, and a motion.
    max_steps : int

    Returns
    -------
    filtered : Filtered
        Its trajectory is the estimate.
    convergence : ConvergenceStatus or None
        None if it converged within `max_steps`.
    gain : float
        Increase of the log of the marginal posterior.
    """
    n, filtered, convergence = problem.n_parameters, start, None
    covariance = start.final.covariance()[:n, :n]
    deviation, moves, steps = np.sqrt(np.diagonal(covariance)), list[Array](), list[Array]()
    at = _given_parameters(problem, filtered, filtered.trajectory, filtered.trajectory.parameters)
    if at is None or (filtered := smoothing.filter(at.trajectory)) is None:
        return None
    objective = at.objective
    for _ in range(max_steps):
        # To the joint minimum of the linear problem, and from there to the marginal one.
        step = filtered.final.mean[:n] + marginal_step(problem, smoothing, filtered)
        steps.append(step / deviation)
        convergence = ConvergenceStatus(float(step @ np.linalg.solve(covariance, step)), steps[-1])
        is_small = bool((np.abs(steps[-1]) <= _MAX_LAST_STEP).all())
        # A small step changes the objective by less than its rounding.
        limit = np.inf if is_small else at.objective
        found = _line_search(problem, filtered, at, deviation, (_accelerated(moves, steps), steps[-1]), limit)
        if found is None:
            # Where the motion hardly converges, the objective is rounded too.
            convergence = None if convergence.cost_decrease < _NEGLIGIBLE_DECREASE else convergence
            break
        at, move = found
        moves.append(move)
        if (filtered := smoothing.filter(at.trajectory)) is None:
            return None
        if is_small and at.converged:
            convergence = None
            break
    return filtered, convergence, 0.5 * (objective - at.objective)


def _line_search(
    problem: JointProblem,
    filtered: Filtered,
    at: _GivenParameters,
    deviation: Array,
    moves: tuple[Array, Array],
    limit: float,
) -> tuple[_GivenParameters, Array] | None:
    """Return the motion after the first move with an objective below a limit, and this move; None if none has one.

    The moves are the accelerated one, then the plain step and parts of it, in units of the deviation. Where the data
    hardly tell the parameters, the plain step can be ten times too long.
    """
    accelerated, step = moves
    # Without earlier steps the accelerated one is the plain one.
    parts = (0.5**halvings * step for halvings in range(1 if accelerated is step else 0, _MAX_HALVINGS))
    for move in (accelerated, *parts):
        after = _given_parameters(problem, filtered, at.trajectory, at.trajectory.parameters + deviation * move)
        if after is not None and after.objective < limit:
            return after, move
    return None


def _accelerated(moves: list[Array], steps: list[Array]) -> Array:
    """Return the next move of a fixed-point iteration by Anderson's method (SIAM J. Numer. Anal. 49(4), 2011).

    Parameters
    ----------
    moves : list of ndarray, shape (n,)
        Moves so far.
    steps : list of ndarray, shape (n,)
        Steps of the plain iteration before each move and now.
    """
    first = max(len(moves) - _MEMORY, 0)
    if first == len(moves):
        return steps[-1]
    changes = np.diff(np.stack(steps[first:], axis=1), axis=1)
    share = np.linalg.lstsq(changes, steps[-1])[0]
    return steps[-1] - (np.stack(moves[first:], axis=1) + changes) @ share


def _given_parameters(
    problem: JointProblem, filtered: Filtered, start: Trajectory, parameters: Array
) -> _GivenParameters | None:
    """Return the most probable motion given the parameters, from a start; None if its cost is not finite."""
    n, mean, factor = problem.n_parameters, problem.prior.mean.copy(), problem.prior.factor.copy()
    from_prior = np.linalg.solve(factor[:n, :n], parameters - mean[:n])
    for indices, by_parameters in zip(problem.indices, filtered.by_parameters, strict=True):
        mean[indices[n:]] += by_parameters @ (parameters - mean[:n])
    mean[:n] = parameters
    factor[:, :n] *= _FIXING_FACTOR
    smoothing = LinearSmoothing(problem._replace(prior=Gaussian(mean, factor)))
    found = gauss_newton(smoothing, replace(start, parameters=parameters), _MOTION_PASSES)
    if found is None:
        return None
    minimum, converged = found
    # A full step could raise the cost again before it has converged.
    moved = minimum.trajectory.stepped(smoothing.step(minimum), 1.0) if converged else minimum.trajectory
    # The factor of fixed parameters is part of the determinant, but the same for all.
    objective = minimum.cost + minimum.log_determinant + float(from_prior @ from_prior)
    return _GivenParameters(replace(moved, parameters=parameters), objective, converged)


def marginal_step(problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered) -> Array:
    """Return the step of the parameters from the joint to the marginal estimate, shape (n_parameters,)."""
    gradient, _ = _gradients(problem, smoothing, filtered, None)
    return -0.5 * apply_gradient(smoothing, filtered, gradient).parameters


def marginal_scores(
    problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered, faults: Faults
) -> FaultScores:
    """Return the scores of faults about a marginal estimate.

    The sum of logarithms depends on a fault directly, and through the parameters and the motion that adapt to it: the
    scale error of a velocity sensor, for example, changes the velocity and thus all damping.
    """
    scores = score_faults(smoothing, filtered, faults)
    gradient, by_faults = _gradients(problem, smoothing, filtered, faults)
    by_estimate = gradient_scores(smoothing, filtered, gradient, faults)
    return scores._replace(score=scores.score - 0.5 * (by_faults + by_estimate))


def _gradients(
    problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered, faults: Faults | None
) -> tuple[Trajectory, Array]:
    """Return the gradients of the sum of logarithms by parameters and motion, and by faults."""
    n, n_moving = problem.n_parameters, problem.n_moving
    n_states = n + n_moving
    total = np.zeros(n_states + (0 if faults is None else len(faults.labels)))
    data = ModelData.of(problem.process, problem.sensors)
    work = SmootherWorkspace.of(problem.process, n_states, problem.sensors.matrix.shape[1])
    initial, moving, scale = list[Array](), list[ArrayStore](), 2.0 / _STATE_STEP
    for segment in range(len(problem.segments)):

        def columns(timeline: Timeline, about: Linearised, segment: int = segment) -> FaultEffects:
            """Return the effects of parameters, moving states and faults on a chunk."""
            if faults is None:
                return FaultEffects(about.transition, about.rows)
            pairs = zip((about.transition, about.rows), faults.effects(segment, timeline, about), strict=True)
            return FaultEffects(*(np.concatenate(pair, axis=-1) for pair in pairs))

        adjoint = Adjoint.zeros(n_moving, with_variance=True)
        moving.append(ArrayStore())
        # Gradient by the state before the later chunk.
        by_last = np.zeros(n_moving)
        conditional = ConditionalFilter(problem, smoothing, filtered, segment)
        for timeline, about, motion, before, forward_pass in conditional.backward():
            by_transition, by_rows = np.zeros(motion.transition.shape), np.zeros(motion.rows.shape)
            scratch = np.zeros((n_moving + adjoint.root.shape[1], n_moving))
            variance = problem.sensors.variance[timeline.measurement_sensor] / forward_pass.weight
            _backward_pass(timeline, motion, forward_pass, adjoint, before, variance, by_transition, by_rows, scratch)
            nominal = columns(timeline, about)
            # A measurement depends on the state at its event, a transition on that at the previous one.
            measured_at = 1 + np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
            by_states = np.zeros((1 + timeline.time.size, n_moving))
            by_states[-1] = by_last
            sample = TransitionSample.of(timeline, _TRANSITION_INTERVAL if faults is None else 0.0)
            by_sample, shifted = sample.sums(by_transition), _empty_like(about)
            for state in range(n_moving):
                _linearise_shifted(problem, data, timeline, sample.timeline, about, state, shifted, work)
                effects = columns(timeline, shifted)
                difference = effects.on_states[sample.events] - nominal.on_states[sample.events]
                by_process = np.einsum("ki,kij->kj", by_sample[..., state], difference)
                difference = effects.on_measurements - nominal.on_measurements
                by_sensors = np.einsum("kc,kcj->kj", by_rows[..., state], difference)
                total += by_process.sum(axis=0) + by_sensors.sum(axis=0)
                by_states[sample.events] += by_process[:, n:n_states]
                np.add.at(by_states, measured_at, by_sensors[:, n:n_states])
            moving[-1].append(scale * by_states[1:])
            by_last = by_states[0]
        moving[-1].reverse()
        initial.append(scale * by_last)
    total *= scale
    return Trajectory(total[:n], initial, moving), total[n_states:]


def _empty_like(about: Linearised) -> Linearised:
    """Return a linearised chunk about the same parameters, with arrays of its own."""
    return Linearised(about.parameters, *(np.zeros_like(array) for array in about[1:]))


def _linearise_shifted(
    problem: JointProblem,
    data: ModelData,
    timeline: Timeline,
    sample: Timeline,
    about: Linearised,
    state: int,
    shifted: Linearised,
    work: SmootherWorkspace,
) -> None:
    """Linearise a chunk, and its process at a sample, about the trajectory with one state shifted by `_STATE_STEP`."""
    shift = np.zeros(problem.n_moving)
    shift[state] = _STATE_STEP
    np.add(about.before, shift, out=shifted.before)
    np.add(about.moving, shift, out=shifted.moving)
    linearise_process(problem.process.transition, data, sample, shifted, work)
    linearise_measurements(problem.process.linearise, data, timeline, shifted, work)


@compiled(
    types.void(TIMELINE, LINEARISED, FORWARD_PASS, ADJOINT, _matrix, _matrix, _stack, _stack, _matrix), reassociate=True
)
def _backward_pass(timeline, motion, forward_pass, adjoint, before, variance, by_transition, by_rows, scratch):
    """Carry the adjoint back over a chunk; fill in the gradient of half the sum of logarithms.

    Parameters
    ----------
    timeline, motion, forward_pass
        Forward pass of the motion given the parameters.
    adjoint : Adjoint
        After the chunk; afterwards before it.
    before : ndarray, shape (n, n)
        Covariance before the chunk.
    variance : ndarray, shape (n_measurements, c)
        Variance of the measurement noise.
    by_transition, by_rows : ndarray, shape as of `transition` and `rows`
        Filled in: ``Lambda F P`` and ``h P (I - Lambda P) / r``; zero without substeps and if missing.
    scratch : ndarray, shape (n + columns of the adjoint's root, n)
    """
    n, root = before.shape[0], adjoint.root
    moved, projected = scratch[:n], scratch[n:]
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        n_columns = adjoint.n_columns[0]
        covariance = forward_pass.covariance[event]
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            for c in range(motion.residual.shape[1]):
                if np.isnan(motion.residual[k, c]):
                    continue
                row, gain, reduction, result = motion.rows[k, c], moved[0], moved[1], by_rows[k, c]
                for i in range(n):
                    gain[i] = 0.0
                    for j in range(n):
                        gain[i] += covariance[i, j] * row[j]
                    reduction[i] = 0.0
                for column in range(n_columns):
                    product = 0.0
                    for i in range(n):
                        product += root[i, column] * gain[i]
                    for i in range(n):
                        reduction[i] += product * root[i, column]
                for i in range(n):
                    total = gain[i]
                    for j in range(n):
                        total -= covariance[i, j] * reduction[j]
                    result[i] = total / variance[k, c]
        adjoint_update(event, timeline, motion, forward_pass, adjoint, variance[:0], variance[:0])
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            n_columns = adjoint.n_columns[0]
            transition = motion.transition[event]
            covariance = forward_pass.covariance[event - 1] if event > 0 else before
            for i in range(n):
                for j in range(n):
                    moved[i, j] = 0.0
                    for m in range(n):
                        moved[i, j] += transition[i, m] * covariance[m, j]
            for column in range(n_columns):
                for j in range(n):
                    projected[column, j] = 0.0
                    for i in range(n):
                        projected[column, j] += root[i, column] * moved[i, j]
            for i in range(n):
                for j in range(n):
                    for column in range(n_columns):
                        by_transition[event, i, j] += root[i, column] * projected[column, j]
            adjoint_predict(transition, 0, adjoint)
