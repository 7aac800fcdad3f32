"""Search for terms that a model lacks: candidates, their score tests, and models with them."""

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.coefficients import Term
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.identification import Use
from auvid_cli.config.settings import Spans
from auvid_cli.data.findings import MIN_HELD_OUT_GAIN, ScoredTerm, TermFindings
from auvid_cli.errors import DataError
from auvid_cli.filters.fault_scores import correlation, fraction_explained, gains, score_faults, sizes
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing
from auvid_cli.filters.problem import FaultScores
from auvid_cli.filters.signatures import Signatures
from auvid_cli.filters.smoother import most_probable
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.faults import missing_term
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.problem_setup import AugmentedProblem, Motion, augmented_problem
from auvid_cli.vehicle.coefficients import Coefficient, admissible_terms, regressor_ahead

# Share of the data that is held out, at their end.
HELD_OUT = 1.0 / 3.0
# Factors of the process noise that are tried in turn.
_NOISE_FACTORS = 3.0, 10.0, 30.0, 100.0, 300.0
# Gain of the log-likelihood, predicted by the linear problem, from which a term is fitted (two sigma).
_MIN_LINEAR_GAIN = 2.0
# Correlation from which two terms can hardly be distinguished.
_INDISTINGUISHABLE = 0.95
# Correlation from which one term may replace the other.
_REPLACEABLE = 0.7
# Number of distinguishable terms that are fitted in a round.
_N_FITS = 3
# Number of further terms that are fitted then: those most correlated with the best one.
_N_NEIGHBOURS = 3
# Number of terms that are listed in a round.
_N_LISTED = 5


@dataclass(frozen=True)
class Fit:
    """A converged smoother on some data."""

    augmented: AugmentedProblem
    smoothing: LinearSmoothing
    filtered: Filtered

    @property
    def log_evidence(self) -> float:
        """Return the log marginal likelihood of the data, up to a constant."""
        return -0.5 * (self.filtered.least + self.filtered.log_determinant)

    def value_and_deviation(self, symbol: str) -> tuple[float, float]:
        """Return an estimated coefficient and its standard deviation, SI."""
        (row,) = self.augmented.layout.rows([symbol])
        scale, final = self.augmented.layout.scale[row], self.filtered.final
        value = self.filtered.trajectory.parameters[row] + final.mean[row]
        return float(scale * value), float(scale * np.sqrt(final.covariance()[row, row]))

    def scores(self, terms: tuple[Coefficient, ...]) -> FaultScores:
        """Return the score tests of terms that the model lacks."""
        tested = [missing_term(term) for term in terms]
        faults = VehicleFaults(self.augmented, tested=tested)
        return score_faults(Signatures(self.augmented.joint, self.smoothing, self.filtered, faults))


class Model(NamedTuple):
    """Result of fitting a model to the training data and to all data, without the large factors of a `Fit`."""

    settings: RunSettings
    training: float  # log marginal likelihood of the training data, up to a constant
    whole: float  # log marginal likelihood of all data, up to the same constant
    # Value and standard deviation of each estimated term beyond the 22, by symbol, SI, from all data
    terms: dict[str, tuple[float, float]]

    @property
    def held_out(self) -> float:
        """Return the predictive log-likelihood of the held-out data, given the training data."""
        return self.whole - self.training

    def gains(self, before: "Model") -> tuple[float, float]:
        """Return the log-likelihood gains over another model: held-out data, all data."""
        return self.held_out - before.held_out, self.whole - before.whole


def fitted_model(prepared: PreparedData, settings: RunSettings, start: Motion | None = None) -> Model | None:
    """Fit the model of some settings; None if the smoother does not converge.

    With a `start`, the motion of a similar model, there is no search for other minima.
    """
    training_spans, held_out_spans = split(prepared)
    fit = fit_smoother(prepared, settings, training_spans, start)
    if fit is None:
        return None
    training = fit.log_evidence
    # A fit is large: keep one at a time.
    del fit
    whole = fit_smoother(prepared, settings, (*training_spans, *held_out_spans), start)
    if whole is None:
        return None
    own = {term.symbol for term in settings.vehicle.coefficient_set.terms}
    estimated = [symbol for symbol in settings.identification.estimated(settings.vehicle) if symbol in own]
    terms = {symbol: whole.value_and_deviation(symbol) for symbol in estimated}
    return Model(settings, training, whole.log_evidence, terms)


def with_more_process_noise(prepared: PreparedData, settings: RunSettings, best: Fit) -> Fit:
    """Fit a model to the training data with the most likely level of process noise.

    With more process noise the coefficients are less biased by a missing term.
    """
    for factor in _NOISE_FACTORS:
        noise = settings.identification.process_noise.times(factor, ("velocity", "rate"))
        fit = fit_smoother(prepared, settings.with_identification(process_noise=noise), split(prepared)[0])
        if fit is None or fit.log_evidence < best.log_evidence:
            break
        best = fit
    return best


def with_terms(settings: RunSettings, terms: Sequence[Term]) -> RunSettings:
    """Return settings with these terms of the vehicle's own; new ones are estimated."""
    vehicle, identification = settings.vehicle, settings.identification
    before, after = ([term.name for term in some] for some in (vehicle.terms, terms))
    if identification.coefficients != "all":
        kept = [symbol for symbol in identification.coefficients if symbol not in before or symbol in after]
        named = (*kept, *(name for name in after if name not in before))
        identification = identification.model_copy(update={"coefficients": named})
    vehicle = vehicle.model_copy(update={"terms": tuple(terms)})
    return settings.model_copy(update={"vehicle": vehicle, "identification": identification})


def split(prepared: PreparedData) -> tuple[Spans, Spans]:
    """Split the segments of the data into training and held-out spans, s."""
    spans = [segment.timelines.span for segment in prepared.segments]
    remaining = (1.0 - HELD_OUT) * sum(end - begin for begin, end in spans)
    training, held_out = list[tuple[float, float]](), list[tuple[float, float]]()
    for begin, end in spans:
        cut = min(begin + max(remaining, 0.0), end)
        remaining -= end - begin
        if cut > begin:
            training.append((begin, cut))
        if cut < end:
            held_out.append((float(np.nextafter(cut, end)), end))
    return tuple(training), tuple(held_out)


def fit_smoother(
    prepared: PreparedData, settings: RunSettings, spans: Spans, start: Motion | None = None
) -> Fit | None:
    """Run the smoother on spans of the data, first from a `start`; None if it does not converge."""
    augmented = augmented_problem(prepared.with_settings(settings.with_identification(use=Use(spans=spans))))
    problem = augmented.joint
    smoothing = LinearSmoothing(problem)
    first = None if start is None else start.trajectory(augmented)
    optima = most_probable(problem, smoothing, settings.identification.smoother.max_passes, first=first)
    if not optima or not optima[0][1]:
        return None
    return Fit(augmented, smoothing, optima[0][0])


_Fitted = TypeVar("_Fitted", Fit, Model)


def search_terms(
    prepared: PreparedData,
    any_symmetry: bool = False,
    max_terms: int = 4,
    on_step: Callable[[str], None] = lambda text: None,
) -> TermFindings:
    """Search for terms that the model lacks; the truth of a simulation is not used.

    Each round scores all candidates twice: about the fit, and about a fit with more process noise, where a missing term
    biases the coefficients less. The scores are rough if a large term is missing, so the model is then fitted with each
    of the best candidates and with those most correlated with them. A term qualifies if it improves the likelihood of
    the held-out data, and that of all data by more than the best of all candidates does by chance. The round finds the
    qualified term with the largest likelihood of all data, and drops earlier terms that no longer improve the
    likelihood of the held-out data.

    Parameters
    ----------
    prepared : PreparedData
        The last third is held out.
    any_symmetry : bool
        See `admissible_terms`.
    max_terms : int
        Largest number of rounds, each of which finds at most one term.
    on_step : callable
        Called with a description of each step.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    DataError
        If the smoother does not converge without further terms.
    """
    training, held_out = split(prepared)
    candidates = _new(admissible_terms(any_symmetry), prepared.experiment)
    tried, dropped = list[ScoredTerm](), list[str]()

    def fit_with(settings: RunSettings, term: Coefficient) -> Model | None:
        on_step(f"fit with {term.symbol}")
        return fitted_model(prepared, with_terms(settings, (*settings.vehicle.terms, Term.of(term))))

    on_step("fit of the model as it is")
    model = _converged(fitted_model(prepared, prepared.experiment))
    for look in range(1, max_terms + 1):
        new = tuple(t for t in _new(candidates, model.settings) if t.symbol not in dropped)
        on_step(f"look {look}: {len(new)} terms")
        fit = _converged(fit_smoother(prepared, model.settings, training))
        scored = _CandidateScores.about(fit, new)
        noisier = _CandidateScores.about(with_more_process_noise(prepared, model.settings, fit), new)
        # A fit is large, and is not needed to compare models.
        del fit
        fits = noisier.fits(scored.leaders() + noisier.leaders(), functools.partial(fit_with, model.settings))
        least = MIN_HELD_OUT_GAIN, MIN_HELD_OUT_GAIN + math.log(len(candidates))
        better = [k for k, other in fits.items() if all(np.greater_equal(other.gains(model), least))]
        found = max(better, key=lambda k: fits[k].whole, default=None)
        tried += scored.rows(look, model, fits, found)
        if found is None:
            break
        model = fits[found]
        on_step(f"look {look}: fits without terms found before")
        for earlier in model.settings.vehicle.terms[len(prepared.experiment.vehicle.terms) : -1]:
            others = [term for term in model.settings.vehicle.terms if term != earlier]
            without = fitted_model(prepared, with_terms(model.settings, others))
            if without is not None and model.held_out - without.held_out < MIN_HELD_OUT_GAIN:
                model, dropped = without, [*dropped, earlier.name]
    rows = [row._replace(found=row.found and row.term not in dropped) for row in tried]
    return TermFindings(tuple(rows), len(candidates), training, held_out, model.settings)


def _converged(fit: _Fitted | None) -> _Fitted:
    if fit is None:
        raise DataError(
            "the smoother does not converge on these data, so missing terms cannot be tested; see auvid identify "
            "--filter smoother"
        )
    return fit


class _CandidateScores(NamedTuple):
    """Score tests of candidate terms about a fit."""

    candidates: tuple[Coefficient, ...]
    scores: FaultScores
    gains: Array  # shape (n,); predicted gain of the log-likelihood
    shares: Array  # shape (n,); share of each term that the estimated coefficients explain
    order: list[int]  # candidates by falling gain

    @classmethod
    def about(cls, fit: Fit, candidates: tuple[Coefficient, ...]) -> "_CandidateScores":
        """Score candidates about a fit."""
        scores = fit.scores(candidates)
        n, by_gain = len(scores.effect), gains(scores)
        shares = fraction_explained(scores, fit.filtered.final.covariance()[:n, :n])
        return cls(candidates, scores, by_gain, shares, np.argsort(-by_gain).tolist())

    def leaders(self) -> list[int]:
        """Return the best candidates that are distinguishable from each other."""
        chosen = list[int]()
        for k in self.order:
            if len(chosen) == _N_FITS or self.gains[k] < _MIN_LINEAR_GAIN:
                break
            if not self._indistinguishable(k)[chosen].any():
                chosen.append(k)
        return chosen

    def fits(self, first: list[int], fit: Callable[[Coefficient], Model | None]) -> dict[int, Model]:
        """Fit some candidates, then repeatedly those that are most correlated with the best fit."""
        fits, tried, batch = dict[int, Model](), set[int](), list(dict.fromkeys(first))
        while batch:
            fits |= {k: model for k in batch if (model := fit(self.candidates[k])) is not None}
            tried.update(batch)
            best = max(fits, key=lambda k: fits[k].whole, default=None)
            neighbours = [] if best is None else self._neighbours(best)
            batch = [k for k in neighbours[:_N_NEIGHBOURS] if k not in tried]
        return fits

    def rows(self, look: int, before: Model, fits: Mapping[int, Model], found: int | None) -> Iterator[ScoredTerm]:
        """Yield a row for each of the best candidates and for those that were fitted."""
        linear = np.stack(sizes(self.scores))
        for k in [k for rank, k in enumerate(self.order) if rank < _N_LISTED or k in fits]:
            term, similar, model = self.candidates[k], self._indistinguishable(k), fits.get(k)
            names = [self.candidates[j].symbol for j in self.order if similar[j] and j != k][:_N_LISTED]
            size, deviation = linear[:, k].tolist() if model is None else model.terms[term.symbol]
            yield ScoredTerm(
                *(look, term.symbol, term.unit, term.equation, size, deviation),
                *(float(self.gains[k]), float(self.shares[k]), ", ".join(names)),
                *((None, None) if model is None else model.gains(before)),
                k == found,
            )

    def _indistinguishable(self, k: int) -> NDArray[np.bool_]:
        return np.abs(correlation(self.scores, k)) > _INDISTINGUISHABLE

    def _neighbours(self, k: int) -> list[int]:
        similarity = np.abs(correlation(self.scores, k))
        return [int(j) for j in np.argsort(-similarity) if j != k and similarity[j] > _REPLACEABLE]


def _new(candidates: Sequence[Coefficient], settings: RunSettings) -> tuple[Coefficient, ...]:
    """Return the candidates with a product and a name that no term of the vehicle has."""
    own = settings.vehicle.coefficient_set
    names, products = {c.identifier for c in own}, {regressor_ahead(c) for c in own}
    return tuple(c for c in candidates if c.identifier not in names and regressor_ahead(c) not in products)
