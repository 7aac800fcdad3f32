"""How predictions of the data that a model was made from go wrong beyond what is stated, signal by signal and horizon.

What the model lacks, and disturbances that last, are in the errors of the coefficients' own data as well. White process
noise stands for them from one measurement to the next; over seconds errors that last grow otherwise, and data say how.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.validation.horizon_prediction import HORIZONS, Sample
from auvid_cli.validation.signals import SignalSize
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS

# So many errors say how large they are to a fifth.
_FEWEST = 20
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


class ErrorGrowth(NamedTuple):
    """Variance of errors beyond what is stated, and how much the vehicle moved while they were made.

    What a model lacks is felt in proportion to the motion: drag that is missing, lift that is not linear.

    Attributes
    ----------
    variance : dict of float
        By motion symbol and horizon, s; SI.
    by_process_noise : dict of float
        Of it what process noise makes, which is there whether or not the vehicle moves.
    moved : dict of float
        Variance of the motion behind each signal, SI.
    """

    variance: dict[tuple[str, float], float]
    by_process_noise: dict[tuple[str, float], float]
    moved: dict[str, float]

    def in_motion(self, sizes: Mapping[str, SignalSize]) -> dict[tuple[str, float], float]:
        """Return the variance for other data beyond process noise, SI: in proportion to what moves there."""
        moved = _moved(sizes)
        ratio = {symbol: moved[symbol] / self.moved[symbol] for symbol in moved if symbol in self.moved}
        scale = {
            symbol: max((ratio[other] for other in _GROWS_WITH.get(symbol, (symbol,)) if other in ratio), default=1.0)
            for symbol in sizes
        }
        return {
            (symbol, h): max(scale[symbol] * v - self.by_process_noise[symbol, h], 0.0)
            for (symbol, h), v in self.variance.items()
            if symbol in scale
        }


def error_growth(samples: Sequence[Sample], shaken: Sequence[Sample], sizes: Mapping[str, SignalSize]) -> ErrorGrowth:
    """Find by how much mean squares of errors exceed what is stated; never less than at a shorter horizon.

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
    variance, by_process_noise = {}, {}
    for symbol in sizes:
        largest, noise = 0.0, 0.0
        for horizon in HORIZONS:
            pairs = [
                (sample, other)
                for sample, other in zip(samples, shaken, strict=True)
                if (MOTION_AND_DEPTH_SYMBOLS[sample.target.column], sample.target.horizon) == (symbol, horizon)
            ]
            excess = [(plain.target.measurement - plain.named[0]) ** 2 - plain.variance for plain, _ in pairs]
            added = [other.variance - plain.variance for plain, other in pairs]
            if len(pairs) >= _FEWEST and np.isfinite([excess, added]).all():
                largest, noise = max(largest, float(np.mean(excess))), max(noise, float(np.mean(added)))
            variance[symbol, horizon], by_process_noise[symbol, horizon] = largest, noise
    return ErrorGrowth(variance, by_process_noise, _moved(sizes))


def _moved(sizes: Mapping[str, SignalSize]) -> dict[str, float]:
    """Return the variance of each signal without that of its noise; at least that."""
    return {symbol: max(s.variance - s.deviation**2, s.deviation**2) for symbol, s in sizes.items()}
