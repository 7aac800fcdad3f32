"""Growth of the errors of predictions with the horizon, in excess of the stated uncertainty."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.validation.horizons import HORIZONS, MAX_FINITE, Sample
from auvid_cli.validation.motion_prediction import SignalSize
from auvid_cli.validation.results import independent_errors
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS

_MIN_ERRORS = 20  # of a mean square: its standard error is then about a third
_MIN_SIGMAS_ANY = 3.5  # excess of the mean square of any of ten signals that is significant, standard deviations
_MIN_SIGMAS_OTHER = 2.0  # the same of each signal, if any is significant
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
