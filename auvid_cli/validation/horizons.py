"""Predictions over horizons, and the growth of their errors."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.extra_states import BiasName
from auvid_cli.evaluation.free_run import measured_motion
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.validation.initial_states import InitialStates
from auvid_cli.validation.motion_prediction import (
    Disturbance,
    MeasuredSignal,
    ProcessNoise,
    SignalSize,
    is_angle,
    move_side_by_side,
    unchanged_motion,
)
from auvid_cli.validation.results import AHEAD, Prediction, PredictionFit, independent_errors
from auvid_cli.vehicle.matrices import mass_matrix
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH, MOTION_AND_DEPTH_SYMBOLS

HORIZONS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # s
FEWEST_STARTS = 10  # of a horizon
MAX_FINITE = 1e100  # SI; larger motions have diverged, their squares are still finite
_MAX_DELAY_RATIO = 1.5  # of the compared measurement's time after the start, to the horizon
_BAND_SIGMAS = 2.0
_MIN_ERRORS = 20  # of a mean square: its standard error is then about a third
_MIN_SIGMAS_ANY = 3.5  # excess of the mean square of any of ten signals that is significant, standard deviations
_MIN_SIGMAS_OTHER = 2.0  # the same of each signal, if any is significant
_MAX_SETTLING_TIME = 5.0  # s, of the filter before the first start
_MAX_SETTLING_SHARE = 0.1  # of the data
_TURNS = ("v", "w", "q", "r")
# By signal: motion that its errors are proportional to. An angle depends on its rate, depth on pitch and heave; turns
# in either plane slow a vehicle down and roll it.
_GROWS_WITH = {
    "u": ("u", *_TURNS),
    "p": ("p", *_TURNS),
    "phi": ("p", *_TURNS),
    "theta": ("q",),
    "psi": ("r",),
    "down": ("w", "q"),
}
# A turn to either side slows a vehicle down equally: errors of this signal are proportional to the square of turns.
_SQUARED_SIGNAL = "u"


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


class Collected(NamedTuple):
    """Samples of all starts, and which of the draws diverged, shape (draws,)."""

    samples: list[Sample]
    blown_up: NDArray[np.bool_]

    def plus(self, other: "Collected") -> "Collected":
        """Return the samples of both segments."""
        return Collected(self.samples + other.samples, self.blown_up | other.blown_up)


def evenly_spaced(begin: float, end: float, most: int) -> Array:
    """Return start times, s, from when the filter has settled to the shortest horizon before the end."""
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
            turns = signals[symbol].turns(float(start), first[column]) if is_angle(symbol) else 0.0
            lanes = read[at, :, column] + turns
            noise_variance = target.deviation**2 + starts.errors_deviation[k].offset[column] ** 2
            variance = _variance(lanes[named:], lanes[0]) + noise_variance
            collected.samples.append(Sample(target, lanes[:named], unchanged[at, column] + turns, variance))
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
) -> Iterator[Prediction]:
    """Yield one row per signal and horizon with enough starts.

    The fit is relative to the measurements of the whole run at every horizon, because the compared ones may all be in a
    steady turn. `growth` is a variance that is added to the stated one, by signal and horizon.
    """
    drawn, blown_up = collected.blown_up.size, int(collected.blown_up.sum())
    for horizon in HORIZONS:
        for symbol, size in sizes.items():
            column = MOTION_AND_DEPTH_SYMBOLS.index(symbol)
            samples = [s for s in collected.samples if s.target.horizon == horizon and s.target.column == column]
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
                unit=MOTION_AND_DEPTH[column].unit,
                kind=AHEAD,
                horizon_s=horizon,
                measurements=len(samples),
                noise=size.deviation,
                fit_percent=whole.percent,
                rmse=fits["identified"].rmse,
                prior_rmse=fits["prior"].rmse if "prior" in fits else None,
                vehicle_file_rmse=fits["vehicle_file"].rmse if "vehicle_file" in fits else None,
                constant_velocity_rmse=PredictionFit.of(
                    measured, np.array([sample.unchanged for sample in samples])
                ).rmse,
                expected_rmse=float(np.sqrt(np.square(deviation).mean())) if has_band else None,
                share_within_band=float((np.abs(errors) <= _BAND_SIGMAS).mean()) if has_band else None,
                draws=drawn,
                draws_blown_up=blown_up,
                independent=independent_errors(errors) if has_band else None,
            )


class ErrorGrowth(NamedTuple):
    """Variance of errors in excess of the stated one, and the motion of the vehicle meanwhile.

    Effects that the model lacks are proportional to the motion (missing drag, nonlinear lift), in surge to its square.
    """

    variance: dict[tuple[str, float], float]  # excess by signal and horizon, s; SI
    # The part due to a constant error (a weight or a trim that the model lacks), independent of the motion
    steady: dict[tuple[str, float], float]
    by_process_noise: dict[tuple[str, float], float]  # variance due to process noise, independent of the motion
    moved: dict[str, float]  # variance of each signal without noise, SI

    def in_motion(self, sizes: Mapping[str, SignalSize]) -> dict[tuple[str, float], float]:
        """Return the variance in excess of process noise for other data, SI, scaled by their motion."""
        moved = _moved(sizes)
        ratio = {symbol: moved[symbol] / self.moved[symbol] for symbol in moved if symbol in self.moved}

        def grown(symbol: str, other: str) -> float:
            return ratio[other] ** 2 if symbol == _SQUARED_SIGNAL != other else ratio[other]

        scale = {
            symbol: max((grown(symbol, k) for k in _GROWS_WITH.get(symbol, (symbol,)) if k in ratio), default=1.0)
            for symbol in sizes
        }
        grown_by_motion = {
            (symbol, h): scale[symbol] * v + max(1.0 - scale[symbol], 0.0) * self.steady[symbol, h]
            for (symbol, h), v in self.variance.items()
            if symbol in scale
        }
        return {place: max(v - self.by_process_noise[place], 0.0) for place, v in grown_by_motion.items()}


def error_growth(samples: Sequence[Sample], noisy: Sequence[Sample], sizes: Mapping[str, SignalSize]) -> ErrorGrowth:
    """Return the significant excess of mean squared errors over the stated variance; it never falls with the horizon.

    Horizons with too few starts have the excess of the longest other one.

    Parameters
    ----------
    samples, noisy : sequence of Sample
        Predictions of the estimate's own data from many starts, with variances without and with process noise.
    sizes : mapping of SignalSize
        Sizes of the signals of these data.
    """
    of_signals = {
        symbol: [
            (plain, other)
            for plain, other in zip(samples, noisy, strict=True)
            if MOTION_AND_DEPTH_SYMBOLS[plain.target.column] == symbol
        ]
        for symbol in sizes
    }
    errors = {symbol: _Errors.by_horizon([plain for plain, _ in own]) for symbol, own in of_signals.items()}
    sigmas = {symbol: _excess_sigmas([*by_horizon.values()]) for symbol, by_horizon in errors.items()}
    # One of ten signals exceeds two standard deviations by chance.
    is_significant = max(sigmas.values(), default=0.0) > _MIN_SIGMAS_ANY
    variance, steady, by_process_noise = {}, {}, {}
    for symbol, by_horizon in errors.items():
        grows = is_significant and sigmas[symbol] > _MIN_SIGMAS_OTHER
        largest, constant, noise = 0.0, 0.0, 0.0
        for horizon in HORIZONS:
            if horizon in by_horizon:
                added = [
                    other.variance - plain.variance
                    for plain, other in of_signals[symbol]
                    if plain.target.horizon == horizon
                ]
                found = by_horizon[horizon]
                if grows and found.excess > largest:
                    largest, constant = found.excess, min(found.squared_mean, found.excess)
                noise = max(noise, float(np.mean(added)))
            variance[symbol, horizon], steady[symbol, horizon] = largest, constant
            by_process_noise[symbol, horizon] = noise
    return ErrorGrowth(variance, steady, by_process_noise, _moved(sizes))


class _Errors(NamedTuple):
    """Errors of one signal at one horizon, SI, by start, and their stated variance."""

    error: Array
    stated: Array

    @classmethod
    def by_horizon(cls, samples: Sequence[Sample]) -> "dict[float, _Errors]":
        """Return the errors at each horizon with enough starts and without a diverged model."""
        found = {}
        for horizon in HORIZONS:
            own = [sample for sample in samples if sample.target.horizon == horizon]
            error = np.array([sample.target.measurement - sample.named[0] for sample in own])
            stated = np.array([sample.variance for sample in own])
            if len(own) >= _MIN_ERRORS and (np.abs(error) < MAX_FINITE).all() and np.isfinite(stated).all():
                found[horizon] = cls(error, stated)
        return found

    @property
    def excess(self) -> float:
        """Return the excess of the mean square over the stated variance."""
        return float(np.mean(self.error**2 - self.stated))

    @property
    def squared_mean(self) -> float:
        """Return the square of the mean, without the part due to chance."""
        independent = independent_errors(self.error - self.error.mean())
        return max(float(self.error.mean() ** 2 - self.error.var() / independent), 0.0)


def _excess_sigmas(horizons: Sequence[_Errors]) -> float:
    """Return the excess of a signal's squared errors over all horizons, in standard deviations of chance."""
    normalised = [errors.error / np.sqrt(errors.stated) for errors in horizons]
    if not normalised:
        return 0.0
    independent = sum(independent_errors(errors) for errors in normalised)
    return (float(np.mean(np.concatenate(normalised) ** 2)) - 1.0) / np.sqrt(2.0 / independent)


def _moved(sizes: Mapping[str, SignalSize]) -> dict[str, float]:
    """Return the variance of each signal without noise; at least that of the noise."""
    return {symbol: max(s.variance - s.deviation**2, s.deviation**2) for symbol, s in sizes.items()}
