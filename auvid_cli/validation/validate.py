"""Everything that is said of an estimate on data that it has not seen."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.check import Checks
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.identification.prepared_data import PreparedData, prepare
from auvid_cli.validation.data_leakage import other_vehicle
from auvid_cli.validation.error_growth import ErrorGrowth, error_growth
from auvid_cli.validation.free_run_fit import fit_free_runs
from auvid_cli.validation.horizon_prediction import Bundle, evenly_spaced, predict_ahead, rows_ahead
from auvid_cli.validation.initial_states import InitialStates, filtered_initial_states, with_model
from auvid_cli.validation.manoeuvres import TILT, manoeuvre_numbers
from auvid_cli.validation.model_bundle import Models, drawn_coefficients, models_of
from auvid_cli.validation.results import ManoeuvreNumber, Validation
from auvid_cli.validation.signals import MeasuredSignal, measured_signals
from auvid_cli.validation.verdicts import verdicts
from auvid_cli.vehicle.coefficients import SYMBOLS

Array = NDArray[np.float64]

# However long the data: starts, evenly spaced, and draws from the uncertainty, as many as fit into one block.
STARTS, DRAWS = 100, 50


def validate(dataset: Dataset, estimate: Estimate, training: Dataset | None = None, starts: int = STARTS) -> Validation:
    """Predict a manoeuvre with an identified model; no truth is looked at.

    Vehicle, coefficients and settings are the estimate's, inputs and measurements the dataset's.

    Parameters
    ----------
    dataset : Dataset
        That the estimate has not seen, see `check_unseen`.
    estimate : Estimate
    training : Dataset, optional
        That the estimate was made from: by how much its predictions of that are worse than is stated, horizon by
        horizon, is then part of the bands.
    starts : int
        Most starts of predictions ahead.

    Raises
    ------
    DataError
        If the estimate did not end well, the dataset has no usable sensor, or is too short to predict anything.
    """
    if not estimate.completed:
        raise DataError(f"the estimate {estimate.status}: it is no model to be validated")
    prepared, models = prepare(with_model(dataset, estimate)), models_of(estimate)
    signals = measured_signals(prepared.measuring)
    initial_states = filtered_initial_states(prepared, _spread_over(prepared, signals, starts))
    if not initial_states.time.size:
        begin, end = _span(prepared, signals)
        raise DataError(
            f"there is no time at which a prediction can start: the measurements from {begin:g} s to {end:g} s are too "
            f"short, or this model cannot follow them ({initial_states.status})"
        )
    free = fit_free_runs(prepared, signals, models, initial_states)
    rng = np.random.default_rng(estimate.experiment.seed)
    bundle = _bundle(models, drawn_coefficients(estimate, DRAWS, rng))
    # What is seen on the model's own data says better how errors grow than white noise that stands for their causes.
    process_noise = initial_states.process_noise if training is None else None
    collected = predict_ahead(prepared, signals, initial_states, bundle, rng, process_noise)
    growth = {} if training is None else _growth(training, estimate, bundle, starts, rng).in_motion(signals)
    rows = [*free.rows, *rows_ahead(collected, bundle.names, signals, growth)]
    numbers = manoeuvre_numbers(prepared.dataset.inputs, signals, free.run)
    remarks = [
        *_remarks(dataset, estimate, initial_states, collected.blown_up),
        *_unknown_growth(training),
        *_taken_as_level(numbers, signals),
    ]
    return Validation(
        estimate.filter,
        rows,
        numbers,
        Checks(verdicts(estimate.filter, rows, free.excursion, initial_states.nis, initial_states.status)),
        free.run,
        remarks,
    )


def _span(prepared: PreparedData, signals: Mapping[str, MeasuredSignal]) -> tuple[float, float]:
    """Return when the motion is first known, and when the last measurement comes, s."""
    return prepared.segments[0].timelines.span[0], max(float(signal.time[-1]) for signal in signals.values())


def _spread_over(prepared: PreparedData, signals: Mapping[str, MeasuredSignal], starts: int) -> Array:
    return evenly_spaced(*_span(prepared, signals), starts)


def _growth(
    training: Dataset, estimate: Estimate, bundle: Bundle, starts: int, rng: np.random.Generator
) -> ErrorGrowth:
    """Find by how much predictions of an estimate's own data, in the longest segment of them, are worse than stated."""
    used = prepare(replace(training, experiment=estimate.experiment)).segments
    longest = max(used, key=lambda segment: segment.timelines.span[1] - segment.timelines.span[0]).dataset
    prepared = prepare(with_model(longest, estimate))
    signals = measured_signals(prepared.measuring)
    states = filtered_initial_states(prepared, _spread_over(prepared, signals, starts))
    return error_growth(predict_ahead(prepared, signals, states, bundle, rng).samples, signals)


def _bundle(models: Models, drawn: Array | None) -> Bundle:
    """Bundle the models that are known by name and, behind them, what is drawn."""
    named = {name: values for name, values in models._asdict().items() if values is not None}
    table = np.array([[values[symbol] for symbol in SYMBOLS] for values in named.values()])
    return Bundle(tuple(named), table if drawn is None else np.vstack([table, drawn]))


def _remarks(dataset: Dataset, estimate: Estimate, starts: InitialStates, blown_up: NDArray[np.bool_]) -> Iterator[str]:
    if other := other_vehicle(dataset, estimate):
        yield (
            f"the dataset states another vehicle ({', '.join(other)} differ); the model is the estimate's, of "
            f"{estimate.experiment.vehicle.name}"
        )
    if starts.noise_factor > 1.0:
        yield (
            f"the filter that finds where predictions start got {starts.noise_factor:g} times the process noise of the "
            "settings, which the measurements contradict"
        )
    if not blown_up.size:
        yield "the covariance of the coefficients is not finite and positive definite: errors have no band"
    if blown_up.any():
        yield (
            f"{blown_up.sum()} of {blown_up.size} sets of coefficients drawn from the estimate's covariance blew up on "
            "the way; the band is without them"
        )


def _unknown_growth(training: Dataset | None) -> Iterator[str]:
    if training is None:
        yield (
            "the data that the estimate was made from are not at hand: process noise, and not the errors of predicting "
            "them, says how bands grow"
        )


def _taken_as_level(numbers: Sequence[ManoeuvreNumber], signals: Mapping[str, MeasuredSignal]) -> Iterator[str]:
    unmeasured = [symbol for symbol in TILT if symbol not in signals]
    if unmeasured and any(row.number == "radius" for row in numbers):
        lacking = " or ".join(unmeasured)
        yield f"turns are taken as level, their speed as that along the path: no sensor measures {lacking}"
