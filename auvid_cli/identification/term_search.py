"""Terms that a model lacks: ranked by what a smoother's fit leaves of the data, accepted by data that are held out."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from auvid_cli.config.experiment import RunSettings, Use
from auvid_cli.config.spans import Spans
from auvid_cli.config.terms import Term
from auvid_cli.data.term_findings import ScoredTerm, TermFindings
from auvid_cli.errors import DataError
from auvid_cli.filters.candidate_scores import CandidateScores, score_candidates
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.smoother import most_probable
from auvid_cli.identification.augmented import AugmentedProblem, augmented_problem
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.faults import missing_term
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.term_library import admissible_terms, ahead

# Share of the data that is held out: the end of them.
HELD_OUT = 1.0 / 3.0
# Gain in log-likelihood that makes a term worth trying: of two hundred that are not there one in a hundred sets of data
# has one beyond it (chi-squared of one degree of freedom, 4.1 sigma).
LEAST_GAIN = 8.4
# And what it must gain where it was not fitted: e^3, or twenty to one, is usually called strong evidence (Kass and
# Raftery 1995).
LEAST_HELD_OUT_GAIN = 3.0
# Correlation beyond which two terms are hardly told apart, and how many of a look are told of.
_ALIKE, _TOLD = 0.95, 5


@dataclass(frozen=True)
class _Fit:
    """The smoother's answer to some data.

    Attributes
    ----------
    augmented : AugmentedProblem
    problem : JointProblem
    smoothing : LinearSmoothing
    answer : Filtered
    """

    augmented: AugmentedProblem
    problem: JointProblem
    smoothing: LinearSmoothing
    answer: Filtered

    @property
    def log_evidence(self) -> float:
        """Return the log-likelihood of the data whatever the coefficients and the motion, but for a constant."""
        return -0.5 * (self.answer.least + self.answer.log_determinant)

    def scores(self, terms: tuple[Coefficient, ...]) -> CandidateScores:
        """Find what the data say of terms beyond the model."""
        tested = [missing_term(term) for term in terms]
        return score_candidates(self.smoothing, self.answer, VehicleFaults(self.augmented, tested=tested))


def search_terms(
    prepared: PreparedData,
    any_symmetry: bool = False,
    most: int = 4,
    say: Callable[[str], None] = lambda text: None,
) -> TermFindings:
    """Look for terms that the model lacks; no truth is looked at.

    Again and again all candidates are scored beside the terms found so far; the best is added to the model, which is
    fitted anew. It is found if that makes the held-out data likelier: its Bayes factor there, with all that the fitted
    data say taken as known.

    Parameters
    ----------
    prepared : PreparedData
        Its end, a third, is held out.
    any_symmetry : bool
        See `admissible_terms`.
    most : int
        How many terms are tried.
    say : callable
        Called with what is being done.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    DataError
        If the smoother does not settle on these data without further terms.
    """
    fitted, held_out = split(prepared)
    settings, tried = prepared.experiment, list[ScoredTerm]()
    candidates = tuple(t for t in admissible_terms(any_symmetry) if _is_new(t, settings))
    n_candidates, looks, refused = len(candidates), 0, set[str]()

    def fit(of: RunSettings, spans: Spans) -> _Fit | None:
        return _fit(prepared.with_settings(_using(of, spans)))

    say("fit of the model as it is")
    here, whole = fit(settings, fitted), fit(settings, fitted + held_out)
    if here is None or whole is None:
        raise DataError(
            "the smoother does not settle on these data, so nothing can be said of what its model lacks: see auvid "
            "identify --filter smoother"
        )
    while looks < most:
        looks += 1
        say(f"look {looks}: {len(candidates)} terms")
        scores = here.scores(candidates)
        gains = scores.gains([])
        order = [k for k in np.argsort(-gains).tolist() if candidates[k].symbol not in refused]
        n = here.problem.n_parameters
        shares = scores.explained(here.answer.final.covariance()[:n, :n])
        best = order[0]
        held_out_gain, extended, found = None, settings, False
        if gains[best] >= LEAST_GAIN:
            say(f"look {looks}: fit with {candidates[best].symbol}")
            extended = with_term(settings, candidates[best])
            there, all_there = fit(extended, fitted), fit(extended, fitted + held_out)
            if there is not None and all_there is not None:
                before = whole.log_evidence - here.log_evidence
                held_out_gain = all_there.log_evidence - there.log_evidence - before
                found = held_out_gain >= LEAST_HELD_OUT_GAIN
                if found:
                    here, whole = there, all_there
        for k in order[:_TOLD]:
            size, deviation = scores.sizes([k])
            alike = np.abs(scores.correlation(k)) > _ALIKE
            names = [candidates[j].symbol for j in order if alike[j] and j != k]
            is_tried = k == best
            tried.append(
                ScoredTerm(
                    *(looks, candidates[k].symbol, candidates[k].unit, candidates[k].equation),
                    *(float(size[0]), float(deviation[0]), float(gains[k]), float(shares[k]), ", ".join(names[:_TOLD])),
                    *(held_out_gain if is_tried else None, found and is_tried),
                )
            )
        if gains[best] < LEAST_GAIN:
            break
        if found:
            settings = extended
            candidates = tuple(t for t in candidates if _is_new(t, settings))
        else:
            refused |= {candidates[best].symbol, *(candidates[j].symbol for j in order if _like(scores, best, j))}
    return TermFindings(tuple(tried), n_candidates, fitted, held_out, settings)


def split(prepared: PreparedData) -> tuple[Spans, Spans]:
    """Cut the segments of the data into what is fitted and what is held out, spans in s."""
    spans = [segment.timelines.span for segment in prepared.segments]
    left = (1.0 - HELD_OUT) * sum(end - begin for begin, end in spans)
    fitted, held_out = list[tuple[float, float]](), list[tuple[float, float]]()
    for begin, end in spans:
        cut = min(begin + max(left, 0.0), end)
        left -= end - begin
        if cut > begin:
            fitted.append((begin, cut))
        if cut < end:
            held_out.append((float(np.nextafter(cut, end)), end))
    return tuple(fitted), tuple(held_out)


def with_term(settings: RunSettings, term: Coefficient) -> RunSettings:
    """Return settings whose vehicle has one more term, to be estimated."""
    own = Term(name=term.symbol, row="XYZKMN"[term.row], factors=term.factors)  # pyright: ignore[reportArgumentType]
    vehicle, identification = settings.vehicle, settings.identification
    if identification.coefficients != "all":
        named = (*identification.coefficients, term.symbol)
        identification = identification.model_copy(update={"coefficients": named})
    vehicle = vehicle.model_copy(update={"terms": (*vehicle.terms, own)})
    return settings.model_copy(update={"vehicle": vehicle, "identification": identification})


def _like(scores: CandidateScores, one: int, other: int) -> bool:
    return bool(abs(scores.correlation(one)[other]) > _ALIKE)


def _is_new(term: Coefficient, settings: RunSettings) -> bool:
    """Say whether a vehicle has neither the product nor its name."""
    own = settings.vehicle.coefficient_set
    return ahead(term) not in {ahead(c) for c in own} and term.identifier not in {c.identifier for c in own}


def _using(settings: RunSettings, spans: Spans) -> RunSettings:
    identification = settings.identification.model_copy(update={"use": Use(spans=spans)})
    return settings.model_copy(update={"identification": identification})


def _fit(prepared: PreparedData) -> _Fit | None:
    """Fit the smoother; None where it does not settle."""
    augmented = augmented_problem(prepared)
    segments = [segment.timelines for segment in augmented.segments]
    problem = JointProblem(augmented.process, augmented.sensors, segments, augmented.prior)
    smoothing = LinearSmoothing(problem)
    answers = most_probable(problem, smoothing, prepared.experiment.identification.smoother.max_passes)
    if not answers or not answers[0][1]:
        return None
    return _Fit(augmented, problem, smoothing, answers[0][0])
