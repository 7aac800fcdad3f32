"""Score tests of faults and of candidate terms: the fit of their signature to the residuals of a smoother."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing
from auvid_cli.filters.problem import TIMELINE, FaultScores, Timeline
from auvid_cli.filters.smoother_forward import FORWARD_PASS, LINEARISED, Linearised

Array = NDArray[np.float64]
_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]


class FaultEffects(NamedTuple):
    """What faults do to a chunk of the data, per unit of each.

    Attributes
    ----------
    pushed : ndarray, shape (n_events, n_moving, n_faults)
        To the moving states between the event before and an event.
    added : ndarray, shape (n_measurements, c, n_faults)
        To what is measured; overwritten.
    """

    on_states: Array
    on_measurements: Array


class FaultSignatures(NamedTuple):
    """What innovations show of faults in a chunk of the data.

    Attributes
    ----------
    shown : ndarray, shape (m, n_faults)
        In each innovation, by its standard deviation, per unit of each fault.
    innovation : ndarray, shape (m,)
        Itself, by its standard deviation.
    error : ndarray, shape (n, n_faults)
        Of the state after the chunk; the next one overwrites it.
    """

    shown: Array
    innovation: Array
    error: Array


class Faults(Protocol):
    """What may be wrong with a model or its data."""

    @property
    def labels(self) -> tuple[Any, ...]:
        """Return the identity of each fault."""
        ...

    def effects(self, segment: int, timeline: Timeline, about: Linearised) -> FaultEffects:
        """Say what they do to a chunk of a segment, along a trajectory."""
        ...


_EFFECTS = types.NamedUniTuple(_stack, 2, FaultEffects)


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, _EFFECTS, _matrix, _matrix), reassociate=True)
def carry_errors(timeline, about, forward_pass, effects, error, moved):
    """Carry the errors that faults make through a chunk of the data.

    Parameters
    ----------
    timeline, about, forward_pass
        Of the chunk.
    effects : FaultEffects
        What is added to measurements becomes what that and the errors before do to their innovations; zero where
        missing.
    error : ndarray, shape (n, n_faults)
        Of the state, per unit of each fault: before the chunk, and afterwards at its end.
    moved : ndarray, shape (n_moving, n_faults)
        Overwritten.
    """
    n, n_faults = error.shape
    n_moving = moved.shape[0]
    n_parameters = n - n_moving
    for event in range(timeline.time.size):
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                for f in range(n_faults):
                    moved[i, f] = effects.pushed[event, i, f]
                for j in range(n):
                    rate = about.transition[event, i, j]
                    for f in range(n_faults):
                        moved[i, f] += rate * error[j, f]
            for i in range(n_moving):
                for f in range(n_faults):
                    error[n_parameters + i, f] = moved[i, f]
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            for c in range(about.residual.shape[1]):
                effect = effects.added[k, c]
                if np.isnan(about.residual[k, c]):
                    for f in range(n_faults):
                        effect[f] = 0.0
                    continue
                for j in range(n):
                    h = about.rows[k, c, j]
                    if h != 0.0:
                        for f in range(n_faults):
                            effect[f] += h * error[j, f]
                # Divided once, here: a quotient in the loop below would be divided at every turn.
                by_variance = moved[0]
                for f in range(n_faults):
                    by_variance[f] = effect[f] / forward_pass.total[k, c]
                for j in range(n):
                    gain = forward_pass.gain[k, c, j]
                    for f in range(n_faults):
                        error[j, f] -= gain * by_variance[f]


def fault_signatures(
    smoothing: LinearSmoothing,
    filtered: Filtered,
    n_faults: int,
    effects: Callable[[int, Timeline, Linearised], FaultEffects],
) -> Iterator[FaultSignatures]:
    """Find what innovations show of faults, chunk by chunk.

    Parameters
    ----------
    smoothing : LinearSmoothing
    filtered : Filtered
    n_faults : int
    effects : callable
        As `Faults.effects`.
    """
    n_parameters, n_moving = filtered.trajectory.parameters.size, filtered.trajectory.initial[0].size
    error, moved = np.zeros((n_parameters + n_moving, n_faults)), np.zeros((n_moving, n_faults))
    started = -1
    for segment, timeline, about, forward_pass in smoothing.forward_passes(filtered):
        if segment > started:
            # The motion begins anew, as far off as what it owes to the parameters.
            error[n_parameters:] = filtered.by_parameters[segment] @ error[:n_parameters]
            started = segment
        of_chunk = effects(segment, timeline, about)
        carry_errors(timeline, about, forward_pass, of_chunk, error, moved)
        there = ~np.isnan(about.residual)
        deviation = np.sqrt(forward_pass.total[there])
        yield FaultSignatures(
            of_chunk.on_measurements[there] / deviation[:, None], forward_pass.error[there] / deviation, error
        )


def score_faults(smoothing: LinearSmoothing, filtered: Filtered, faults: Faults) -> FaultScores:
    """Find what the data say of faults.

    Parameters
    ----------
    smoothing : LinearSmoothing
    filtered : Filtered
        About the most probable trajectory.
    faults : Faults
    """
    n_faults, n_parameters = len(faults.labels), filtered.trajectory.parameters.size
    score, information = np.zeros(n_faults), np.zeros((n_faults, n_faults))
    effect = np.zeros((n_parameters, n_faults))
    for shown, innovation, error in fault_signatures(smoothing, filtered, n_faults, faults.effects):
        score += innovation @ shown
        information += shown.T @ shown
        effect = error[:n_parameters]
    return FaultScores(faults.labels, score, information, effect)


def gains(scores: FaultScores) -> Array:
    """Return by how much each raises the log-likelihood, shape (n,); 0 where nothing shows it.

    Parameters
    ----------
    scores : FaultScores
    """
    told = np.diagonal(scores.information)
    return np.divide(scores.score**2, 2.0 * told, out=np.zeros_like(scores.score), where=told > 0.0)


def sizes(scores: FaultScores) -> tuple[Array, Array]:
    """Return the likeliest size of each by itself, and its standard deviation, shape (n,) each; 0 +- inf if not shown.

    Parameters
    ----------
    scores : FaultScores
    """
    told = np.diagonal(scores.information)
    variance = np.divide(1.0, told, out=np.full_like(scores.score, np.inf), where=told > 0.0)
    return np.where(told > 0.0, scores.score, 0.0) / np.where(told > 0.0, told, 1.0), np.sqrt(variance)


def correlation(scores: FaultScores, candidate: int) -> Array:
    """Return how alike others are to a candidate in what the parameters leave of both, from -1 to 1, shape (n,).

    Parameters
    ----------
    scores : FaultScores
    candidate : int
    """
    told = np.sqrt(np.diagonal(scores.information))
    both = told * told[candidate]
    return np.divide(scores.information[candidate], both, out=np.zeros_like(told), where=both > 0.0)


def fraction_explained(scores: FaultScores, covariance: Array) -> Array:
    """Return which share of what each would do to the data the parameters make up for, shape (n,), from 0 to 1.

    Parameters
    ----------
    scores : FaultScores
    covariance : ndarray, shape (n_parameters, n_parameters)
        Of the parameters.
    """
    made_up = np.einsum("pk,pk->k", scores.effect, np.linalg.solve(covariance, scores.effect))
    told = np.diagonal(scores.information)
    total = made_up + told
    return np.divide(made_up, total, out=np.ones_like(told), where=total > 0.0)
