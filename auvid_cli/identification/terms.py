"""Search for terms that a model lacks: candidates, their score tests, and models with them."""

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.identification import Use
from auvid_cli.config.settings import Spans
from auvid_cli.config.terms import Term
from auvid_cli.data.findings import LEAST_HELD_OUT_GAIN, ScoredTerm, TermFindings
from auvid_cli.errors import DataError
from auvid_cli.filters.fault_scores import correlation, fraction_explained, gains, score_faults, sizes
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing
from auvid_cli.filters.problem import FaultScores
from auvid_cli.filters.smoother import most_probable
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.faults import missing_term
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.problem_setup import AugmentedProblem, augmented_problem
from auvid_cli.vehicle.coefficients import Coefficient, admissible_terms, regressor_ahead

# Share of the data that is held out: the end of them.
HELD_OUT = 1.0 / 3.0
# Times the process noise.
_LOOSER = 3.0, 10.0, 30.0, 100.0, 300.0
Array = NDArray[np.float64]
# Gain by the linear problem that makes a term worth a fit: two sigma, for it is rough.
_LEAST_GAIN = 2.0
# Correlation beyond which two terms are hardly told apart, and beyond which one may stand for the other; how many of a
# look are tried that are told apart, how many near the best of these, and how many are told of.
_ALIKE, _NEAR, _TRIED, _TRIED_NEAR, _TOLD = 0.95, 0.7, 3, 3, 5


@dataclass(frozen=True)
class Fit:
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


class Model(NamedTuple):
    """What is kept of a model that was fitted without what is held out, and with it: no factors, which are large.

    Attributes
    ----------
    settings : RunSettings
    fitted : float
        Log-likelihood of what is not held out, whatever the coefficients and the motion, but for a constant.
    whole : float
        That of all data.
    terms : dict of tuple of float
        Value and standard deviation, SI, by all data, of each term beyond the 22 that is estimated, by its symbol.
    """

    settings: RunSettings
    fitted: float
    whole: float
    terms: dict[str, tuple[float, float]]

    @property
    def held_out(self) -> float:
        """Return the log-likelihood of what is held out, with all that the rest says taken as known."""
        return self.whole - self.fitted

    def gains(self, before: "Model") -> tuple[float, float]:
        """Return by how much likelier than another it makes what is held out, and all data."""
        return self.held_out - before.held_out, self.whole - before.whole


def fitted_model(prepared: PreparedData, settings: RunSettings) -> Model | None:
    """Fit the model of some settings; None where the smoother does not settle.

    Parameters
    ----------
    prepared : PreparedData
        Its end, a third, is held out.
    settings : RunSettings
    """
    before = fit_without_held_out(prepared, settings)
    if before is None:
        return None
    fitted = before.log_evidence
    # One of the two at a time.
    del before
    whole = _fit(prepared, _using(settings, sum(split(prepared), ())))
    if whole is None:
        return None
    own = {term.symbol for term in settings.vehicle.coefficient_set.terms}
    estimated = [symbol for symbol in settings.identification.estimated(settings.vehicle) if symbol in own]
    return Model(settings, fitted, whole.log_evidence, {symbol: whole.of(symbol) for symbol in estimated})


def fit_without_held_out(prepared: PreparedData, settings: RunSettings) -> Fit | None:
    """Fit the model of some settings to what is not held out; None where the smoother does not settle."""
    return _fit(prepared, _using(settings, split(prepared)[0]))


def loosened(prepared: PreparedData, settings: RunSettings, best: Fit) -> Fit:
    """Fit a model again with as much process noise as makes the data likeliest, for what it lacks is noise to it."""
    identification, stated = settings.identification, settings.identification.process_noise
    for factor in _LOOSER:
        noise = stated.times(factor, ("velocity", "rate"))
        looser = identification.model_copy(update={"process_noise": noise})
        fit = fit_without_held_out(prepared, settings.model_copy(update={"identification": looser}))
        if fit is None or fit.log_evidence < best.log_evidence:
            break
        best = fit
    return best


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


def _using(settings: RunSettings, spans: Spans) -> RunSettings:
    identification = settings.identification.model_copy(update={"use": Use(spans=spans)})
    return settings.model_copy(update={"identification": identification})


def _fit(prepared: PreparedData, settings: RunSettings) -> Fit | None:
    augmented = augmented_problem(prepared.with_settings(settings))
    problem = augmented.joint
    smoothing = LinearSmoothing(problem)
    answers = most_probable(problem, smoothing, settings.identification.smoother.max_passes)
    if not answers or not answers[0][1]:
        return None
    return Fit(augmented, smoothing, answers[0][0])


_Fitted = TypeVar("_Fitted", Fit, Model)


def search_terms(
    prepared: PreparedData,
    any_symmetry: bool = False,
    most: int = 4,
    say: Callable[[str], None] = lambda text: None,
) -> TermFindings:
    """Look for terms that the model lacks; no truth is looked at.

    Again and again all candidates are scored beside the terms found so far, about the fit, and about one that may
    depart from its equations as far as the data ask: coefficients that are bent to stand for a term that is missing
    hide it. The model is fitted with each of the best, and with what comes nearest to the best of these, for such
    scores are rough where what is missing is large. A term is found if it makes the held-out data likelier, and all
    data by more than the best of so many candidates does by chance; of several that which makes all data likeliest.
    Terms found before that add nothing beside it are given up again.

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

    def tried_with(settings: RunSettings, term: Coefficient) -> Model | None:
        say(f"fit with {term.symbol}")
        return fitted_model(prepared, with_terms(settings, (*settings.vehicle.terms, Term.of(term))))

    say("fit of the model as it is")
    here = _settled(fitted_model(prepared, prepared.experiment))
    for look in range(1, most + 1):
        new = tuple(t for t in _new(candidates, here.settings) if t.symbol not in given_up)
        say(f"look {look}: {len(new)} terms")
        fit = _settled(fit_without_held_out(prepared, here.settings))
        scored = _Scored.of(fit, new)
        looser = _Scored.of(loosened(prepared, here.settings, fit), new)
        # What smooths hours of data is large, and the models are compared without.
        del fit
        fits = looser.fits(scored.leaders() + looser.leaders(), functools.partial(tried_with, here.settings))
        least = LEAST_HELD_OUT_GAIN, LEAST_HELD_OUT_GAIN + math.log(len(candidates))
        likelier = [k for k, there in fits.items() if all(np.greater_equal(there.gains(here), least))]
        found = max(likelier, key=lambda k: fits[k].whole, default=None)
        tried += scored.rows(look, here, fits, found)
        if found is None:
            break
        here = fits[found]
        say(f"look {look}: fits without terms found before")
        for earlier in here.settings.vehicle.terms[len(prepared.experiment.vehicle.terms) : -1]:
            others = [term for term in here.settings.vehicle.terms if term != earlier]
            without = fitted_model(prepared, with_terms(here.settings, others))
            if without is not None and here.held_out - without.held_out < LEAST_HELD_OUT_GAIN:
                here, given_up = without, [*given_up, earlier.name]
    kept = [row._replace(found=row.found and row.term not in given_up) for row in tried]
    return TermFindings(tuple(kept), len(candidates), fitted, held_out, here.settings)


def _settled(fit: _Fitted | None) -> _Fitted:
    """Return what was fitted.

    Raises
    ------
    DataError
        If nothing was.
    """
    if fit is None:
        raise DataError(
            "the smoother does not settle on these data, so nothing can be said of what its model lacks: see auvid "
            "identify --filter smoother"
        )
    return fit


class _Scored(NamedTuple):
    """Candidates as the linear problem about a fit has them, the best first in `order`."""

    candidates: tuple[Coefficient, ...]
    scores: FaultScores
    gains: Array
    shares: Array
    order: list[int]

    @classmethod
    def of(cls, fit: Fit, candidates: tuple[Coefficient, ...]) -> "_Scored":
        """Find what a fit says of them."""
        scores = fit.scores(candidates)
        n, by_gain = len(scores.effect), gains(scores)
        shares = fraction_explained(scores, fit.answer.final.covariance()[:n, :n])
        return cls(candidates, scores, by_gain, shares, np.argsort(-by_gain).tolist())

    def leaders(self) -> list[int]:
        """Choose the best, none hardly told from one before it."""
        chosen = list[int]()
        for k in self.order:
            if len(chosen) == _TRIED or self.gains[k] < _LEAST_GAIN:
                break
            if not self._like(k)[chosen].any():
                chosen.append(k)
        return chosen

    def fits(self, first: list[int], fit: Callable[[Coefficient], Model | None]) -> dict[int, Model]:
        """Fit some, then again and again what is nearest to the best of the fits."""
        fits, tried, next_ones = dict[int, Model](), set[int](), list(dict.fromkeys(first))
        while next_ones:
            fits |= {k: there for k in next_ones if (there := fit(self.candidates[k])) is not None}
            tried.update(next_ones)
            best = max(fits, key=lambda k: fits[k].whole, default=None)
            near = [] if best is None else self._near(best)
            next_ones = [k for k in near[:_TRIED_NEAR] if k not in tried]
        return fits

    def rows(self, look: int, here: Model, fits: Mapping[int, Model], found: int | None) -> Iterator[ScoredTerm]:
        """Yield a row for each of the best, and for those that were tried."""
        linear = np.stack(sizes(self.scores))
        for k in [k for place, k in enumerate(self.order) if place < _TOLD or k in fits]:
            term, alike, there = self.candidates[k], self._like(k), fits.get(k)
            names = [self.candidates[j].symbol for j in self.order if alike[j] and j != k][:_TOLD]
            size, deviation = linear[:, k].tolist() if there is None else there.terms[term.symbol]
            yield ScoredTerm(
                *(look, term.symbol, term.unit, term.equation, size, deviation),
                *(float(self.gains[k]), float(self.shares[k]), ", ".join(names)),
                *((None, None) if there is None else there.gains(here)),
                k == found,
            )

    def _like(self, k: int) -> NDArray[np.bool_]:
        return np.abs(correlation(self.scores, k)) > _ALIKE

    def _near(self, k: int) -> list[int]:
        likeness = np.abs(correlation(self.scores, k))
        return [int(j) for j in np.argsort(-likeness) if j != k and likeness[j] > _NEAR]


def _new(candidates: Sequence[Coefficient], settings: RunSettings) -> tuple[Coefficient, ...]:
    """Choose those of which a vehicle has neither the product nor the name."""
    own = settings.vehicle.coefficient_set
    names, products = {c.identifier for c in own}, {regressor_ahead(c) for c in own}
    return tuple(c for c in candidates if c.identifier not in names and regressor_ahead(c) not in products)
