"""Predictions of a segment: free runs of each model to the end of the data, and predictions over horizons."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.extra_states import BiasName
from auvid_cli.evaluation.free_run import Keeper, free_motion, measured_motion
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.timeline import Timelines
from auvid_cli.validation.initial_states import InitialStates, Models
from auvid_cli.validation.manoeuvres import turning_times
from auvid_cli.validation.motion_prediction import (
    SAME,
    Disturbance,
    MeasuredSignal,
    ProcessNoise,
    SignalSize,
    is_angle,
    move_side_by_side,
    unchanged_motion,
)
from auvid_cli.validation.results import AHEAD, FREE_RUN, LEGS, TURNS, Prediction, PredictionFit, independent_errors
from auvid_cli.vehicle.parameters import DEPTH, MOTION_AND_DEPTH, MOTION_AND_DEPTH_SYMBOLS, N_MOTION, ActuatorErrors
from auvid_cli.vehicle.rigid_body import Ballast, mass_matrix

# Times of events, s, and predicted measurements, shape (events, 10), chunk by chunk.
_Run: TypeAlias = Iterator[tuple[Array, Array]]
_WITHOUT_RESTORING = "psi", DEPTH.symbol  # errors of the model accumulate in these signals
HORIZONS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # s
FEWEST_STARTS = 10  # of a horizon
MAX_FINITE = 1e100  # SI; larger motions have diverged, their squares are still finite
_MAX_DELAY_RATIO = 1.5  # of the compared measurement's time after the start, to the horizon
_BAND_SIGMAS = 2.0
_MAX_SETTLING_TIME = 5.0  # s, of the filter before the first start
_MAX_SETTLING_SHARE = 0.1  # of the data


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


class Target(NamedTuple):
    """A measurement to predict: horizon and time, s; column of motion and depth; value and standard deviation, SI."""

    horizon: float
    column: int
    time: float
    measurement: float
    deviation: float


class Bundle(NamedTuple):
    """Models that are simulated side by side."""

    # Names of the first rows, the identified model first; further rows are drawn from its uncertainty
    names: tuple[str, ...]
    coefficients: Array  # shape (n, 22 + terms); SI
    errors: Array  # shape (n, 5); added to thrust, fins and ballast of a start, in the order of `NO_ERRORS`
    parameters: tuple[dict[str, float], ...]  # added to known parameters, by symbol, SI, for each row


class Sample(NamedTuple):
    """Predictions of one target, SI."""

    target: Target
    named: Array  # shape (names,); by the named models
    unchanged: float  # by the unchanged motion
    variance: float  # stated variance of the error; NaN without draws
    turning: bool | None = None  # whether the vehicle turns meanwhile; None if no sensor shows it


class Collected(NamedTuple):
    """Samples of all starts, and which of the draws diverged, shape (draws,)."""

    samples: list[Sample]
    blown_up: NDArray[np.bool_]

    def plus(self, other: "Collected") -> "Collected":
        """Return the samples of both segments."""
        return Collected(self.samples + other.samples, self.blown_up | other.blown_up)


def evenly_spaced(begin: float, end: float, most: int) -> Array:
    """Return start times, s, between the convergence of the filter and the shortest horizon before the end."""
    first = begin + min(_MAX_SETTLING_TIME, _MAX_SETTLING_SHARE * (end - begin))
    last = end - HORIZONS[0]
    return np.linspace(first, last, most) if last > first else np.zeros(0)


def targets_of(signals: Mapping[str, MeasuredSignal], start: float) -> list[Target]:
    """Return the first measurement of each signal at or after each horizon."""
    targets = []
    for symbol, signal in signals.items():
        for horizon in HORIZONS:
            i = signal.since(start + horizon)
            if i < signal.time.size and signal.time[i] <= start + _MAX_DELAY_RATIO * horizon:
                at, measurement = float(signal.time[i]), float(signal.values[i])
                column = MOTION_AND_DEPTH_SYMBOLS.index(symbol)
                targets.append(Target(horizon, column, at, measurement, signal.deviation))
    return targets


def predict_ahead(
    prepared: PreparedData,
    signals: Mapping[str, MeasuredSignal],
    starts: InitialStates,
    bundle: Bundle,
    rng: np.random.Generator,
    with_process_noise: bool = True,
) -> Collected:
    """Predict measurements from every start, with the sensors' errors and the current that are known there.

    The variance contains, as independent, the uncertainty of coefficients, start, measurements and their additive
    errors, of an estimated disturbance, and process noise unless switched off. It lacks the uncertainty of the current
    and of the DVL's scale and yaw, and their correlation with the velocity at the start: the filter knows the velocity
    over ground better than the part through the water.

    Parameters
    ----------
    prepared : PreparedData
        One segment from `with_model`.
    signals : mapping of MeasuredSignal
        Signals of its sensors.
    starts : InitialStates
    bundle : Bundle
        Drawn models also start from a motion that is drawn from the uncertainty of the start.
    rng : numpy.random.Generator
    with_process_noise : bool
        Whether drawn models have process noise.
    """
    vehicle, named = prepared.experiment.vehicle, len(bundle.names)
    known, terms = vehicle.known_parameters(), vehicle.coefficient_set.terms
    parameters = [known | {symbol: known[symbol] + by for symbol, by in own.items()} for own in bundle.parameters]
    drawn = len(bundle.coefficients) - named
    collected = Collected([], np.zeros(drawn, dtype=np.bool_))
    turns = turning_times(signals)
    noise = ProcessNoise(slice(named, named + drawn), starts.process_noise, rng) if with_process_noise else None
    for k, start in enumerate(starts.time):
        targets = targets_of(signals, float(start))
        if not targets:
            continue
        wanted = np.unique([target.time for target in targets])
        motion = np.tile(starts.motion[k], (len(bundle.coefficients), 1))
        motion[named:] += starts.deviation[k] * rng.standard_normal((drawn, len(MOTION_AND_DEPTH)))
        vehicle_errors = starts.vehicle[k] + bundle.errors
        vehicle_errors[named:] += starts.vehicle_deviation[k] * rng.standard_normal((drawn, vehicle_errors.shape[1]))
        timelines = prepared.segments[0].timelines.between(float(start), float(wanted[-1]))
        disturbance = _disturbance(prepared, starts, k, slice(named, named + drawn), rng)
        moved = timelines, motion, bundle.coefficients, parameters, wanted
        predicted = move_side_by_side(*moved, noise, disturbance, vehicle_errors, terms)
        collected.blown_up[:] |= ~np.isfinite(predicted[:, named:]).all(axis=(0, 2))
        errors = starts.errors[k]
        unchanged = measured_motion(unchanged_motion(wanted - start, starts.motion[k]), errors)
        read, first = measured_motion(predicted, errors), measured_motion(starts.motion[k], errors)
        for target in targets:
            at, column = int(np.searchsorted(wanted, target.time)), target.column
            symbol = MOTION_AND_DEPTH_SYMBOLS[column]
            whole_turns = signals[symbol].turns(float(start), first[column]) if is_angle(symbol) else 0.0
            lanes = read[at, :, column] + whole_turns
            noise_variance = target.deviation**2 + starts.errors_deviation[k].offset[column] ** 2
            variance = _variance(lanes[named:], lanes[0]) + noise_variance
            turning = None if turns is None else turns.at(target.time)
            same = unchanged[at, column] + whole_turns
            collected.samples.append(Sample(target, lanes[:named], same, variance, turning))
    return collected


def _disturbance(
    prepared: PreparedData, starts: InitialStates, k: int, drawn: slice, rng: np.random.Generator
) -> Disturbance | None:
    """Return the disturbance of the models at a start, drawn from its uncertainty for drawn models; None if unused."""
    estimated = prepared.experiment.identification.estimate
    if BiasName.DISTURBANCE not in estimated.biases:
        return None
    deviation, time_constant = np.array(estimated.disturbance.per_axis()).T
    force = np.tile(starts.force[k][:, None], drawn.stop)
    force[:, drawn] += starts.force_deviation[k][:, None] * rng.standard_normal(force[:, drawn].shape)
    inverse = np.linalg.inv(mass_matrix(prepared.experiment.vehicle.known_parameters())).astype(np.float64)
    return Disturbance(drawn, force, deviation, time_constant, inverse, rng)


def _variance(drawn: Array, centre: float) -> float:
    """Return the mean square distance of finite draws from the identified model; NaN if half of them diverged."""
    finite = drawn[np.abs(drawn) < MAX_FINITE]
    return float(np.square(finite - centre).mean()) if finite.size > 0.5 * drawn.size else np.nan


def rows_ahead(
    collected: Collected,
    names: Sequence[str],
    sizes: Mapping[str, SignalSize],
    growth: Mapping[tuple[str, float], float],
    by_file: Sequence[Sample] = (),
) -> Iterator[Prediction]:
    """Yield one row per kind, signal and horizon with enough starts.

    The fit is relative to the measurements of the whole run at every horizon, because the compared ones may all be in a
    steady turn. `growth` is a variance that is added to the stated one, by signal and horizon. `by_file` are the
    predictions by the vehicle file, whose named model is the only one.
    """
    drawn, blown_up = collected.blown_up.size, int(collected.blown_up.sum())
    of_model, of_file = _by_place(collected.samples), _by_place(by_file)
    for kind, horizon, symbol in ((k, h, s) for k in (AHEAD, TURNS, LEGS) for h in HORIZONS for s in sizes):
        samples, size = of_model.get((kind, horizon, symbol), []), sizes[symbol]
        if len(samples) < FEWEST_STARTS:
            continue
        measured = np.array([sample.target.measurement for sample in samples])
        predicted = np.array([sample.named for sample in samples])
        fits = {name: PredictionFit.of(measured, predicted[:, i]) for i, name in enumerate(names)}
        whole = fits["identified"]._replace(spread=len(samples) * size.variance)
        deviation = np.sqrt([sample.variance + growth.get((symbol, horizon), 0.0) for sample in samples])
        has_band = bool(np.isfinite(deviation).all() and fits["identified"].rmse is not None)
        errors = (measured - predicted[:, 0]) / deviation if has_band else np.zeros(0)
        yield Prediction(
            signal=symbol,
            unit=MOTION_AND_DEPTH[MOTION_AND_DEPTH_SYMBOLS.index(symbol)].unit,
            kind=kind,
            horizon_s=horizon,
            measurements=len(samples),
            noise=size.deviation,
            fit_percent=whole.percent,
            rmse=fits["identified"].rmse,
            prior_rmse=fits["prior"].rmse if "prior" in fits else None,
            vehicle_file_rmse=_rmse(of_file.get((kind, horizon, symbol), [])),
            constant_velocity_rmse=PredictionFit.of(measured, np.array([sample.unchanged for sample in samples])).rmse,
            expected_rmse=float(np.sqrt(np.square(deviation).mean())) if has_band else None,
            share_within_band=float((np.abs(errors) <= _BAND_SIGMAS).mean()) if has_band else None,
            draws=drawn,
            draws_blown_up=blown_up,
            independent=independent_errors(errors) if has_band else None,
        )


def _by_place(samples: Sequence[Sample]) -> dict[tuple[str, float, str], list[Sample]]:
    """Return samples by kind, horizon and signal."""
    places: dict[tuple[str, float, str], list[Sample]] = {}
    for sample in samples:
        symbol = MOTION_AND_DEPTH_SYMBOLS[sample.target.column]
        for kind in (AHEAD, *([] if sample.turning is None else [TURNS if sample.turning else LEGS])):
            places.setdefault((kind, sample.target.horizon, symbol), []).append(sample)
    return places


def _rmse(samples: Sequence[Sample]) -> float | None:
    """Return the RMSE of the first named model."""
    measured, predicted = ([s.target.measurement for s in samples], [float(s.named[0]) for s in samples])
    return PredictionFit.of(np.array(measured), np.array(predicted)).rmse
