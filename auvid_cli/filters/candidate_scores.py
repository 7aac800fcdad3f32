"""Score tests of many candidates together: what each would gain, and what it would still gain beside those taken.

The score ``s`` and information ``J`` of all candidates, parameters projected out, are those of a linear regression;
about the smoother's answer the log-likelihood gains ``s' J^-1 s / 2`` if all of them enter the model.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.fault_scores import Faults, shown_faults
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing

Array = NDArray[np.float64]

# What is left of a candidate beside those taken, as a share of its information, for it to be told from these at all.
_LEFT = 1e-6


class CandidateScores(NamedTuple):
    """What the data say of candidates together.

    Attributes
    ----------
    score : ndarray, shape (n,)
    information : ndarray, shape (n, n)
    effect : ndarray, shape (n_parameters, n)
        True parameters less those found, per unit of each.
    """

    score: Array
    information: Array
    effect: Array

    def gains(self, taken: list[int]) -> Array:
        """Return by how much each raises the log-likelihood beside those taken, shape (n,); 0 if it is one of them.

        Parameters
        ----------
        taken : list of int
        """
        score, left = self.score.copy(), np.diagonal(self.information).copy()
        told = left.copy()
        if taken:
            shares = np.linalg.solve(self.information[np.ix_(taken, taken)], self.information[taken])
            score -= shares.T @ score[taken]
            left -= np.einsum("tk,tk->k", shares, self.information[taken])
        apart = left > _LEFT * told
        return np.where(apart, score**2 / np.where(apart, 2.0 * left, 1.0), 0.0)

    def sizes(self, taken: list[int]) -> tuple[Array, Array]:
        """Return the sizes of those taken that are most likely together, and their standard deviations."""
        inverse = np.linalg.inv(self.information[np.ix_(taken, taken)])
        return inverse @ self.score[taken], np.sqrt(np.diagonal(inverse))

    def correlation(self, candidate: int) -> Array:
        """Return how alike others are to a candidate in what the parameters leave of both, from -1 to 1, shape (n,)."""
        told = np.sqrt(np.diagonal(self.information))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.nan_to_num(self.information[candidate] / (told * told[candidate]))

    def explained(self, covariance: Array) -> Array:
        """Return which share of what each would do to the data the parameters make up for, shape (n,), from 0 to 1.

        Parameters
        ----------
        covariance : ndarray, shape (n_parameters, n_parameters)
            Of the parameters.
        """
        made_up = np.einsum("pk,pk->k", self.effect, np.linalg.solve(covariance, self.effect))
        told = np.diagonal(self.information)
        total = made_up + told
        return np.divide(made_up, total, out=np.ones_like(told), where=total > 0.0)


def score_candidates(smoothing: LinearSmoothing, filtered: Filtered, candidates: Faults) -> CandidateScores:
    """Find what the data say of candidates together.

    Parameters
    ----------
    smoothing : LinearSmoothing
    filtered : Filtered
        About the most probable trajectory.
    candidates : Faults
    """
    n, n_parameters = len(candidates.names), filtered.trajectory.parameters.size
    score, information, effect = np.zeros(n), np.zeros((n, n)), np.zeros((n_parameters, n))
    for shown, innovation, error in shown_faults(smoothing, filtered, n, candidates.effects):
        score += innovation @ shown
        information += shown.T @ shown
        effect = error[:n_parameters]
    return CandidateScores(score, information, effect)
