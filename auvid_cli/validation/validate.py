"""Validate an estimate: predict data that it was not made from."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import Checks
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.evaluation.judgement import judge_one
from auvid_cli.identification.prepared_data import PreparedData, prepare, used_segments
from auvid_cli.identification.timeline import measuring_sensors
from auvid_cli.validation import initial_states
from auvid_cli.validation.data_leakage import other_vehicle
from auvid_cli.validation.initial_states import Draws, InitialStates, Models
from auvid_cli.validation.manoeuvres import TILT, manoeuvre_numbers
from auvid_cli.validation.motion_prediction import MeasuredSignal, measured_signals, signal_sizes
from auvid_cli.validation.prediction_errors import ErrorGrowth, error_growth, prediction_checks
from auvid_cli.validation.predictions import (
    Bundle,
    Collected,
    FreeRunFit,
    Sample,
    evenly_spaced,
    fit_free_runs,
    free_run_rows,
    predict_ahead,
    rows_ahead,
)
from auvid_cli.validation.results import ManoeuvreNumber, Prediction, Validation
from auvid_cli.vehicle.equations import NO_ERRORS

STARTS = 100  # evenly spaced over all segments
DRAWS = 50  # from the uncertainty; with the named models they fit into one block


class _Filtered(NamedTuple):
    """A segment of the data with filtered states."""

    prepared: PreparedData  # from `with_model`
    signals: dict[str, MeasuredSignal]
    states: InitialStates  # at least one

    @property
    def length(self) -> float:
        """Return its duration, s."""
        begin, end = _span(self.prepared, self.signals)
        return end - begin


def validate(
    segments: Sequence[Dataset],
    estimate: Estimate,
    training: Dataset | None = None,
    starts: int = STARTS,
    anew: bool = False,
    reference: Estimate | None = None,
) -> Validation:
    """Predict manoeuvres with the vehicle, coefficients and settings of an estimate; the truth is ignored.

    Parameters
    ----------
    segments : sequence of Dataset
        Independent of the estimate, see `unseen_segments`; of one or several runs.
    estimate : Estimate
    training : Dataset, optional
        The data of the estimate. The excess errors of their predictions, by horizon, are then part of the bands.
    starts : int
        Largest number of starts of predictions ahead, over all segments.
    anew : bool
        Whether estimated thrust, fin trims and ballast differ in each run even if the estimate has them constant.
    reference : Estimate, optional
        By the smoother from the same data, to judge the estimate.

    Raises
    ------
    DataError
        If the estimate did not converge, no segment has a usable sensor, or all are too short for a prediction.
    """
    if not estimate.completed:
        raise DataError(f"invalid estimate ({estimate.status}); a model to validate must be complete")
    models = initial_states.models_of(estimate)
    filtered, too_short = _filter(_with_model(segments, estimate, anew), starts)
    if not filtered:
        raise DataError(too_short[0])
    sizes = signal_sizes([segment.signals for segment in filtered])
    free = [fit_free_runs(segment.prepared, segment.signals, models, segment.states) for segment in filtered]
    rng = np.random.default_rng(estimate.experiment.seed)
    left_out = initial_states.errors_of_each_run(estimate.experiment.identification, anew)
    bundle = _bundle(
        models, initial_states.drawn_models(estimate, DRAWS, rng, left_out), estimate.coefficient_set.symbols
    )
    collected = _predict(filtered, bundle, rng)
    growth = {} if training is None else _growth(training, estimate, bundle, starts, rng, anew).in_motion(sizes)
    free_by_file, ahead_by_file = _by_vehicle_file(segments, starts)
    rows = [
        *free_run_rows(free, sizes, free_by_file),
        *rows_ahead(collected, bundle.names, sizes, growth, ahead_by_file),
    ]
    numbers = [
        number
        for segment, its_run in zip(filtered, free, strict=True)
        for number in manoeuvre_numbers(segment.prepared.dataset.inputs, segment.signals, its_run.run)
    ]
    remarks = [
        *too_short,
        *_remarks(segments[0], estimate, filtered, collected.blown_up, anew),
        *_data_remarks(training, filtered, numbers, sizes),
    ]
    statuses = [segment.states.status for segment in filtered]
    checks = prediction_checks(
        estimate.filter,
        rows,
        _largest(its_run.excursion for its_run in free),
        _largest(segment.states.nis for segment in filtered),
        min(statuses, key=lambda status: status == "completed"),
    )
    longest = max(range(len(filtered)), key=lambda k: filtered[k].length)
    shown, run = filtered[longest].prepared.dataset, free[longest].run
    judgement = judge_one(estimate, reference)
    return Validation(estimate.filter, judgement, rows, numbers, Checks(checks), shown, run, remarks)


def predict(segments: Sequence[Dataset], estimate: Estimate, starts: int) -> list[Prediction]:
    """Return the predictions ahead of `validate`, by an estimate and by the vehicle file, without bands.

    Without the models that are drawn for the bands, this takes a fraction of the time.

    Raises
    ------
    DataError
        If no segment has a usable sensor, or all are too short for a prediction.
    """
    models = initial_states.models_of(estimate)
    filtered, too_short = _filter(_with_model(segments, estimate, anew=False), starts)
    if not filtered:
        raise DataError(too_short[0])
    sizes = signal_sizes([segment.signals for segment in filtered])
    bundle = _bundle(models, None, estimate.coefficient_set.symbols)
    collected = _predict(filtered, bundle, np.random.default_rng(estimate.experiment.seed), with_process_noise=False)
    return [*rows_ahead(collected, bundle.names, sizes, {}, _by_vehicle_file(segments, starts)[1])]


def _by_vehicle_file(segments: Sequence[Dataset], starts: int) -> tuple[list[FreeRunFit], list[Sample]]:
    """Return free runs and predictions ahead by the unchanged vehicle file; none if it lacks a coefficient.

    They start from states that a filter with this model finds, so they are the same for each estimate.
    """
    stated = [data for segment in segments if (data := initial_states.with_vehicle_file(segment)) is not None]
    if len(stated) < len(segments):
        return [], []
    free, ahead = list[FreeRunFit](), list[Sample]()
    for segment in _filter([prepare(data) for data in stated], starts)[0]:
        vehicle = segment.prepared.experiment.vehicle
        values, symbols = vehicle.stated_coefficients(), vehicle.coefficient_set.symbols
        models = Models(values, None)
        free.append(fit_free_runs(segment.prepared, segment.signals, models, segment.states))
        bundle = _bundle(models, None, symbols)
        ahead += _predict([segment], bundle, np.random.default_rng(0), with_process_noise=False).samples
    return free, ahead


def _with_model(segments: Sequence[Dataset], estimate: Estimate, anew: bool) -> list[PreparedData]:
    return [prepare(initial_states.with_model(segment, estimate, anew)) for segment in segments]


def _filter(prepared: Sequence[PreparedData], starts: int) -> tuple[list[_Filtered], list[str]]:
    """Return the filtered segments, with starts in proportion to their lengths, and sentences on too short ones."""
    signals = [measured_signals(data.measuring) for data in prepared]
    spans = [_span(data, measured) for data, measured in zip(prepared, signals, strict=True)]
    total, filtered, too_short = sum(end - begin for begin, end in spans), list[_Filtered](), list[str]()
    for data, measured, (begin, end) in zip(prepared, signals, spans, strict=True):
        share = ceil(starts * (end - begin) / total) if end > begin else 0
        states = initial_states.filtered_initial_states(data, evenly_spaced(begin, end, share))
        if states.time.size:
            filtered.append(_Filtered(data, measured, states))
        else:
            too_short.append(
                f"no prediction can start between {begin:g} s and {end:g} s: the segment is too short, or the filter "
                f"cannot follow it with this model ({states.status})"
            )
    return filtered, too_short


def _span(prepared: PreparedData, signals: Mapping[str, MeasuredSignal]) -> tuple[float, float]:
    """Return the time of the first known motion and of the last measurement, s."""
    return prepared.segments[0].timelines.span[0], max(float(signal.time[-1]) for signal in signals.values())


def _predict(
    filtered: Sequence[_Filtered], bundle: Bundle, rng: np.random.Generator, with_process_noise: bool = True
) -> Collected:
    collected = Collected([], np.zeros(len(bundle.coefficients) - len(bundle.names), dtype=np.bool_))
    for prepared, signals, states in filtered:
        collected = collected.plus(predict_ahead(prepared, signals, states, bundle, rng, with_process_noise))
    return collected


def _growth(
    training: Dataset, estimate: Estimate, bundle: Bundle, starts: int, rng: np.random.Generator, anew: bool
) -> ErrorGrowth:
    """Return the excess errors of predictions of the estimate's own data."""
    own = training.with_settings(estimate.experiment)
    filtered, _ = _filter(_with_model(used_segments(own, measuring_sensors(own)), estimate, anew), starts)
    sizes = signal_sizes([segment.signals for segment in filtered])
    plain, noisy = (_predict(filtered, bundle, rng, noise).samples for noise in (False, True))
    return error_growth(plain, noisy, sizes)


def _largest(values: Iterable[Mapping[str, float]]) -> dict[str, float]:
    largest: dict[str, float] = {}
    for by_name in values:
        for name, value in by_name.items():
            largest[name] = max(value, largest.get(name, 0.0))
    return largest


def _bundle(models: Models, drawn: Draws | None, symbols: Sequence[str]) -> Bundle:
    """Return the named models, followed by the drawn ones."""
    named = {name: values for name, values in models._asdict().items() if values is not None}
    table = np.array([[values[symbol] for symbol in symbols] for values in named.values()])
    errors, parameters = np.zeros((len(named), len(NO_ERRORS))), tuple({} for _ in named)
    if drawn is not None:
        table, errors = np.vstack([table, drawn.coefficients]), np.vstack([errors, drawn.errors])
        parameters += drawn.parameters
    return Bundle(tuple(named), table, errors, parameters)


def _remarks(
    dataset: Dataset, estimate: Estimate, filtered: Sequence[_Filtered], blown_up: NDArray[np.bool_], anew: bool
) -> Iterator[str]:
    if other := other_vehicle(dataset, estimate):
        yield (
            f"the dataset states another vehicle ({', '.join(other)} differ); predictions are for the vehicle of the "
            f"estimate, {estimate.experiment.vehicle.name}"
        )
    if own := initial_states.own_of_each_run(estimate.experiment.identification, anew):
        yield (
            f"{', '.join(own)}: estimated in each run by the filter of the initial states (free run: at the end), "
            f"{'as requested' if anew else 'because it walks'}"
        )
    if (noise_factor := max(segment.states.noise_factor for segment in filtered)) > 1.0:
        yield (
            f"the filter of the initial states needed {noise_factor:g} times the process noise of the settings, which "
            "the measurements contradict"
        )
    if not blown_up.size:
        yield "the covariance of the coefficients is not finite and positive definite: errors have no band"
    if blown_up.any():
        yield (
            f"{blown_up.sum()} of {blown_up.size} sets of coefficients drawn from the estimate's covariance diverged; "
            "the band is without them"
        )


def _data_remarks(
    training: Dataset | None,
    filtered: Sequence[_Filtered],
    numbers: Sequence[ManoeuvreNumber],
    signals: Collection[str],
) -> Iterator[str]:
    if training is None:
        yield (
            "the data of the estimate are not available: bands grow with process noise alone, without the errors of "
            "predictions of these data"
        )
    if any("r" in segment.signals and "gyroscope" not in segment.prepared.measuring for segment in filtered):
        yield "no gyroscope measures r: it is computed from the change of attitude over a second"
    unmeasured = [symbol for symbol in TILT if symbol not in signals]
    if unmeasured and any(row.number == "radius" for row in numbers):
        yield (
            f"turns are treated as level, with the speed along the path: no sensor measures {' or '.join(unmeasured)}"
        )
