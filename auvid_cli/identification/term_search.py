"""Terms that a model lacks: ranked by what a smoother's fit leaves of the data, accepted by data that are held out."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import RunSettings, Use
from auvid_cli.config.spans import Spans
from auvid_cli.config.terms import Term
from auvid_cli.data.term_findings import LEAST_HELD_OUT_GAIN, ScoredTerm, TermFindings
from auvid_cli.errors import DataError
from auvid_cli.filters.candidate_scores import correlation, explained, gains, sizes
from auvid_cli.filters.fault_scores import score_faults
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing
from auvid_cli.filters.problem import FaultScores
from auvid_cli.filters.smoother import most_probable
from auvid_cli.identification.augmented import AugmentedProblem, augmented_problem
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.faults import missing_term
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.term_library import admissible_terms, regressor_ahead

Array = NDArray[np.float64]

# Share of the data that is held out: the end of them.
HELD_OUT = 1.0 / 3.0
# Gain in log-likelihood that makes a term worth trying: of two hundred that are not there one in a hundred sets of data
# has one beyond it (chi-squared of one degree of freedom, 4.1 sigma).
LEAST_GAIN = 8.4
# Correlation beyond which two terms are hardly told apart; how many of a look are tried, and told of.
_ALIKE, _TRIED, _TOLD = 0.95, 3, 5


@dataclass(frozen=True)
class _Fit:
    """The smoother's answer to some data.

    Attributes
    ----------
    augmented : AugmentedProblem
    smoothing : LinearSmoothing
    answer : Filtered
    """

    augmented: AugmentedProblem
    smoothing: LinearSmoothing
    answer: Filtered

    @property
    def log_evidence(self) -> float:
        """Return the log-likelihood of the data whatever the coefficients and the motion, but for a constant."""
        return -0.5 * (self.answer.least + self.answer.log_determinant)

    def of(self, symbol: str) -> tuple[float, float]:
        """Return the value of a coefficient that is estimated, and its standard deviation, SI."""
        (row,) = self.augmented.layout.rows([symbol])
        scale, final = self.augmented.layout.scale[row], self.answer.final
        value = self.answer.trajectory.parameters[row] + final.mean[row]
        return float(scale * value), float(scale * np.sqrt(final.covariance()[row, row]))

    def scores(self, terms: tuple[Coefficient, ...]) -> FaultScores:
        """Find what the data say of terms beyond the model."""
        tested = [missing_term(term) for term in terms]
        return score_faults(self.smoothing, self.answer, VehicleFaults(self.augmented, tested=tested))


class _Model(NamedTuple):
    """A model, fitted without what is held out, and with it."""

    settings: RunSettings
    fit: _Fit
    whole: _Fit

    @property
    def held_out(self) -> float:
        """Return the log-likelihood of what is held out, with all that the rest says taken as known."""
        return self.whole.log_evidence - self.fit.log_evidence


def search_terms(
    prepared: PreparedData,
    any_symmetry: bool = False,
    most: int = 4,
    say: Callable[[str], None] = lambda text: None,
) -> TermFindings:
    """Look for terms that the model lacks; no truth is looked at.

    Again and again all candidates are scored beside the terms found so far, and the model is fitted with each of the
    best, for what is linear about a model without them is rough. That which fits best is found if it makes the held-out
    data likelier. Terms found before that add nothing beside it are given up again.

    Parameters
    ----------
    prepared : PreparedData
        Its end, a third, is held out.
    any_symmetry : bool
        See `admissible_terms`.
    most : int
        How many looks there are, and so how many terms are found.
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
    candidates = _new(admissible_terms(any_symmetry), prepared.experiment)
    tried, given_up = list[ScoredTerm](), list[str]()

    def model(settings: RunSettings) -> _Model | None:
        fit, whole = (_fit(prepared.with_settings(_using(settings, spans))) for spans in (fitted, fitted + held_out))
        return None if fit is None or whole is None else _Model(settings, fit, whole)

    say("fit of the model as it is")
    here = model(prepared.experiment)
    if here is None:
        raise DataError(
            "the smoother does not settle on these data, so nothing can be said of what its model lacks: see auvid "
            "identify --filter smoother"
        )
    for look in range(1, most + 1):
        new = tuple(t for t in _new(candidates, here.settings) if t.symbol not in given_up)
        say(f"look {look}: {len(new)} terms")
        scored = _Scored.of(here.fit, new)
        fits = dict[int, _Model]()
        for k in scored.worth_trying():
            say(f"look {look}: fit with {new[k].symbol}")
            own = (*here.settings.vehicle.terms, Term.of(new[k]))
            if (there := model(with_terms(here.settings, own))) is not None:
                fits[k] = there
        best = max(fits, key=lambda k: fits[k].fit.log_evidence, default=None)
        is_better = best is not None and fits[best].held_out - here.held_out >= LEAST_HELD_OUT_GAIN
        found = best if is_better else None
        tried += scored.rows(look, here, fits, found)
        if found is None:
            break
        here = fits[found]
        say(f"look {look}: fits without terms found before")
        for earlier in here.settings.vehicle.terms[len(prepared.experiment.vehicle.terms) : -1]:
            others = [term for term in here.settings.vehicle.terms if term != earlier]
            without = model(with_terms(here.settings, others))
            if without is not None and here.held_out - without.held_out < LEAST_HELD_OUT_GAIN:
                here, given_up = without, [*given_up, earlier.name]
    kept = [row._replace(found=row.found and row.term not in given_up) for row in tried]
    return TermFindings(tuple(kept), len(candidates), fitted, held_out, here.settings)


class _Scored(NamedTuple):
    """Candidates as the linear problem about a fit has them, the best first in `order`."""

    candidates: tuple[Coefficient, ...]
    scores: FaultScores
    gains: Array
    shares: Array
    order: list[int]

    @classmethod
    def of(cls, fit: _Fit, candidates: tuple[Coefficient, ...]) -> "_Scored":
        """Find what a fit says of them."""
        scores = fit.scores(candidates)
        n, by_gain = len(scores.effect), gains(scores)
        shares = explained(scores, fit.answer.final.covariance()[:n, :n])
        return cls(candidates, scores, by_gain, shares, np.argsort(-by_gain).tolist())

    def worth_trying(self) -> list[int]:
        """Choose the best that explain more than chance, none hardly told from one before it."""
        chosen = list[int]()
        for k in self.order:
            if len(chosen) == _TRIED or self.gains[k] < LEAST_GAIN:
                break
            if not self._like(k)[chosen].any():
                chosen.append(k)
        return chosen

    def rows(self, look: int, here: _Model, fits: Mapping[int, _Model], found: int | None) -> Iterator[ScoredTerm]:
        """Yield a row for each of the best, and for those that were tried."""
        linear = np.stack(sizes(self.scores))
        for k in [k for place, k in enumerate(self.order) if place < _TOLD or k in fits]:
            term, alike, there = self.candidates[k], self._like(k), fits.get(k)
            names = [self.candidates[j].symbol for j in self.order if alike[j] and j != k][:_TOLD]
            size, deviation = linear[:, k].tolist() if there is None else there.whole.of(term.symbol)
            yield ScoredTerm(
                *(look, term.symbol, term.unit, term.equation, size, deviation),
                *(float(self.gains[k]), float(self.shares[k]), ", ".join(names)),
                None if there is None else there.held_out - here.held_out,
                k == found,
            )

    def _like(self, k: int) -> NDArray[np.bool_]:
        return np.abs(correlation(self.scores, k)) > _ALIKE


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


def with_terms(settings: RunSettings, terms: Sequence[Term]) -> RunSettings:
    """Return settings whose vehicle has these terms of its own; those that are new are to be estimated."""
    vehicle, identification = settings.vehicle, settings.identification
    before, after = ([term.name for term in each] for each in (vehicle.terms, terms))
    if identification.coefficients != "all":
        kept = [symbol for symbol in identification.coefficients if symbol not in before or symbol in after]
        named = (*kept, *(name for name in after if name not in before))
        identification = identification.model_copy(update={"coefficients": named})
    vehicle = vehicle.model_copy(update={"terms": tuple(terms)})
    return settings.model_copy(update={"vehicle": vehicle, "identification": identification})


def _new(candidates: Sequence[Coefficient], settings: RunSettings) -> tuple[Coefficient, ...]:
    """Choose those of which a vehicle has neither the product nor the name."""
    own = settings.vehicle.coefficient_set
    names, products = {c.identifier for c in own}, {regressor_ahead(c) for c in own}
    return tuple(c for c in candidates if c.identifier not in names and regressor_ahead(c) not in products)


def _using(settings: RunSettings, spans: Spans) -> RunSettings:
    identification = settings.identification.model_copy(update={"use": Use(spans=spans)})
    return settings.model_copy(update={"identification": identification})


def _fit(prepared: PreparedData) -> _Fit | None:
    """Fit the smoother; None where it does not settle."""
    augmented = augmented_problem(prepared)
    problem = augmented.joint
    smoothing = LinearSmoothing(problem)
    answers = most_probable(problem, smoothing, prepared.experiment.identification.smoother.max_passes)
    if not answers or not answers[0][1]:
        return None
    return _Fit(augmented, smoothing, answers[0][0])
