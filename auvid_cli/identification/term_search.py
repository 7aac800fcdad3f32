"""Terms that a model lacks, found in what a smoother's fit leaves of the data."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.errors import DataError
from auvid_cli.filters.candidate_scores import CandidateScores, score_candidates
from auvid_cli.filters.linear_smoothing import LinearSmoothing
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.smoother import most_probable
from auvid_cli.identification.augmented import augmented_problem
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.faults import missing_term
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.vehicle.coefficients import Coefficient

Array = NDArray[np.float64]


class ScoredTerms(NamedTuple):
    """What a smoother's fit says of terms that its model lacks.

    Attributes
    ----------
    terms : tuple of Coefficient
    scores : CandidateScores
    explained : ndarray, shape (n,)
        Share of what each does to the data that the coefficients make up for.
    """

    terms: tuple[Coefficient, ...]
    scores: CandidateScores
    explained: Array


def score_terms(prepared: PreparedData, terms: tuple[Coefficient, ...]) -> ScoredTerms:
    """Fit the smoother, and find what its innovations say of terms; no truth is looked at.

    Parameters
    ----------
    prepared : PreparedData
    terms : tuple of Coefficient

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    DataError
        If the smoother does not settle on these data.
    """
    augmented = augmented_problem(prepared)
    segments = [segment.timelines for segment in augmented.segments]
    problem = JointProblem(augmented.process, augmented.sensors, segments, augmented.prior)
    smoothing = LinearSmoothing(problem)
    answers = most_probable(problem, smoothing, prepared.experiment.identification.smoother.max_passes)
    if not answers or not answers[0][1]:
        raise DataError(
            "the smoother does not settle on these data, so nothing can be said of what its model lacks: see auvid "
            "identify --filter smoother"
        )
    (best, _), *_ = answers
    candidates = VehicleFaults(augmented, tested=[missing_term(term) for term in terms])
    scores = score_candidates(smoothing, best, candidates)
    n = problem.n_parameters
    return ScoredTerms(terms, scores, scores.explained(best.final.covariance()[:n, :n]))
