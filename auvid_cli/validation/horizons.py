"""Predictions over horizons, and the growth of their errors."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.extra_states import BiasName
from auvid_cli.evaluation.free_run import measured_motion
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.validation.initial_states import InitialStates
from auvid_cli.validation.motion_prediction import (
    Disturbed,
    DisturbedModels,
    MeasuredSignal,
    SignalSize,
    is_angle,
    move_side_by_side,
    unchanged_motion,
)
from auvid_cli.validation.results import AHEAD, Prediction, PredictionFit, independent_errors
from auvid_cli.vehicle.matrices import mass_matrix
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH, MOTION_AND_DEPTH_SYMBOLS

Array = NDArray[np.float64]
HORIZONS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
# A horizon needs so many starts whose measurements it reaches.
FEWEST_STARTS = 10
# Beyond this a motion counts as blown up: its square is still a number.
LARGEST = 1e100
# The measurement that is compared comes at the horizon or, at the latest, so many times as long after the start.
_LATEST = 1.5
_HORIZON_SIGMAS = 2.0
# So many errors say how large they are to a fifth.
_FEWEST = 20
# Standard deviations by which the mean square of one signal, of ten, is more than chance; where it is, that of another.
_SIGMAS_OF_ANY, _GROWTH_SIGMAS = 3.5, 2.0
# What an error of a signal grows with: an angle's with its rate, that of the depth with what pitches and heaves; turns
# in either plane slow a vehicle down and roll it.
_TURNS = ("v", "w", "q", "r")
_GROWS_WITH = {
    "u": ("u", *_TURNS),
    "p": ("p", *_TURNS),
    "phi": ("p", *_TURNS),
    "theta": ("q",),
    "psi": ("r",),
    "down": ("w", "q"),
}
# A turn to either side, or up or down, slows a vehicle down by the same: what a model lacks there is of second order.
_BY_SQUARES = "u"


class Target(NamedTuple):
    """A measurement to be predicted: the horizon, s, the column of motion and depth, when, and what it says, SI."""

    horizon: float
    column: int
    time: float
    measurement: float
    deviation: float


class Bundle(NamedTuple):
    """Models that are moved side by side.

    Attributes
    ----------
    names : tuple of str
        Those of the first rows, the identified model first; the other rows are drawn from its uncertainty.
    coefficients : ndarray, shape (n, 22 + terms)
        SI.
    errors : ndarray, shape (n, 5)
        What adds to thrust, fins and ballast of a start, by the order of `NO_ERRORS`.
    """

    names: tuple[str, ...]
    coefficients: Array
    errors: Array


class Sample(NamedTuple):
    """Predictions at one target.

    Attributes
    ----------
    named : ndarray, shape (names,)
        Predictions of the named models, SI.
    unchanged : float
        Prediction of a motion that goes on as it is.
    variance : float
        Of the error, as stated; NaN without draws.
    """

    target: Target
    named: Array
    unchanged: float
    variance: float


class Collected(NamedTuple):
    """Samples of all starts, and which of the draws blew up."""

    samples: list[Sample]
    blown_up: NDArray[np.bool_]

    def plus(self, other: "Collected") -> "Collected":
        """Join those of another segment."""
        return Collected(self.samples + other.samples, self.blown_up | other.blown_up)


def evenly_spaced(begin: float, end: float, most: int) -> Array:
    """Return times to start at, s, some time after the filter has begun and a shortest horizon before the end."""
    settled = begin + min(5.0, 0.1 * (end - begin))
    last = end - HORIZONS[0]
    return np.linspace(settled, last, most) if last > settled else np.zeros(0)


def targets_of(signals: Mapping[str, MeasuredSignal], start: float) -> list[Target]:
    """Find the first measurement of each signal at or after each horizon."""
    targets = []
    for symbol, signal in signals.items():
        for horizon in HORIZONS:
            i = signal.since(start + horizon)
            if i < signal.time.size and signal.time[i] <= start + _LATEST * horizon:
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

    The variance holds how unsure coefficients, start, measurements and their additive errors are, each by itself, what
    disturbs the motion where that is estimated, and process noise if asked. It leaves out the uncertainty of
    the current and of the DVL's scale and yaw, and that these go with the start's velocity: what the filter knows well
    is the velocity over ground, less well its share through the water.

    Parameters
    ----------
    prepared : PreparedData
        From `with_model`, one segment.
    signals : mapping
        Of its measuring sensors.
    starts : InitialStates
    bundle : Bundle
        A drawn model also starts from a motion that is drawn from the uncertainty of the start.
    rng : numpy.random.Generator
    with_process_noise : bool
        Whether that moves drawn models.
    """
    vehicle, named = prepared.experiment.vehicle, len(bundle.names)
    parameters, terms = vehicle.known_parameters(), vehicle.coefficient_set.terms
    drawn = len(bundle.coefficients) - named
    collected = Collected([], np.zeros(drawn, dtype=np.bool_))
    shaken = DisturbedModels(slice(named, named + drawn), starts.process_noise, rng) if with_process_noise else None
    for k, start in enumerate(starts.time):
        targets = targets_of(signals, float(start))
        if not targets:
            continue
        wanted = np.unique([target.time for target in targets])
        motion = np.tile(starts.motion[k], (len(bundle.coefficients), 1))
        motion[named:] += starts.deviation[k] * rng.standard_normal((drawn, len(MOTION_AND_DEPTH)))
        beyond = starts.vehicle[k] + bundle.errors
        beyond[named:] += starts.vehicle_deviation[k] * rng.standard_normal((drawn, beyond.shape[1]))
        timelines = prepared.segments[0].timelines.between(float(start), float(wanted[-1]))
        disturbed = _disturbed(prepared, starts, k, slice(named, named + drawn), rng)
        moved = timelines, motion, bundle.coefficients, parameters, wanted
        predicted = move_side_by_side(*moved, shaken, disturbed, beyond, terms)
        collected.blown_up[:] |= ~np.isfinite(predicted[:, named:]).all(axis=(0, 2))
        errors = starts.errors[k]
        unchanged = measured_motion(unchanged_motion(wanted - start, starts.motion[k]), errors)
        read, first = measured_motion(predicted, errors), measured_motion(starts.motion[k], errors)
        for target in targets:
            at, column = int(np.searchsorted(wanted, target.time)), target.column
            symbol = MOTION_AND_DEPTH_SYMBOLS[column]
            turns = signals[symbol].turns(float(start), first[column]) if is_angle(symbol) else 0.0
            lanes = read[at, :, column] + turns
            noise = target.deviation**2 + starts.errors_deviation[k].offset[column] ** 2
            variance = _variance(lanes[named:], lanes[0]) + noise
            collected.samples.append(Sample(target, lanes[:named], unchanged[at, column] + turns, variance))
    return collected


def _disturbed(
    prepared: PreparedData, starts: InitialStates, k: int, drawn: slice, rng: np.random.Generator
) -> Disturbed | None:
    """Return what disturbs the models from a start on, as unsure as it is there for those that are drawn, or None."""
    estimated = prepared.experiment.identification.estimate
    if BiasName.DISTURBANCE not in estimated.biases:
        return None
    deviation, time_constant = np.array(estimated.disturbance.per_axis()).T
    force = np.tile(starts.force[k][:, None], drawn.stop)
    force[:, drawn] += starts.force_deviation[k][:, None] * rng.standard_normal(force[:, drawn].shape)
    inverse = np.linalg.inv(mass_matrix(prepared.experiment.vehicle.known_parameters())).astype(np.float64)
    return Disturbed(drawn, force, deviation, time_constant, inverse, rng)


def _variance(drawn: Array, centre: float) -> float:
    """Return the mean square about the identified model of the draws that did not blow up; NaN if they are too few."""
    sound = drawn[np.abs(drawn) < LARGEST]
    return float(np.square(sound - centre).mean()) if sound.size > 0.5 * drawn.size else np.nan


def rows_ahead(
    collected: Collected,
    names: Sequence[str],
    sizes: Mapping[str, SignalSize],
    growth: Mapping[tuple[str, float], float],
) -> Iterator[Prediction]:
    """Yield a row for each horizon that is reached often enough, and signal.

    The fit relates errors to how far the measurements of the whole run are from their mean, at every horizon alike:
    those that are compared may all be of a steady turn. `growth` is a variance to add to the stated one, by motion
    symbol and horizon.
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
                symbol,
                MOTION_AND_DEPTH[column].unit,
                AHEAD,
                horizon,
                len(samples),
                size.deviation,
                whole.percent,
                fits["identified"].rmse,
                fits["prior"].rmse if "prior" in fits else None,
                fits["vehicle_file"].rmse if "vehicle_file" in fits else None,
                PredictionFit.of(measured, np.array([sample.unchanged for sample in samples])).rmse,
                float(np.sqrt(np.square(deviation).mean())) if has_band else None,
                float((np.abs(errors) <= _HORIZON_SIGMAS).mean()) if has_band else None,
                drawn,
                blown_up,
                independent_errors(errors) if has_band else None,
            )


class ErrorGrowth(NamedTuple):
    """Variance of errors beyond what is stated, and how much the vehicle moved while they were made.

    What a model lacks is felt in proportion to the motion: drag that is missing, lift that is not linear; in surge, to
    the square of what turns.

    Attributes
    ----------
    variance : dict of float
        By motion symbol and horizon, s; SI.
    steady : dict of float
        Of it what is the square of their mean: what a weight or a trim makes that the model lacks, and is there however
        little the vehicle moves.
    by_process_noise : dict of float
        Of it what process noise makes, which is there whether or not the vehicle moves.
    moved : dict of float
        Variance of the motion behind each signal, SI.
    """

    variance: dict[tuple[str, float], float]
    steady: dict[tuple[str, float], float]
    by_process_noise: dict[tuple[str, float], float]
    moved: dict[str, float]

    def in_motion(self, sizes: Mapping[str, SignalSize]) -> dict[tuple[str, float], float]:
        """Return the variance for other data beyond process noise, SI: as there is more, or less, that moves."""
        moved = _moved(sizes)
        ratio = {symbol: moved[symbol] / self.moved[symbol] for symbol in moved if symbol in self.moved}

        def grown(symbol: str, other: str) -> float:
            return ratio[other] ** 2 if symbol == _BY_SQUARES != other else ratio[other]

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


def error_growth(samples: Sequence[Sample], shaken: Sequence[Sample], sizes: Mapping[str, SignalSize]) -> ErrorGrowth:
    """Find by how much mean squares of errors exceed what is stated, but by chance; never less than at a shorter one.

    Horizons beyond the data, and those that too few starts reach, get what the longest one has.

    Parameters
    ----------
    samples : sequence of Sample
        Predictions of the identified model's own data, from many starts; their variance without process noise.
    shaken : sequence of Sample
        The same with it.
    sizes : mapping
        Of these data, see `signal_sizes`.
    """
    of_signals = {
        symbol: [
            (sample, other)
            for sample, other in zip(samples, shaken, strict=True)
            if MOTION_AND_DEPTH_SYMBOLS[sample.target.column] == symbol
        ]
        for symbol in sizes
    }
    errors = {symbol: _Errors.by_horizon([sample for sample, _ in own]) for symbol, own in of_signals.items()}
    beyond = {symbol: _beyond_chance([*seen.values()]) for symbol, seen in errors.items()}
    # Of ten signals one is beyond two deviations now and then where nothing is wrong.
    is_lacking = max(beyond.values(), default=0.0) > _SIGMAS_OF_ANY
    variance, steady, by_process_noise = {}, {}, {}
    for symbol, seen in errors.items():
        grows, largest, lasting, noise = is_lacking and beyond[symbol] > _GROWTH_SIGMAS, 0.0, 0.0, 0.0
        for horizon in HORIZONS:
            if horizon in seen:
                added = [
                    other.variance - plain.variance
                    for plain, other in of_signals[symbol]
                    if plain.target.horizon == horizon
                ]
                if grows and seen[horizon].excess > largest:
                    largest, lasting = seen[horizon].excess, min(seen[horizon].squared_mean, seen[horizon].excess)
                noise = max(noise, float(np.mean(added)))
            variance[symbol, horizon], steady[symbol, horizon] = largest, lasting
            by_process_noise[symbol, horizon] = noise
    return ErrorGrowth(variance, steady, by_process_noise, _moved(sizes))


class _Errors(NamedTuple):
    """Errors of one signal at one horizon, SI, from start to start, and their variance as stated."""

    error: Array
    stated: Array

    @classmethod
    def by_horizon(cls, samples: Sequence[Sample]) -> "dict[float, _Errors]":
        """Collect those of the horizons that enough starts reach, and at which nothing blew up."""
        found = {}
        for horizon in HORIZONS:
            own = [sample for sample in samples if sample.target.horizon == horizon]
            error = np.array([sample.target.measurement - sample.named[0] for sample in own])
            stated = np.array([sample.variance for sample in own])
            if len(own) >= _FEWEST and (np.abs(error) < LARGEST).all() and np.isfinite(stated).all():
                found[horizon] = cls(error, stated)
        return found

    @property
    def excess(self) -> float:
        """Return by how much their mean square exceeds what is stated."""
        return float(np.mean(self.error**2 - self.stated))

    @property
    def squared_mean(self) -> float:
        """Return the square of their mean beyond what is chance."""
        independent = independent_errors(self.error - self.error.mean())
        return max(float(self.error.mean() ** 2 - self.error.var() / independent), 0.0)


def _beyond_chance(horizons: Sequence[_Errors]) -> float:
    """Return by how many standard deviations squares of a signal's errors, over all horizons, exceed what is stated."""
    shares = [each.error / np.sqrt(each.stated) for each in horizons]
    if not shares:
        return 0.0
    independent = sum(independent_errors(share) for share in shares)
    return (float(np.mean(np.concatenate(shares) ** 2)) - 1.0) / np.sqrt(2.0 / independent)


def _moved(sizes: Mapping[str, SignalSize]) -> dict[str, float]:
    """Return the variance of each signal without that of its noise; at least that."""
    return {symbol: max(s.variance - s.deviation**2, s.deviation**2) for symbol, s in sizes.items()}
