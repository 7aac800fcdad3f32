"""Everything that is said of an estimate on data that it has not seen."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
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
from auvid_cli.validation.data_leakage import other_vehicle
from auvid_cli.validation.free_run import fit_free_runs, free_run_rows
from auvid_cli.validation.horizons import (
    Bundle,
    Collected,
    ErrorGrowth,
    error_growth,
    evenly_spaced,
    predict_ahead,
    rows_ahead,
)
from auvid_cli.validation.initial_states import (
    Draws,
    InitialStates,
    Models,
    drawn_models,
    errors_of_each_run,
    filtered_initial_states,
    models_of,
    own_of_each_run,
    with_model,
)
from auvid_cli.validation.manoeuvres import TILT, manoeuvre_numbers
from auvid_cli.validation.motion_prediction import MeasuredSignal, measured_signals, signal_sizes
from auvid_cli.validation.results import ManoeuvreNumber, Validation
from auvid_cli.validation.verdicts import verdicts
from auvid_cli.vehicle.equations import NO_ERRORS

Array = NDArray[np.float64]

# However long the data: starts, evenly spaced, and draws from the uncertainty, as many as fit into one block.
STARTS, DRAWS = 100, 50


class _Followed(NamedTuple):
    """A segment of the data with the motion that a filter finds there.

    Attributes
    ----------
    prepared : PreparedData
        From `with_model`.
    signals : dict of MeasuredSignal
    states : InitialStates
        At least one.
    """

    prepared: PreparedData
    signals: dict[str, MeasuredSignal]
    states: InitialStates

    @property
    def length(self) -> float:
        """Return how long it is, s."""
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
    """Predict manoeuvres with an identified model; no truth is looked at.

    Vehicle, coefficients and settings are the estimate's, inputs and measurements those of the data.

    Parameters
    ----------
    segments : sequence of Dataset
        That the estimate has not seen, see `unseen_segments`; of one run or of several.
    estimate : Estimate
    training : Dataset, optional
        That the estimate was made from: by how much its predictions of that are worse than is stated, horizon by
        horizon, is then part of the bands.
    starts : int
        Most starts of predictions ahead, over all segments.
    anew : bool
        Whether thrust, fin trims and ballast, as far as they are estimated, are those of each run, also where the
        estimate has them as constants.
    reference : Estimate, optional
        Of the smoother from the same data as the estimate, by which it is judged.

    Raises
    ------
    DataError
        If the estimate did not end well, no segment has a usable sensor, or all are too short to predict anything.
    """
    if not estimate.completed:
        raise DataError(f"the estimate {estimate.status}: it is no model to be validated")
    models = models_of(estimate)
    followed, too_short = _follow(segments, estimate, starts, anew)
    if not followed:
        raise DataError(too_short[0])
    sizes = signal_sizes([segment.signals for segment in followed])
    free = [fit_free_runs(segment.prepared, segment.signals, models, segment.states) for segment in followed]
    rng = np.random.default_rng(estimate.experiment.seed)
    left_out = errors_of_each_run(estimate.experiment.identification, anew)
    bundle = _bundle(models, drawn_models(estimate, DRAWS, rng, left_out), estimate.coefficient_set.symbols)
    collected = _predict(followed, bundle, rng)
    growth = {} if training is None else _growth(training, estimate, bundle, starts, rng, anew).in_motion(sizes)
    rows = [*free_run_rows(free, sizes), *rows_ahead(collected, bundle.names, sizes, growth)]
    numbers = [
        number
        for segment, its_run in zip(followed, free, strict=True)
        for number in manoeuvre_numbers(segment.prepared.dataset.inputs, segment.signals, its_run.run)
    ]
    remarks = [
        *too_short,
        *_remarks(segments[0], estimate, [segment.states for segment in followed], collected.blown_up, anew),
        *_unknown_growth(training),
        *_without_a_gyroscope(followed),
        *_taken_as_level(numbers, sizes),
    ]
    longest = max(range(len(followed)), key=lambda k: followed[k].length)
    return Validation(
        estimate.filter,
        judge_one(estimate, reference),
        rows,
        numbers,
        Checks(verdicts(estimate.filter, rows, _largest(its_run.excursion for its_run in free), *_doubts(followed))),
        followed[longest].prepared.dataset,
        free[longest].run,
        remarks,
    )


def _follow(
    segments: Sequence[Dataset], estimate: Estimate, starts: int, anew: bool
) -> tuple[list[_Followed], list[str]]:
    """Filter each segment, with its share of the starts; say which are too short."""
    prepared = [prepare(with_model(segment, estimate, anew)) for segment in segments]
    signals = [measured_signals(data.measuring) for data in prepared]
    spans = [_span(data, measured) for data, measured in zip(prepared, signals, strict=True)]
    total, followed, too_short = sum(end - begin for begin, end in spans), list[_Followed](), list[str]()
    for data, measured, (begin, end) in zip(prepared, signals, spans, strict=True):
        share = ceil(starts * (end - begin) / total) if end > begin else 0
        states = filtered_initial_states(data, evenly_spaced(begin, end, share))
        if states.time.size:
            followed.append(_Followed(data, measured, states))
        else:
            too_short.append(
                f"there is no time at which a prediction can start: the measurements from {begin:g} s to {end:g} s are "
                f"too short, or this model cannot follow them ({states.status})"
            )
    return followed, too_short


def _span(prepared: PreparedData, signals: Mapping[str, MeasuredSignal]) -> tuple[float, float]:
    """Return when the motion is first known, and when the last measurement comes, s."""
    return prepared.segments[0].timelines.span[0], max(float(signal.time[-1]) for signal in signals.values())


def _predict(
    followed: Sequence[_Followed], bundle: Bundle, rng: np.random.Generator, with_process_noise: bool = True
) -> Collected:
    collected = Collected([], np.zeros(len(bundle.coefficients) - len(bundle.names), dtype=np.bool_))
    for prepared, signals, states in followed:
        collected = collected.plus(predict_ahead(prepared, signals, states, bundle, rng, with_process_noise))
    return collected


def _growth(
    training: Dataset, estimate: Estimate, bundle: Bundle, starts: int, rng: np.random.Generator, anew: bool
) -> ErrorGrowth:
    """Find by how much predictions of an estimate's own data are worse than stated."""
    own = replace(training, experiment=estimate.experiment)
    followed, _ = _follow(used_segments(own, measuring_sensors(own)), estimate, starts, anew)
    sizes = signal_sizes([segment.signals for segment in followed])
    plain, shaken = (_predict(followed, bundle, rng, noise).samples for noise in (False, True))
    return error_growth(plain, shaken, sizes)


def _doubts(followed: Sequence[_Followed]) -> tuple[dict[str, float], str]:
    """Return the largest NIS of each sensor over the segments, and how a filter ended that did not come to the end."""
    statuses = [segment.states.status for segment in followed]
    return _largest(segment.states.nis for segment in followed), min(statuses, key=lambda s: s == "completed")


def _largest(values: Iterable[Mapping[str, float]]) -> dict[str, float]:
    largest: dict[str, float] = {}
    for by_name in values:
        for name, value in by_name.items():
            largest[name] = max(value, largest.get(name, 0.0))
    return largest


def _bundle(models: Models, drawn: Draws | None, symbols: Sequence[str]) -> Bundle:
    """Bundle the models that are known by name and, behind them, what is drawn."""
    named = {name: values for name, values in models._asdict().items() if values is not None}
    table = np.array([[values[symbol] for symbol in symbols] for values in named.values()])
    errors = np.zeros((len(named), len(NO_ERRORS)))
    if drawn is not None:
        table, errors = np.vstack([table, drawn.coefficients]), np.vstack([errors, drawn.errors])
    return Bundle(tuple(named), table, errors)


def _remarks(
    dataset: Dataset, estimate: Estimate, states: Sequence[InitialStates], blown_up: NDArray[np.bool_], anew: bool
) -> Iterator[str]:
    if other := other_vehicle(dataset, estimate):
        yield (
            f"the dataset states another vehicle ({', '.join(other)} differ); the model is the estimate's, of "
            f"{estimate.experiment.vehicle.name}"
        )
    if own := own_of_each_run(estimate.experiment.identification, anew):
        yield (
            f"{', '.join(own)}: of each run its own, as the filter that finds the starts has it by then (free run: "
            f"by the end), {'as asked for' if anew else 'for it walks'}"
        )
    if (noise_factor := max(found.noise_factor for found in states)) > 1.0:
        yield (
            f"the filter that finds where predictions start got {noise_factor:g} times the process noise of the "
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
            "the data that the estimate was made from are not at hand: process noise alone, and not the errors of "
            "predicting them, says how bands grow"
        )


def _without_a_gyroscope(followed: Sequence[_Followed]) -> Iterator[str]:
    if any("r" in segment.signals and "gyroscope" not in segment.prepared.measuring for segment in followed):
        yield "no gyroscope measures r: it is taken from how the attitude changes over a second"


def _taken_as_level(numbers: Sequence[ManoeuvreNumber], signals: Collection[str]) -> Iterator[str]:
    unmeasured = [symbol for symbol in TILT if symbol not in signals]
    if unmeasured and any(row.number == "radius" for row in numbers):
        lacking = " or ".join(unmeasured)
        yield f"turns are taken as level, their speed as that along the path: no sensor measures {lacking}"
