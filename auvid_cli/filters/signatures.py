"""Signatures: change of the innovations of a smoother's forward pass per unit of a parameter or of a fault.

Two forward passes have innovations. In that of the joint state (`fault_signatures`), parameters adapt to a fault, and
the signature is what is left of its effect. In that of the motion given the parameters (`Signatures`), only the motion
adapts. The adaptation of the parameters then follows from the signatures of the parameters themselves.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.filters.autocorrelation import ResidualRows, cached
from auvid_cli.filters.linear_smoother import ConditionalFilter, Filtered, LinearSmoothing
from auvid_cli.filters.problem import TIMELINE, JointProblem, Timeline
from auvid_cli.filters.smoother_forward import FORWARD_PASS, LINEARISED, ForwardPass, Linearised
from auvid_cli.numerics import compiled, types

_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]


class FaultEffects(NamedTuple):
    """Direct effects of faults on a chunk of the data, per unit of each fault."""

    on_states: Array  # shape (n_events, n_moving, n_faults); on the moving states since the previous event
    on_measurements: Array  # shape (n_measurements, c, n_faults); on the measurements


class FaultSignatures(NamedTuple):
    """Signatures of faults in the innovations of a chunk."""

    timeline: Timeline
    forward_pass: ForwardPass
    effect: Array  # shape (n_measurements, c, n_faults); effect on each innovation per unit of each fault
    present: NDArray[np.bool_]  # shape (n_measurements, c); whether it was measured

    def normalised(self) -> Array:
        """Return the effects in standard deviations of the innovations, shape (m, n_faults)."""
        return self.effect[self.present] / np.sqrt(self.forward_pass.total[self.present])[:, None]


class Faults(Protocol):
    """Possible faults of a model or its data."""

    @property
    def labels(self) -> tuple[Any, ...]:
        """Identity of each fault."""
        ...

    def effects(self, segment: int, timeline: Timeline, about: Linearised) -> FaultEffects:
        """Return the effects on a chunk of a segment, linearised about a trajectory."""
        ...


_EFFECTS = types.NamedUniTuple(_stack, 2, FaultEffects)


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, _EFFECTS, _matrix, _matrix), reassociate=True)
def carry_errors(timeline, about, forward_pass, effects, error, moved):
    """Propagate the errors of the filtered state that faults cause through a chunk.

    Parameters
    ----------
    timeline, about, forward_pass
        Events of the chunk, its trajectory, and its forward pass.
    effects : FaultEffects
        `on_measurements` is replaced by the effects on innovations; zero if missing.
    error : ndarray, shape (n, n_faults)
        Error of the state per unit of each fault, before the chunk; afterwards at its end.
    moved : ndarray, shape (n_moving, n_faults)
        Scratch.
    """
    n, n_faults = error.shape
    n_moving = moved.shape[0]
    n_parameters = n - n_moving
    for event in range(timeline.time.size):
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                for f in range(n_faults):
                    moved[i, f] = effects.on_states[event, i, f]
                for j in range(n):
                    rate = about.transition[event, i, j]
                    for f in range(n_faults):
                        moved[i, f] += rate * error[j, f]
            for i in range(n_moving):
                for f in range(n_faults):
                    error[n_parameters + i, f] = moved[i, f]
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            for c in range(about.residual.shape[1]):
                effect = effects.on_measurements[k, c]
                if np.isnan(about.residual[k, c]):
                    for f in range(n_faults):
                        effect[f] = 0.0
                    continue
                for j in range(n):
                    h = about.rows[k, c, j]
                    if h != 0.0:
                        for f in range(n_faults):
                            effect[f] += h * error[j, f]
                # Divided outside of the loop below, which would repeat the division.
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
    initial: Sequence[Array] = (),
) -> Iterator[FaultSignatures]:
    """Yield the signatures of faults in the innovations, chunk by chunk; `effects` as `Faults.effects`.

    `initial` holds effects on the initial moving states of each segment, shape (n_moving, n_faults), if there are any.
    """
    n_parameters, n_moving = filtered.trajectory.parameters.size, filtered.trajectory.initial[0].size
    error, moved = np.zeros((n_parameters + n_moving, n_faults)), np.zeros((n_moving, n_faults))
    last_segment = -1
    for segment, timeline, about, forward_pass in smoothing.forward_passes(filtered):
        if segment > last_segment:
            # The error of the initial motion depends on that of the parameters.
            error[n_parameters:] = filtered.by_parameters[segment] @ error[:n_parameters]
            if initial:
                error[n_parameters:] += initial[segment]
            last_segment = segment
        of_chunk = effects(segment, timeline, about)
        carry_errors(timeline, about, forward_pass, of_chunk, error, moved)
        yield FaultSignatures(timeline, forward_pass, of_chunk.on_measurements, ~np.isnan(about.residual))


class Signatures:
    """Signatures of the parameters and of faults in the innovations of the motion given the parameters.

    From these rows follow the scores of all faults and the influence of each measurement.

    Parameters
    ----------
    problem : JointProblem
    smoothing : LinearSmoothing
    filtered : Filtered
        At the estimate.
    faults : Faults, optional
    """

    def __init__(
        self, problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered, faults: Faults | None = None
    ) -> None:
        self.problem, self.smoothing, self.filtered, self.faults = problem, smoothing, filtered, faults
        n = problem.n_parameters
        self.covariance = filtered.final.covariance()[:n, :n]
        """Covariance of the parameters."""
        segments = [_SegmentSignatures(problem, smoothing, filtered, faults, k) for k in range(len(problem.segments))]
        self._segments = cached(segments, [len(before) for before in filtered.before])

    @property
    def labels(self) -> tuple[Any, ...]:
        """Identity of each fault."""
        return () if self.faults is None else self.faults.labels

    def scores(self) -> tuple[Array, Array, Array]:
        """Return sums over all measurements: signatures of the faults times residuals, and products of signatures.

        Returns
        -------
        score : ndarray, shape (n_faults,)
        shared : ndarray, shape (n_parameters, n_faults)
            Products of signatures of parameters and faults.
        information : ndarray, shape (n_faults, n_faults)
            Products of signatures of faults.
        """
        n, n_faults = self.problem.n_parameters, len(self.labels)
        score, products = np.zeros(n_faults), np.zeros((n + n_faults, n_faults))
        for segment in self._segments:
            for chunk in segment:
                of_faults = chunk.rows[:, n:].copy()
                score += chunk.residual @ of_faults
                products += chunk.rows.T @ of_faults
        return score, products[:n], products[n:]

    def influences(self, weights: Array | None = None) -> list[Iterable[ResidualRows]]:
        """Return combinations of the signatures by segment, by default the influences on the parameters.

        Parameters
        ----------
        weights : ndarray, shape (n_parameters + n_faults, n), optional
            Weight of each signature in each combination.
        """
        return [_Influences(segment, self.covariance if weights is None else weights) for segment in self._segments]


@dataclass(frozen=True)
class _SegmentSignatures:
    """Signatures in a segment, computed again in each iteration."""

    problem: JointProblem
    smoothing: LinearSmoothing
    filtered: Filtered
    faults: Faults | None
    segment: int

    def __iter__(self) -> Iterator[ResidualRows]:
        faults, n = self.faults, self.problem.n_parameters
        moved = np.empty((self.problem.n_moving, n + (0 if faults is None else len(faults.labels))))
        error = np.zeros(moved.shape)
        error[:, :n] = self.filtered.by_parameters[self.segment]
        conditional = ConditionalFilter(self.problem, self.smoothing, self.filtered, self.segment)
        for timeline, about, motion, _, forward_pass in conditional.forward():
            effects = FaultEffects(about.transition[..., :n].copy(), about.rows[..., :n].copy())
            if faults is not None:
                pairs = zip(effects, faults.effects(self.segment, timeline, about), strict=True)
                effects = FaultEffects(*(np.concatenate(pair, axis=-1) for pair in pairs))
            carry_errors(timeline, motion, forward_pass, effects, error, moved)
            deviation = np.sqrt(forward_pass.total)
            rows, residual = effects.on_measurements / deviation[..., None], forward_pass.error / deviation
            yield ResidualRows.of_present(timeline, ~np.isnan(motion.residual), residual, rows)


@dataclass(frozen=True)
class _Influences:
    """Combinations of the signatures of a segment."""

    signatures: Iterable[ResidualRows]
    weights: Array

    def __iter__(self) -> Iterator[ResidualRows]:
        return (chunk._replace(rows=chunk.rows @ self.weights) for chunk in self.signatures)
