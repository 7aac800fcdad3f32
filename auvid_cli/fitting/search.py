"""Search for the model of a dataset.

`fit_model` inspects the data, finds the process noise, adds errors and terms, removes needless ones, and judges.
Evidence is the log marginal likelihood, with trajectory and parameters integrated out and the noise at its maximum,
less half the logarithm of the number of measurements for each number without a prior (Schwarz, Ann. Stat. 6(2), 1978).
"""

from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from time import process_time, thread_time
from typing import NamedTuple

import auvid_cli.identification.sensors  # noqa: F401  compiled at import, not while the smoother runs
from auvid_cli.config.enums import JUDGE
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import ProcessNoise
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.findings import MIN_HELD_OUT_GAIN
from auvid_cli.errors import DataError
from auvid_cli.evaluation.innovations import causes_text, likely_causes
from auvid_cli.evaluation.judgement import Grade, Judgement, judge_one
from auvid_cli.fitting.additions import Addition, is_certain, size_text, why_implausible
from auvid_cli.fitting.candidates import WORTH, Candidate, by_kind, candidates, needless_coefficients, noise_excess
from auvid_cli.fitting.look import refuse_contradictions, with_still_planes_held
from auvid_cli.fitting.models import Model, ModelMaker
from auvid_cli.fitting.quick_fits import joint_answer, smoothed, thinned, training_part, trial_text, try_on_held_out
from auvid_cli.fitting.results import Fit, FitAction, FitStep
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import Motion
from auvid_cli.identification.run import identify

# Passes of the first fit, with the noise as stated: a model that holds converges in a few.
_FIRST_PASSES = 8
# Factors on the stated process noise at the start, so that the smoother converges with a wrong model; the next one is
# tried if no trajectory follows the data.
_LARGE_FACTORS = 100.0, 10.0, 1.0
_MAX_LOOKS = 8
_N_THREADS = 2  # that try additions
# Distance of a new error from 0 from which its model is fitted until it converges, in standard deviations of its prior.
_SUSPICIOUS = 1.0
# Gain for each measurement below which a cause explains little, so that noise and a disturbance are tried too.
_SMALL_SHARE = 0.02
# Factor on the stated process noise from which noise and a disturbance are tried first.
_FAR_FROM_STATED = 500.0
# Process noise up to this factor on the stated one is no sign of a missing part of the model.
_TIGHT = 3.0
# Factor on the passes of the last fit if it does not converge.
_LONGER = 4
# Reasons of an early end.
_OUT_OF_TIME = "the time limit was reached"
_INTERRUPTED = "interrupted"
_INTERRUPTED_FIT = "interrupted, so the estimate is of thinned data"


class FitLimits(NamedTuple):
    """Limits of a search."""

    only: tuple[str, ...] = ()  # families of additions that may be tried; empty for all
    excluded: tuple[str, ...] = ()  # families that may not be tried
    max_time: float = float("inf")  # s of processor time
    ignores_inspection: bool = False  # whether data whose inspection fails are searched nevertheless

    def allows(self, addition: Addition) -> bool:
        """Whether an addition may be tried."""
        return addition.family not in self.excluded and (not self.only or addition.family in self.only)


class _OutOfTimeError(Exception):
    """The time limit of the search is over."""


def fit_model(dataset: Dataset, limits: FitLimits, on_step: Callable[[str], None] = lambda text: None) -> Fit:
    """Return the model of a dataset, found step by step; the truth of a simulation is not used.

    Parameters
    ----------
    dataset : Dataset
        Its settings are the first model.
    limits : FitLimits
    on_step : callable
        Called with a description of each step. A KeyboardInterrupt ends the search with the best model so far.

    Raises
    ------
    ConfigError, DataError
        As `auvid_cli.identification.problem_setup.augmented_problem`.
    DataError
        If the inspection of the data finds a wrong sign, unit, axis or clock, or no trajectory follows the data.
    """
    if not limits.ignores_inspection:
        on_step("inspect the data")
        refuse_contradictions(dataset)
    settings, still = with_still_planes_held(dataset)
    dataset = dataset.with_settings(settings)
    search = _Search(dataset, limits, on_step)
    for motion in still:
        search.note("hold", f"coefficients of {motion}")
    on_step("fit with the settings as they are")
    quick = search.fit_as_stated()
    if search.holds(quick):
        estimate, stopped = search.fit_to_all_data(dataset.experiment)
        judgement = judge_one(estimate, None)
        search.note("start", "settings as they are", judgement)
        if stopped or search.holds(estimate):
            trial, stopped = search.trial(dataset.experiment, stopped, quick)
            return Fit(estimate, judgement, search.steps_with_sizes(estimate), dataset.experiment, (), trial, stopped)
    stopped = ""
    try:
        search.start_loose()
        search.improve()
        search.simplify()
        search.correct_times()
    except _OutOfTimeError:
        stopped = _OUT_OF_TIME
    except KeyboardInterrupt:
        stopped = _INTERRUPTED
    if search.model is None:
        reason = f"{stopped} before a first model was found" if stopped else "no trajectory follows these data"
        raise DataError(f"auvid fit: {reason}")
    return search.finish(stopped)


class _Trial(NamedTuple):
    """Result of trying an addition."""

    model: Model | None  # none if it does not converge or is not admissible
    gain: float | None  # in evidence
    refused: str  # why the addition is not plausible; empty if it is
    cpu_time: float  # s


class _Search:
    """State of a search: the best model so far, and the steps."""

    def __init__(self, dataset: Dataset, limits: FitLimits, on_step: Callable[[str], None]) -> None:
        self._dataset, self._limits, self._on_step = dataset, limits, on_step
        self._prepared = prepare(joint_answer(thinned(dataset)))
        self._least: ProcessNoise = dataset.experiment.identification.process_noise
        self._maker = ModelMaker(self._prepared, self._least, self._check_time)
        self._begin = self._last = process_time()
        self.steps: list[FitStep] = []
        self.model: Model | None = None
        self._look, self._is_stopped = 0, False
        self._judgement: Judgement | None = None
        self._estimate: Estimate | None = None  # of the present model from the thinned data

    def fit_as_stated(self) -> Estimate | None:
        """Return a quick fit of the first two thirds with the settings as they are; None if none follows the data."""
        data = joint_answer(thinned(self._dataset))
        smoother = data.experiment.identification.smoother
        quick = smoother.model_copy(update={"max_passes": min(smoother.max_passes, _FIRST_PASSES)})
        try:
            return smoothed(training_part(data, data.experiment.with_identification(smoother=quick)))
        except DataError:
            return None

    def holds(self, estimate: Estimate | None) -> bool:
        """Whether an estimate with the settings as they are is sound, and no addition promises much."""
        if estimate is None or judge_one(estimate, None).grade is not Grade.SOUND:
            return False
        return not self._promising(self._candidates(estimate, ()), estimate)

    def _candidates(self, estimate: Estimate, present: Collection[Addition]) -> list[Candidate]:
        """Return the additions that may be tried, the best first."""
        found = candidates(estimate, present, self._least, self._maker.duration)
        return [candidate for candidate in found if self._limits.allows(candidate.addition)]

    def _promising(self, found: Sequence[Candidate], estimate: Estimate) -> list[Candidate]:
        """Return the candidates that promise much for each measurement of an estimate."""
        measured = sum(estimate.statistics(sensor).sums.components.sum() for sensor in estimate.innovations)
        return [candidate for candidate in found if candidate.expected > _SMALL_SHARE * measured]

    def start_loose(self) -> None:
        """Find the most likely process noise, beginning with far more than stated."""
        self._on_step("process noise from the data")
        names = [
            name
            for name in ("velocity", "rate", "attitude", "depth")
            if name != "depth" or name in self._prepared.measuring
        ]
        for factor in _LARGE_FACTORS:
            noise = self._least.times(factor, names)
            self.model = self._maker.tuned(self._prepared.experiment.with_identification(process_noise=noise), ())
            if self.model is not None:
                break
        else:
            raise DataError("no trajectory follows these data, even with much process noise; see auvid inspect")
        self.note("start", "process noise from the data")

    def improve(self) -> None:
        """Add what the data ask for, one addition after another, until nothing is worth it."""
        assert self.model is not None, "a search starts with a model"
        for self._look in range(1, _MAX_LOOKS + 1):
            self.model, estimate = self._maker.estimated(self.model)
            self._estimate = estimate
            self._judgement = judge_one(estimate, None)
            self._set_judged_after(self._judgement)
            tried = self._candidates(estimate, self.model.additions)
            if self._judgement.grade is Grade.SOUND and noise_excess(estimate, self._least) <= _TIGHT:
                # With a sensor much quieter than stated, an estimate is sound, but not as accurate as it could be.
                tried = self._promising(tried, estimate)
            causes, others = by_kind(tried)
            if noise_excess(estimate, self._least) > _FAR_FROM_STATED:
                # The tests are not calibrated yet, and a disturbance converges faster than a wrong cause.
                causes, others = others, causes
            start = self.model
            self._try(start, causes)
            if self.model.evidence - start.evidence < _SMALL_SHARE * self._maker.n_measured:
                # A disturbance, or noise of another size, explains a little of everything: only if nothing else does.
                self._try(start, others)
            if self.model is start:
                return
            (kept,) = (step for step in self.steps if step.look == self._look and step.kept)
            self._on_step(f"look {self._look}: kept {kept.what}, {self.model.evidence - start.evidence:+.0f}")

    def _try(self, start: Model, trials: Sequence[Candidate]) -> None:
        """Try additions to a model, and keep the best if it is worth it, also if the trials are interrupted."""
        assert self.model is not None, "a search starts with a model"
        before = str(self._judgement.grade) if self._judgement else ""
        models: list[tuple[Addition, Model]] = []
        rows: list[FitStep] = []
        threads = ThreadPoolExecutor(_N_THREADS)
        running = [threads.submit(self._tried, start, candidate.addition) for candidate in trials]
        try:
            for number, ((addition, _), trial) in enumerate(zip(trials, running, strict=True), 1):
                best = max(models, key=lambda pair: pair[1].evidence, default=None)
                gain = 0.0 if best is None else best[1].evidence - start.evidence
                so_far = f"{best[0]}, {gain:+.0f}" if best is not None and gain > 0.0 else "no addition"
                self._on_step(f"look {self._look}, candidate {number} of {len(trials)}: {addition}; best: {so_far}")
                tried = trial.result()
                row = self._step("add", addition, tried.gain, False, before)
                rows.append(row._replace(size=tried.refused, cpu_time=tried.cpu_time))
                if tried.model is not None:
                    models.append((addition, tried.model))
        finally:
            self._is_stopped = True
            threads.shutdown(cancel_futures=True)
            self._is_stopped = False
            best = max(models, key=lambda pair: pair[1].evidence, default=None)
            if best is not None and best[1].evidence - self.model.evidence >= WORTH:
                self.steps = [step._replace(kept=step.kept and step.look < self._look) for step in self.steps]
                rows = [row._replace(kept=row.key == best[0].key) for row in rows]
                self._estimate, self.model = None, best[1]
            self.steps += rows

    def _tried(self, start: Model, addition: Addition) -> _Trial:
        """Try an addition; refuse one that is not plausible, and a term that does not predict new data better."""
        begin, other, refused = thread_time(), self._maker.with_addition(start, addition), ""
        gain = None if other is None else other.evidence - start.evidence
        if other is not None and gain is not None and gain >= WORTH:
            refused = self._refusal(other, addition)
            if addition.family == "term":
                # Any term fits the data better. One that the vehicle has also predicts new data better.
                held_out = self._maker.held_out_gain(start, other)
                if held_out < MIN_HELD_OUT_GAIN:
                    other, gain = None, min(held_out, 0.0)
        return _Trial(None if refused else other, gain, refused, thread_time() - begin)

    def _refusal(self, model: Model, addition: Addition) -> str:
        """Return why an addition is not plausible; an empty text if it is."""
        asked = model.settings.identification.estimate
        if not why_implausible(asked, addition, model.motion, _SUSPICIOUS):
            return ""
        return why_implausible(asked, addition, Motion.of_estimate(self._maker.estimate(model)))

    def simplify(self) -> None:
        """Take away additions that the others make unnecessary, until each one is needed."""
        assert self.model is not None, "a search starts with a model"
        # The last addition is needed: the model without it was already worse.
        needed = self.model.additions[-1:]
        while (without := self._without_one(self.model, needed)) is not None:
            self._estimate, self.model, needed = None, without, ()
        self._leave_at_zero(self.model)

    def _present_estimate(self, model: Model) -> Estimate:
        """Return the estimate of the present model from the thinned data, computed once."""
        if self._estimate is None:
            self._estimate = self._maker.estimate(model)
        return self._estimate

    def _without_one(self, model: Model, needed: Collection[Addition]) -> Model | None:
        """Return the model without the first addition that is not worth it; None if each one is."""
        estimate = self._present_estimate(model)
        for addition in model.additions:
            if addition in needed or is_certain(estimate, addition):
                continue
            self._on_step(f"try without {addition}")
            other = self._maker.without_addition(model, addition)
            loss = None if other is None else other.evidence - model.evidence
            is_better = loss is not None and loss > -WORTH
            self.steps.append(self._step("remove", addition, loss, is_better, ""))
            if is_better:
                return other
        return None

    def _leave_at_zero(self, model: Model) -> None:
        """Hold the coefficients that the vehicle file states as 0, if the evidence grows."""
        estimate = self._present_estimate(model)
        symbols = needless_coefficients(estimate) if estimate.completed else ()
        if not symbols:
            return
        self._on_step(f"try {', '.join(symbols)} at 0")
        other = self._maker.without_coefficients(model, symbols)
        gain = None if other is None else other.evidence - model.evidence
        is_better = gain is not None and gain >= WORTH
        self.steps.append(self._step("leave at 0", ", ".join(symbols), gain, is_better, ""))
        if other is not None and is_better:
            self._estimate, self.model = None, other

    def correct_times(self) -> None:
        """Move delays and the lag of the fins to the zero of their score tests."""
        assert self.model is not None, "a search starts with a model"
        keys = {addition.key for addition in self.model.additions if addition.is_time}
        if keys:
            self.model, self._estimate = self._maker.with_corrected_times(self.model, keys), None

    def finish(self, stopped: str) -> Fit:
        """Fit the best model to all data, and judge it."""
        assert self.model is not None, "a search starts with a model"
        settings = self.model.settings
        smoother = self._dataset.experiment.identification.smoother
        if smoother.answer == "automatic" and settings.identification.process_noise != self._least:
            smoother = smoother.model_copy(update={"answer": "marginal"})
        step = self._dataset.experiment.identification.integration_step
        settings = settings.with_identification(smoother=smoother, integration_step=step)
        estimate, interrupted = self.fit_to_all_data(settings)
        if not estimate.completed and not interrupted:
            longer = smoother.model_copy(update={"max_passes": _LONGER * smoother.max_passes})
            settings = settings.with_identification(smoother=longer)
            estimate, interrupted = self.fit_to_all_data(settings)
        stopped = interrupted or stopped
        judgement = judge_one(estimate, None)
        self._set_judged_after(judgement)
        self.note("end", "fit to thinned data" if interrupted else "fit to all data", judgement)
        trial, stopped = self.trial(settings, stopped) if estimate.completed else ("", stopped)
        causes = likely_causes(estimate) if judgement.grade is not Grade.SOUND else []
        explained = (causes_text(causes),) if causes else ()
        return Fit(estimate, judgement, self.steps_with_sizes(estimate), settings, explained, trial, stopped)

    def steps_with_sizes(self, estimate: Estimate) -> tuple[FitStep, ...]:
        """Return the steps after the errors that the settings asked for; an addition replaced later is not kept."""
        present = {} if self.model is None else {addition.key: addition for addition in self.model.additions}
        asked = (Addition(name.value) for name in self._dataset.experiment.identification.estimate.biases)
        sizes = {addition: size_text(estimate, addition) for addition in asked if not addition.is_time}
        removed = {step.key for step in self.steps if step.kept and step.action == "remove"}
        steps = [FitStep(0, "as asked", what, size, None, True, "", "", 0.0) for what, size in sizes.items() if size]
        for step in self.steps:
            if step.kept and step.key in present:
                step = step._replace(size=size_text(estimate, present[step.key]))
            elif step.kept and step.action == "add" and step.key not in removed:
                step = step._replace(kept=False)
            steps.append(step)
        return tuple(steps)

    def fit_to_all_data(self, settings: RunSettings) -> tuple[Estimate, str]:
        """Return the estimate from all data, or if interrupted from thinned data, and the reason of an early end."""
        try:
            self._on_step("fit of the model to all data")
            return identify(self._dataset.with_settings(settings), JUDGE), ""
        except KeyboardInterrupt:
            quick = smoothed(self._prepared) if self.model is None else self._maker.estimate(self.model)
            return quick, _INTERRUPTED_FIT

    def trial(self, settings: RunSettings, stopped: str, fitted: Estimate | None = None) -> tuple[str, str]:
        """Return how well a model predicts the last third by a fit to the rest, and the reason of an early end."""
        if stopped == _INTERRUPTED_FIT or self._is_out_of_time():
            return "", stopped or _OUT_OF_TIME
        try:
            self._on_step("predict the last third by a fit to the rest")
            data = thinned(self._dataset)
            motion = None if self.model is None else self.model.motion
            fitted = fitted or smoothed(training_part(data, settings), motion)
            return trial_text(try_on_held_out(data, fitted)), stopped
        except KeyboardInterrupt:
            return "", stopped or _INTERRUPTED
        except DataError:
            return "", stopped  # no trajectory follows the first two thirds

    def note(self, action: FitAction, what: str, judgement: Judgement | None = None) -> None:
        """Add a step other than a trial."""
        self.steps.append(self._step(action, what, None, True, "", judgement))

    def _set_judged_after(self, judgement: Judgement) -> None:
        """State the judgement of the model that has the last additions."""
        grade = str(judgement.grade)
        self.steps = [
            step._replace(judged_after=step.judged_after or grade) if step.kept and step.action != "hold" else step
            for step in self.steps
        ]

    def _step(
        self,
        action: FitAction,
        what: Addition | str,
        gain: float | None,
        kept: bool,
        before: str,
        judgement: Judgement | None = None,
    ) -> FitStep:
        now = process_time()
        elapsed, self._last = now - self._last, now
        after = "" if judgement is None else str(judgement.grade)
        return FitStep(self._look, action, what, "", gain, kept, before, after, elapsed)

    def _is_out_of_time(self) -> bool:
        return process_time() - self._begin > self._limits.max_time

    def _check_time(self) -> None:
        if self._is_stopped or self._is_out_of_time():
            raise _OutOfTimeError
