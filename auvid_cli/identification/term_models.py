"""Models with terms of their own, fitted by the smoother to a part of the data, and to that and what is held out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.identification import Use
from auvid_cli.config.spans import Spans
from auvid_cli.config.terms import Term
from auvid_cli.filters.fault_scores import score_faults
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing
from auvid_cli.filters.problem import FaultScores
from auvid_cli.filters.smoother import most_probable
from auvid_cli.identification.augmented import AugmentedProblem, augmented_problem
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.faults import missing_term
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.vehicle.coefficients import Coefficient

# Share of the data that is held out: the end of them.
HELD_OUT = 1.0 / 3.0
# Times the process noise.
_LOOSER = 3.0, 10.0, 30.0, 100.0, 300.0


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
