"""Gradient of the log-determinant in the marginal posterior, and its effect on parameters and fault scores.

Minus twice the log of the marginal posterior has the sum of the logarithms of the innovations' variances given the
parameters. The gradient of that sum is computed by one backward pass and difference quotients of the linearised
process; adjoint equations give its effect on parameters and fault scores.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array, ArrayStore
from auvid_cli.filters.fault_scores import score_faults
from auvid_cli.filters.linear_smoother import (
    ConditionalFilter,
    Filtered,
    LinearSmoothing,
    Trajectory,
    computed_ahead,
)
from auvid_cli.filters.problem import TIMELINE, FaultScores, JointProblem, ModelData, Timeline
from auvid_cli.filters.signatures import FaultEffects, Faults, Signatures
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
# s; interval of the transitions whose derivatives represent all, because the motion changes slowly. In a field survey
# and in spirals of LAUV and REMUS 100, coefficients shift by less than a hundredth of their standard deviation.
_TRANSITION_INTERVAL = 0.5
# Largest number of these transitions.
_MOST_TRANSITIONS = 10_000


def marginal_step(problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered) -> Array:
    """Return the step of the parameters from the joint to the marginal estimate, shape (n_parameters,)."""
    gradient, _ = _gradients(problem, smoothing, filtered, None)
    return -0.5 * apply_gradient(smoothing, filtered, gradient).parameters


def marginal_scores(signatures: Signatures) -> FaultScores:
    """Return the scores of faults about a marginal estimate.

    The sum of logarithms depends on a fault directly, and through the parameters and the motion that adapt to it: the
    scale error of a velocity sensor, for example, changes the velocity and thus all damping.
    """
    scores, faults = score_faults(signatures), signatures.faults
    assert faults is not None, "only faults have scores"
    gradient, by_faults = _gradients(signatures.problem, signatures.smoothing, signatures.filtered, faults)
    by_estimate = gradient_scores(signatures.smoothing, signatures.filtered, gradient, faults)
    return scores._replace(score=scores.score - 0.5 * (by_faults + by_estimate))


def _gradients(
    problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered, faults: Faults | None
) -> tuple[Trajectory, Array]:
    """Return the gradients of the sum of logarithms by parameters and motion, and by faults."""
    n, n_moving = problem.n_parameters, problem.n_moving
    n_states = n + n_moving
    total = np.zeros(n_states + (0 if faults is None else len(faults.labels)))
    initial, moving, scale = list[Array](), list[ArrayStore](), 2.0 / _STATE_STEP
    duration = sum(next(iter(reversed(data))).time[-1] - next(iter(data)).time[0] for data in problem.segments)
    interval = max(_TRANSITION_INTERVAL, duration / _MOST_TRANSITIONS)
    for segment in range(len(problem.segments)):

        def columns(timeline: Timeline, about: Linearised, segment: int = segment) -> tuple[FaultEffects, ...]:
            """Return the effects of parameters and moving states on a chunk, and those of faults."""
            of_states = FaultEffects(about.transition, about.rows)
            return (of_states,) if faults is None else (of_states, faults.effects(segment, timeline, about))

        adjoint = Adjoint.zeros(n_moving, with_variance=True)
        moving.append(ArrayStore())
        # Gradient by the state before the chunk that was processed last, which is later in time.
        by_last = np.zeros(n_moving)
        conditional = ConditionalFilter(problem, smoothing, filtered, segment)
        for timeline, about, motion, before, forward_pass in conditional.backward():
            by_transition, by_rows = np.zeros(motion.transition.shape), np.zeros(motion.rows.shape)
            scratch = np.zeros((n_moving + adjoint.root.shape[1], n_moving))
            variance = problem.sensors.variance[timeline.measurement_sensor] / forward_pass.weight
            _backward_pass(timeline, motion, forward_pass, adjoint, before, variance, by_transition, by_rows, scratch)
            # A measurement depends on the state at its event, a transition on that at the previous one.
            measured_at = 1 + np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
            by_states = np.zeros((1 + timeline.time.size, n_moving))
            by_states[-1] = by_last
            sample = TransitionSample.of(timeline, interval)
            nominal = columns(sample.timeline, about)
            by_sample = sample.sums(by_transition)
            shift = partial(_shifted, problem, timeline, sample.timeline, about)
            states = ((state,) for state in range(n_moving))
            for state, shifted in enumerate(computed_ahead(shift, states, filtered.trajectory)):
                derivatives = list[tuple[Array, Array]]()
                for effects, unshifted in zip(columns(sample.timeline, shifted), nominal, strict=True):
                    difference = effects.on_states[sample.events] - unshifted.on_states[sample.events]
                    by_process = np.einsum("ki,kij->kj", by_sample[..., state], difference)
                    difference = effects.on_measurements - unshifted.on_measurements
                    derivatives.append((by_process, np.einsum("kc,kcj->kj", by_rows[..., state], difference)))
                total += np.concatenate([process.sum(axis=0) + sensors.sum(axis=0) for process, sensors in derivatives])
                # The first pair is that of parameters and moving states.
                by_process, by_sensors = derivatives[0]
                by_states[sample.events] += by_process[:, n:]
                np.add.at(by_states, measured_at, by_sensors[:, n:])
            moving[-1].append(scale * by_states[1:])
            by_last = by_states[0]
        moving[-1].reverse()
        initial.append(scale * by_last)
    total *= scale
    return Trajectory(total[:n], initial, moving), total[n_states:]


def _shifted(problem: JointProblem, timeline: Timeline, sample: Timeline, about: Linearised, state: int) -> Linearised:
    """Linearise a chunk, and its process at a sample, about the trajectory with one state shifted by `_STATE_STEP`."""
    shift = np.zeros(problem.n_moving)
    shift[state] = _STATE_STEP
    empty = (np.zeros_like(array) for array in about[3:])
    shifted = Linearised(about.parameters, about.before + shift, about.moving + shift, *empty)
    data, (_, n_components, n) = ModelData.of(problem.process, problem.sensors), about.rows.shape
    work = SmootherWorkspace.of(problem.process, n, n_components)
    linearise_process(problem.process.transition, data, sample, shifted, work)
    linearise_measurements(problem.process.linearise, data, timeline, shifted, work)
    return shifted


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


class GradientResponse(NamedTuple):
    """Change of the estimate if a gradient is subtracted from half the cost."""

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
        Minus the effect on the filtered state before the chunk; afterwards at its end.
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
