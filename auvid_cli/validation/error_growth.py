"""How predictions of the data that a model was made from go wrong beyond what is stated, signal by signal and horizon.

What the model lacks, and disturbances that last, are in the errors of the coefficients' own data as well. White process
noise stands for them from one measurement to the next; over seconds errors that last grow otherwise, and data say how.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.validation.horizon_prediction import HORIZONS, LARGEST, Sample
from auvid_cli.validation.independence import independent_errors
from auvid_cli.validation.signals import SignalSize
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS

Array = NDArray[np.float64]

# So many errors say how large they are to a fifth.
_FEWEST = 20
# Standard deviations by which the mean square of one signal, of ten, is more than chance; where it is, that of another.
_SIGMAS_OF_ANY, _SIGMAS = 3.5, 2.0
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
        grows, largest, lasting, noise = is_lacking and beyond[symbol] > _SIGMAS, 0.0, 0.0, 0.0
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
