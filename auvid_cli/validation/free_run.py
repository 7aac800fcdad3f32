"""Free runs against all measurements: the identified model, earlier models, and an unchanged motion."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.evaluation.free_run import Keeper, free_motion, measured_motion
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.timeline import Timelines
from auvid_cli.validation.initial_states import InitialStates, Models
from auvid_cli.validation.motion_prediction import SAME, MeasuredSignal, SignalSize, is_angle, unchanged_motion
from auvid_cli.validation.results import FREE_RUN, Prediction, PredictionFit
from auvid_cli.vehicle.matrices import Ballast
from auvid_cli.vehicle.parameters import DEPTH, MOTION_AND_DEPTH, MOTION_AND_DEPTH_SYMBOLS, N_MOTION, ActuatorErrors

# Times of events, s, and predicted measurements, shape (events, 10), chunk by chunk.
_Run: TypeAlias = Iterator[tuple[Array, Array]]
_WITHOUT_RESTORING = "psi", DEPTH.symbol  # errors of the model accumulate in these signals


class FreeRunFit(NamedTuple):
    """Fit of the free runs to all measurements of a segment."""

    # Run of the identified model as the sensors measure it: with their errors, over ground if a current is estimated,
    # and with the depth if measured. Evenly spaced samples of a long run.
    run: FreeRun
    length: float  # s
    fits: dict[str, dict[str, PredictionFit]]  # by model and motion symbol
    # By signal except heading and depth: largest distance of the run from the mean of the measurements, divided by the
    # largest distance of the measurements; infinite if the run is not finite
    excursion: dict[str, float]


def fit_free_runs(
    prepared: PreparedData, signals: Mapping[str, MeasuredSignal], models: Models, starts: InitialStates
) -> FreeRunFit:
    """Run each model from the first of the `starts` to the end of the data, and compare with the measurements.

    A filtered start is needed: noise of the first measurements, and an attitude reference that has not converged, would
    stay in the whole run. The errors of sensors and vehicle, and the current, are those at the end of the filter; if
    they walk, their earlier values are ignored. `prepared` is one segment from `with_model`, with `signals`.
    """
    start, motion = float(starts.time[0]), starts.motion[0]
    whole = prepared.segments[0].timelines
    timelines = whole.between(start, whole.span[1])
    vehicle = prepared.experiment.vehicle
    actuators, ballast = ActuatorErrors(*starts.final_vehicle[:3]), Ballast(*starts.final_vehicle[3:])
    parameters, of_vehicle = ballast.added_to(vehicle.known_parameters()), vehicle.coefficient_set
    motions = {
        name: free_motion(timelines, motion, parameters, coefficients, actuators, of_vehicle)
        for name, coefficients in models._asdict().items()
        if coefficients
    }
    motions["constant_velocity"] = _constant_velocity(timelines, start, motion)
    errors = starts.final_errors
    predictions: dict[str, _Run] = {
        name: ((timeline.time, measured_motion(motion, errors)) for timeline, motion in run)
        for name, run in motions.items()
    }
    keeper, farthest = Keeper(prepared.measuring), _Farthest(signals)
    columns = len(MOTION_AND_DEPTH) if DEPTH.symbol in signals else N_MOTION
    predictions["identified"] = _recorded(predictions["identified"], columns, keeper, farthest)
    fits = {name: _fits(run, signals) for name, run in predictions.items()}
    return FreeRunFit(keeper.kept(), timelines.span[1] - start, fits, farthest.relative())


def free_run_rows(
    segments: Sequence[FreeRunFit], sizes: Mapping[str, SignalSize], by_file: Sequence[FreeRunFit]
) -> Iterator[Prediction]:
    """Yield one row per signal, over several segments; `by_file` are the runs of the vehicle file."""
    length = max(segment.length for segment in segments)
    for symbol, size in sizes.items():
        fits = _over(segments, symbol)
        rmse, identified = {name: fit.rmse for name, fit in fits.items()}, fits["identified"]
        yield Prediction(
            signal=symbol,
            unit=MOTION_AND_DEPTH[MOTION_AND_DEPTH_SYMBOLS.index(symbol)].unit,
            kind=FREE_RUN,
            horizon_s=length,
            measurements=identified.measurements,
            noise=size.deviation,
            fit_percent=identified.percent,
            rmse=identified.rmse,
            prior_rmse=rmse.get("prior"),
            vehicle_file_rmse=_over(by_file, symbol)["identified"].rmse if by_file else None,
            constant_velocity_rmse=rmse["constant_velocity"],
        )


def _over(segments: Sequence[FreeRunFit], symbol: str) -> dict[str, PredictionFit]:
    """Return the fit of each model to a signal over several segments."""
    fits = dict.fromkeys(segments[0].fits, PredictionFit())
    for segment in segments:
        for name, by_symbol in segment.fits.items():
            fits[name] = fits[name].with_segment(by_symbol.get(symbol, PredictionFit()))
    return fits


class _Farthest:
    """Largest distance of a run from the mean of each signal."""

    def __init__(self, signals: Mapping[str, MeasuredSignal]) -> None:
        self._signals = signals
        self._centres = np.array([signals[s].values.mean() if s in signals else 0.0 for s in MOTION_AND_DEPTH_SYMBOLS])
        self._distance = np.zeros(len(MOTION_AND_DEPTH))

    def take(self, predicted: Array) -> None:
        """Add the next chunk of the run."""
        with np.errstate(invalid="ignore"):
            self._distance = np.maximum(self._distance, np.abs(predicted - self._centres).max(axis=0))

    def relative(self) -> dict[str, float]:
        """Return the distances divided by the largest ones of the measurements, without heading and depth."""
        reach = {s: float(np.abs(g.values - g.values.mean()).max()) + g.deviation for s, g in self._signals.items()}
        return {
            symbol: float(np.nan_to_num(self._distance[column], nan=np.inf)) / reach[symbol]
            for column, symbol in enumerate(MOTION_AND_DEPTH_SYMBOLS)
            if symbol in self._signals and symbol not in _WITHOUT_RESTORING
        }


def _constant_velocity(timelines: Timelines, start: float, motion: Array) -> Iterator[tuple[Timeline, Array]]:
    angles = motion[6:9]
    for timeline in timelines:
        predicted = unchanged_motion(timeline.time - start, motion, angles)
        angles = predicted[-1, 6:9]
        yield timeline, predicted


def _recorded(run: _Run, columns: int, keeper: Keeper, farthest: _Farthest) -> _Run:
    for time, predicted in run:
        keeper.keep(time, predicted[:, :columns])
        farthest.take(predicted)
        yield time, predicted


def _fits(run: _Run, signals: Mapping[str, MeasuredSignal]) -> dict[str, PredictionFit]:
    """Return the fit of a run to each signal, chunk by chunk."""
    fits = dict.fromkeys(signals, PredictionFit())
    turns: dict[str, float] = {}
    for time, predicted in run:
        for symbol, signal in signals.items():
            in_chunk = slice(*np.searchsorted(signal.time, [time[0] - SAME, time[-1] + SAME]))
            column = MOTION_AND_DEPTH_SYMBOLS.index(symbol)
            expected = predicted[np.searchsorted(time, signal.time[in_chunk] - SAME), column]
            if is_angle(symbol) and symbol not in turns:
                turns[symbol] = signal.turns(float(time[0]), float(predicted[0, column]))
            fits[symbol] = fits[symbol].plus(
                PredictionFit.of(signal.values[in_chunk], expected + turns.get(symbol, 0.0))
            )
    return fits
