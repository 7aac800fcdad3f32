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
    moved : dict of float
        Variance of the motion behind each signal, SI.
    """

    variance: dict[tuple[str, float], float]
    moved: dict[str, float]

    def in_motion(self, sizes: Mapping[str, SignalSize]) -> dict[tuple[str, float], float]:
        """Return the variance for other data, SI, by motion symbol and horizon: in proportion to what moves there."""
        moved = _moved(sizes)
        ratio = {symbol: moved[symbol] / self.moved[symbol] for symbol in moved if symbol in self.moved}
        scale = {
            symbol: max((ratio[other] for other in _GROWS_WITH.get(symbol, (symbol,)) if other in ratio), default=1.0)
            for symbol in sizes
        }
        return {(symbol, h): scale[symbol] * v for (symbol, h), v in self.variance.items() if symbol in scale}


def error_growth(samples: Sequence[Sample], sizes: Mapping[str, SignalSize]) -> ErrorGrowth:
    """Find by how much mean squares of errors exceed what is stated; never less than at a shorter horizon.

    Horizons beyond the data, and those that too few starts reach, get what the longest one has.

    Parameters
    ----------
    samples : sequence of Sample
        Predictions of the identified model's own data, from many starts.
    sizes : mapping
        Of these data, see `signal_sizes`.
    """
    variance = {}
    for symbol in sizes:
        largest = 0.0
        for horizon in HORIZONS:
            excess = [
                (sample.target.measurement - sample.named[0]) ** 2 - sample.variance
                for sample in samples
                if (MOTION_AND_DEPTH_SYMBOLS[sample.target.column], sample.target.horizon) == (symbol, horizon)
            ]
            if len(excess) >= _FEWEST and np.isfinite(excess).all():
                largest = max(largest, float(np.mean(excess)))
            variance[symbol, horizon] = largest
    return ErrorGrowth(variance, _moved(sizes))


def _moved(sizes: Mapping[str, SignalSize]) -> dict[str, float]:
    """Return the variance of each signal without that of its noise; at least that."""
    return {symbol: max(s.variance - s.deviation**2, s.deviation**2) for symbol, s in sizes.items()}
