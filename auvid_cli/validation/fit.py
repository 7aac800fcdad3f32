"""How well a prediction fits: sums over measurements that can be taken chunk by chunk."""

from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PredictionFit(NamedTuple):
    """Sums over measurements and their predictions.

    Attributes
    ----------
    measurements : int
        How many.
    mean : float
        Of the measurements.
    spread : float
        Sum of the squares of the measurements' deviations from their mean.
    squares : float
        Sum of the squares of the errors; not finite if a prediction is not.
    """

    measurements: int = 0
    mean: float = 0.0
    spread: float = 0.0
    squares: float = 0.0

    @classmethod
    def of(cls, measured: Array, predicted: Array) -> "PredictionFit":
        """Sum over measurements, shape (n,), and their predictions, in one unit; angles without jumps of a turn."""
        if not measured.size:
            return cls()
        mean = float(measured.mean())
        with np.errstate(over="ignore", invalid="ignore"):
            squares = float(np.square(measured - predicted).sum())
        return cls(measured.size, mean, float(np.square(measured - mean).sum()), squares)

    def plus(self, other: "PredictionFit") -> "PredictionFit":
        """Join both; the deviations by the update of Chan, Golub and LeVeque (1983)."""
        measurements = self.measurements + other.measurements
        if not measurements:
            return self
        apart = other.mean - self.mean
        mean = self.mean + apart * other.measurements / measurements
        spread = self.spread + other.spread + apart**2 * self.measurements * other.measurements / measurements
        return PredictionFit(measurements, mean, spread, self.squares + other.squares)

    def beside(self, other: "PredictionFit") -> "PredictionFit":
        """Join both, where each deviates from its own mean: that of another segment."""
        measurements = self.measurements + other.measurements
        mean = (self.measurements * self.mean + other.measurements * other.mean) / max(measurements, 1)
        return PredictionFit(measurements, mean, self.spread + other.spread, self.squares + other.squares)

    @property
    def rmse(self) -> float | None:
        """Return the root mean square error; None without measurements or where the prediction is not finite."""
        return sqrt(self.squares / self.measurements) if self.measurements and isfinite(self.squares) else None

    @property
    def percent(self) -> float | None:
        """Return 100 (1 - norm of errors / norm of deviations from the mean): 100 is perfect, 0 is the mean itself.

        None as for `rmse`, and where the measurements do not vary; it can be any negative number.
        """
        varies = self.rmse is not None and 0.0 < self.spread < inf
        return 100.0 * (1.0 - sqrt(self.squares / self.spread)) if varies else None
