"""Many candidates for what a model lacks, by their score tests: what each would gain by itself, and which are alike.

Score ``s`` and information ``J``, parameters projected out, are those of a linear regression: about the smoother's
answer the log-likelihood gains ``s_k^2 / (2 J_kk)`` if candidate k enters the model.
"""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.problem import FaultScores

Array = NDArray[np.float64]


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


def explained(scores: FaultScores, covariance: Array) -> Array:
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
