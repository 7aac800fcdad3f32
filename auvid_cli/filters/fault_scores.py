"""Score tests of faults and candidate terms, from their signatures in the innovations of a smoother.

With the signature s_k of a fault of unit size in the innovation e_k, both normalised, the score is ``sum(s_k e_k)``.
The information is ``sum(s_k^2)`` less what the parameters take of it when they adapt, and the maximum-likelihood
estimate of the size is score / information (Willsky and Jones, IEEE Trans. Autom. Control 21(1), 1976). No refit is
needed.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.filters.problem import FaultScores
from auvid_cli.filters.signatures import Signatures

# Share of a fault's information below which it is confounded with others.
_CONFOUNDED = 1e-3
_ROUNDING = 1e-12
# Share of a fault's effect on the data that parameters do not compensate, below which it is a rounding error.
_UNOBSERVABLE = 1e-6
_MOST_NEEDED = 8
# Smallest significance of an alternative, as a share of that of the fault that it replaces; and the largest that is
# left of that fault.
_MIN_SHARE = 0.5


def score_faults(signatures: Signatures) -> FaultScores:
    """Return the scores of faults about the most probable trajectory.

    With the products ``J_pf`` of the signatures of parameters and faults, and ``J_ff`` of faults and faults, parameters
    of the covariance P move by ``-P J_pf`` per unit of each fault, and leave the information ``J_ff - J_fp P J_pf``.
    """
    score, shared, products = signatures.scores()
    effect = -signatures.covariance @ shared
    information = products + shared.T @ effect
    # Parameters compensate some faults completely; the rest is the rounding of the effects.
    hidden = np.diagonal(information) <= _UNOBSERVABLE * np.diagonal(products)
    score[hidden], information[hidden], information[:, hidden] = 0.0, 0.0, 0.0
    return FaultScores(signatures.labels, score, information, effect)


class NeededFault(NamedTuple):
    """Fault that is needed to explain the data."""

    place: int
    size: float  # together with the other needed faults
    likely_size: float  # the same with the tolerance as prior
    alternatives: tuple[int, ...]  # faults that explain the data as well in its place


class _Conditional(NamedTuple):
    """Score of each fault given others, its information and variance, and the increase of the log-likelihood."""

    score: Array
    information: Array
    variance: Array
    gain: Array


def _conditional(
    scores: FaultScores, variance: Array, free: list[int], places: Iterable[int] | None = None
) -> _Conditional:
    """Return the scores of each fault if all others of a positive prior `variance`, and those `free`, are estimated.

    Only those of the faults at `places` are valid, if it is given.
    """
    known = np.flatnonzero(variance > 0.0)
    precision = np.divide(1.0, variance, out=np.zeros_like(variance), where=variance > 0.0)
    precision[free] = 0.0
    score, information = scores.score.copy(), np.diagonal(scores.information).copy()
    inflation = scores.inflation if scores.inflation.size else np.ones_like(score)
    excess = scores.information * (np.outer(inflation, inflation) - 1.0)
    variance = information + np.diagonal(excess)
    for f in range(score.size) if places is None else places:
        others = np.union1d(known, np.array(free, dtype=np.int64))
        others = others[(others != f) & (np.diagonal(scores.information)[others] > 0.0)]
        if others.size:
            own = scores.information[np.ix_(others, others)] + np.diag(precision[others])
            # Normalised, because the units differ.
            root = np.sqrt(np.diagonal(own))
            matrix = own / np.outer(root, root) + _ROUNDING * np.eye(root.size)
            taken = np.linalg.solve(matrix, scores.information[others, f] / root) / root
            score[f] -= taken @ scores.score[others]
            information[f] -= taken @ scores.information[others, f]
            weights = np.append(1.0, -taken)
            own_and_others = np.append(f, others)
            variance[f] = information[f] + weights @ excess[np.ix_(own_and_others, own_and_others)] @ weights
    seen = information > _CONFOUNDED * np.diagonal(scores.information)
    whole = np.where(seen, information + precision, np.inf)
    # Autocorrelated residuals do not add information.
    variance = np.maximum(variance, information)
    return _Conditional(np.where(seen, score, 0.0), np.where(seen, information, 0.0), variance, 0.5 * score**2 / whole)


def second_moments(scores: FaultScores, tolerance: Array) -> Array:
    """Return the second moments of the sizes of faults given the data, shape (n, n).

    With the score y and the information J, sizes of the prior covariance S have the covariance ``C = (S^-1 + J)^-1``
    and the mean ``C y``, and thus the second moment ``C + C y y' C``. Autocorrelated residuals reduce the information
    in each direction by the factor by which they increase the variance of the score.

    Parameters
    ----------
    scores : FaultScores
    tolerance : ndarray, shape (n,)
        Standard deviation of each fault before any data; 0 for a fault that is not considered.
    """
    inflation = scores.inflation if scores.inflation.size else np.ones_like(tolerance)
    normalised = tolerance[:, None] * scores.information * tolerance
    known, directions = np.linalg.eigh(0.5 * (normalised + normalised.T))
    known = np.where(known > _ROUNDING * known.max(initial=0.0), known, 0.0)
    inflated = inflation[:, None] * directions
    variance = np.einsum("ki,kl,li->i", inflated, normalised, inflated)
    kept = np.divide(known, variance, out=np.ones_like(known), where=variance > known)
    left = 1.0 / (1.0 + kept * known)
    mean = directions @ (left * kept * (directions.T @ (tolerance * scores.score)))
    moments = (directions * left) @ directions.T + np.outer(mean, mean)
    return tolerance[:, None] * moments * tolerance


def most_likely_sizes(scores: FaultScores, tolerance: Array) -> Array:
    """Return the most likely sizes of all faults together, with their tolerances as prior, shape (n_faults,).

    Parameters
    ----------
    scores : FaultScores
    tolerance : ndarray, shape (n_faults,)
        Standard deviation of each fault before any data; the size of one without tolerance is 0.
    """
    matrix = np.eye(tolerance.size) + tolerance[:, None] * scores.information * tolerance
    return tolerance * np.asarray(np.linalg.solve(matrix, tolerance * scores.score), dtype=np.float64)


def significances(
    scores: FaultScores, tolerance: Array, free: Sequence[int] = (), places: Iterable[int] | None = None
) -> Array:
    """Return the size of each fault in the standard deviation that data and tolerances allow, shape (n,).

    Parameters
    ----------
    scores : FaultScores
    tolerance : ndarray, shape (n,)
        Standard deviation of each fault before any data; 0 for a fault that is not expected.
    free : sequence of int
        Faults that are estimated, whatever their size.
    places : iterable of int, optional
        Faults whose significance is needed; that of the others is not valid.
    """
    score, information, variance, _ = _conditional(scores, tolerance**2, [*free], places)
    seen = np.where(information > 0.0, information, np.inf)
    size, deviation = score / seen, np.hypot(np.sqrt(variance) / seen, tolerance)
    result = np.divide(np.abs(size), deviation, out=np.zeros_like(size), where=deviation > 0.0)
    result[[*free]] = 0.0
    return result


def needed_faults(scores: FaultScores, tolerance: Array, limit: float) -> list[NeededFault]:
    """Return the faults that are needed to explain the data beyond the tolerances, the most significant first."""
    found = list[int]()
    while len(found) < _MOST_NEEDED:
        significance = significances(scores, tolerance, found)
        gain = np.where(significance > limit, _conditional(scores, tolerance**2, found).gain, -np.inf)
        if not (significance > limit).any():
            break
        found.append(int(gain.argmax()))
    # Later faults may explain the data of earlier ones.
    while found:
        significance = [_significance_of(scores, tolerance, f, [g for g in found if g != f]) for f in found]
        if min(significance) > limit:
            break
        del found[int(np.argmin(significance))]
    needed = []
    for f in found:
        others = [other for other in found if other != f]
        # A significant fault has information.
        score, information, variance, _ = (
            float(of_all[f]) for of_all in _conditional(scores, tolerance**2, others, [f])
        )
        size, prior = score / information, float(tolerance[f]) ** 2
        likely = size * prior / (prior + variance / information**2) if prior > 0.0 else size
        needed.append(NeededFault(f, size, likely, _alternatives(scores, tolerance, limit, f, others)))
    return needed


def _alternatives(scores: FaultScores, tolerance: Array, limit: float, f: int, others: list[int]) -> tuple[int, ...]:
    """Return the faults that the data cannot tell from f: with one of them instead, f is not needed."""
    significance = significances(scores, tolerance, others)
    enough, most = significance >= _MIN_SHARE * significance[f], min(limit, _MIN_SHARE * float(significance[f]))
    return tuple(
        int(g)
        for g in np.flatnonzero(enough)
        if g != f and _significance_of(scores, tolerance, f, [*others, int(g)]) <= most
    )


def _significance_of(scores: FaultScores, tolerance: Array, f: int, free: list[int]) -> float:
    return float(significances(scores, tolerance, free, [f])[f])


def gains(scores: FaultScores) -> Array:
    """Return the increase of the log-likelihood by each fault alone, shape (n,); 0 for an unobservable one."""
    information = np.diagonal(scores.information)
    gain = np.zeros_like(scores.score)
    return np.divide(scores.score**2, 2.0 * information, out=gain, where=information > 0.0)


def sizes(scores: FaultScores) -> tuple[Array, Array]:
    """Return the estimate of each fault alone and its standard deviation, shape (n,); 0 and inf if unobservable."""
    information = np.diagonal(scores.information)
    shown = information > 0.0
    variance = np.divide(1.0, information, out=np.full_like(scores.score, np.inf), where=shown)
    return np.where(shown, scores.score, 0.0) / np.where(shown, information, 1.0), np.sqrt(variance)


def correlation(scores: FaultScores, candidate: int) -> Array:
    """Return the correlation of the signatures of all faults with that of a candidate, shape (n,)."""
    root = np.sqrt(np.diagonal(scores.information))
    product = root * root[candidate]
    return np.divide(scores.information[candidate], product, out=np.zeros_like(root), where=product > 0.0)


def fraction_explained(scores: FaultScores, covariance: Array) -> Array:
    """Return the fraction of each fault's effect on the data that the parameters compensate, shape (n,), from 0 to 1.

    Parameters
    ----------
    scores : FaultScores
    covariance : ndarray, shape (n_parameters, n_parameters)
        Covariance of the parameters.
    """
    compensated = np.einsum("pk,pk->k", scores.effect, np.linalg.solve(covariance, scores.effect))
    information = np.diagonal(scores.information)
    total = compensated + information
    return np.divide(compensated, total, out=np.ones_like(information), where=total > 0.0)
