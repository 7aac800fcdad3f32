"""Models of a search: settings with tuned noise, additions and evidence, and models made from them."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from math import inf, log

import numpy as np

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import ProcessNoise
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.fitting.additions import Addition, with_addition, without_addition
from auvid_cli.fitting.candidates import corrected_times
from auvid_cli.fitting.quick_fits import smoothed
from auvid_cli.identification.noise import tune_coarsely
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.problem_setup import Motion
from auvid_cli.identification.terms import fitted_model

# Corrections of a delay, and the size of one that is small enough at the end, in standard deviations.
_MAX_CORRECTIONS = 3
_SMALL_CORRECTION = 0.5
# Passes in which the joint estimate is found if it is near.
_PASSES_NEARBY = 8


@dataclass(frozen=True)
class Model:
    """Settings with tuned noise, the additions that they have, their evidence, and the motion."""

    settings: RunSettings
    additions: tuple[Addition, ...]
    evidence: float
    motion: Motion


class ModelMaker:
    """Makes models of the same data.

    Parameters
    ----------
    prepared : PreparedData
        Thinned data.
    least : ProcessNoise
        Lower limits of the process noise.
    on_pass : callable
        Called before each pass through the data; an exception from it ends the search.
    """

    def __init__(self, prepared: PreparedData, least: ProcessNoise, on_pass: Callable[[], None]) -> None:
        self.prepared, self._least, self._on_pass = prepared, least, on_pass
        spans = (segment.timelines.span for segment in prepared.segments)
        self.duration = sum(end - begin for begin, end in spans)  # s; of the data
        self.n_measured = sum(
            int(np.isfinite(timeline.measurement).sum())
            for segment in prepared.segments
            for timeline in segment.timelines
        )

    def estimate(self, model: Model) -> Estimate:
        """Return the joint estimate of a model if it is near its motion, else the marginal one, which takes longer."""
        smoother = model.settings.identification.smoother
        joint = smoother.model_copy(update={"answer": "joint", "max_passes": min(smoother.max_passes, _PASSES_NEARBY)})
        marginal = smoother.model_copy(update={"answer": "marginal"})
        for answer in (joint, marginal):
            settings = model.settings.with_identification(smoother=answer)
            estimate = smoothed(self.prepared.with_settings(settings), model.motion)
            if estimate.completed:
                break
        return estimate

    def estimated(self, model: Model) -> tuple[Model, Estimate]:
        """Return a model with the motion of its estimate if there is one, and the estimate."""
        estimate = self.estimate(model)
        return (replace(model, motion=Motion.of_estimate(estimate)) if estimate.completed else model), estimate

    def with_addition(self, model: Model, addition: Addition) -> Model | None:
        """Return the model with an addition and the noise tuned again; None if it does not converge."""
        settings, replaced = self._changed(model, addition)
        others = tuple(each for each in model.additions if each.key not in (addition.key, replaced))
        additions = (*others, addition)
        if not addition.is_time:
            return self.tuned(settings, additions, model.motion)
        # A score test is exact for small delays only. Corrections with the present noise are quick, so they come first.
        corrected = self.with_corrected_times(Model(settings, additions, model.evidence, model.motion), {addition.key})
        tuned = self.tuned(corrected.settings, corrected.additions, corrected.motion)
        if tuned is None:
            return None
        corrected, distance = self._once_corrected(tuned, {addition.key})
        return tuned if distance < 1.0 else self.tuned(corrected.settings, corrected.additions, corrected.motion)

    def without_addition(self, model: Model, addition: Addition) -> Model | None:
        """Return the model without an addition and the noise tuned again; None if it does not converge."""
        rest = tuple(each for each in model.additions if each.key != addition.key)
        return self.tuned(without_addition(model.settings, addition), rest, model.motion)

    def without_coefficients(self, model: Model, symbols: Collection[str]) -> Model | None:
        """Return the model with coefficients held and the noise tuned again; None if it does not converge."""
        identification = model.settings.identification
        rest = tuple(each for each in identification.estimated(model.settings.vehicle) if each not in symbols)
        return self.tuned(model.settings.with_identification(coefficients=rest), model.additions, model.motion)

    def with_corrected_times(self, model: Model, keys: Collection[tuple[str, str]]) -> Model:
        """Return a model with delays moved to the zero of their score tests, with the present noise."""
        for _ in range(_MAX_CORRECTIONS):
            model, distance = self._once_corrected(model, keys)
            if distance < _SMALL_CORRECTION:
                break
        return model

    def _once_corrected(self, model: Model, keys: Collection[tuple[str, str]]) -> tuple[Model, float]:
        """Return a model with delays moved to the zero of their score tests, and the largest move in deviations."""
        estimate = self.estimate(model)
        settings, additions, largest = model.settings, model.additions, 0.0
        for addition, test in corrected_times(estimate, model.additions):
            if addition.key in keys:
                settings = with_addition(settings, addition)
                additions = tuple(addition if each.key == addition.key else each for each in additions)
                largest = max(largest, abs(test.z))
        return replace(model, settings=settings, additions=additions), largest

    def _changed(self, model: Model, addition: Addition) -> tuple[RunSettings, tuple[str, str] | None]:
        """Return settings with an addition, and the key of the addition that it replaces."""
        other = addition.instead
        if other is None or all(each.key != other.key for each in model.additions):
            return with_addition(model.settings, addition), None
        return with_addition(without_addition(model.settings, other), addition), other.key

    def tuned(
        self, settings: RunSettings, additions: tuple[Addition, ...], start: Motion | None = None
    ) -> Model | None:
        """Return the model of some settings with the most likely noise; None if no trajectory follows the data."""
        sensors = [addition.name for addition in additions if addition.family == "noise"]
        try:
            found = tune_coarsely(
                self.prepared.with_settings(settings), self._least, sensors, lambda progress: self._on_pass(), start
            )
        except DataError:
            found = None
        if found is None:
            return None
        tuning, motion = found
        settings = tuning.experiment.with_identification(smoother=settings.identification.smoother)
        free = len(sensors) + sum(addition.is_time or addition.family == "prior" for addition in additions)
        free += sum(noise.setting.startswith("identification.estimate.") for noise in tuning.noises)
        evidence = tuning.log_likelihood - 0.5 * free * log(self.n_measured)
        return Model(settings, additions, evidence, motion)

    def held_out_gain(self, model: Model, other: Model) -> float:
        """Return the gain in log-likelihood of the last third by another model, given the rest; -inf without a fit."""
        before, after = (fitted_model(self.prepared, each.settings, each.motion) for each in (model, other))
        return -inf if before is None or after is None else after.gains(before)[0]
