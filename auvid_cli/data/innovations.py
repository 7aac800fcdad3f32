"""What measurements said beyond their predictions, sensor by sensor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# s; innovations are also judged by windows of this length.
WINDOW = 20.0


class Tally(NamedTuple):
    """Sums over all innovations of a sensor.

    Attributes
    ----------
    start : float
        Time of the first, s.
    squares, components : ndarray, shape (k,)
        Sum of the NIS, and number of components used, in each `WINDOW` from `start` on.
    measurements, rejected : int
        Measurements used; components beyond the gate.
    """

    start: float
    squares: Array
    components: Array
    measurements: int
    rejected: int

    def plus(self, other: "Tally") -> "Tally":
        """Add later ones, of windows from the same start on."""
        size = max(self.squares.size, other.squares.size)
        squares, components = np.zeros(size), np.zeros(size)
        for part in (self, other):
            squares[: part.squares.size] += part.squares
            components[: part.components.size] += part.components
        measurements, rejected = self.measurements + other.measurements, self.rejected + other.rejected
        return Tally(self.start, squares, components, measurements, rejected)


@dataclass(frozen=True)
class Innovations:
    """One sensor's innovations.

    Attributes
    ----------
    time : ndarray, shape (k,)
    innovation, variance : ndarray, shape (k, c)
        SI; NaN where a component was missing or the filter had ended. Of a component that the gate rejected
        only the variance is NaN.
    nis : ndarray, shape (k,)
        Normalised innovation squared.
    standard_deviation : ndarray, shape (c,)
        Of the measurement noise, as the filter was told.
    whole : Tally or None
        Of all, where these are but evenly spaced ones.
    """

    time: Array
    innovation: Array
    variance: Array
    nis: Array
    standard_deviation: Array
    whole: Tally | None = None

    def tally(self, start: float | None = None) -> Tally:
        """Sum over all of them, also over those that were left out when they were read."""
        if self.whole is not None:
            return self.whole
        start = start if start is not None else float(self.time[0]) if self.time.size else 0.0
        used = self.used().sum(axis=1)
        window = ((self.time - start) // WINDOW).astype(int)
        squares, components = (np.bincount(window, w).astype(np.float64) for w in (np.nan_to_num(self.nis), used))
        rejected = int((np.isfinite(self.innovation) & ~self.used()).sum())
        return Tally(start, squares, components, int(np.isfinite(self.nis).sum()), rejected)

    def used(self) -> NDArray[np.bool_]:
        """Say which components the filter took, shape (k, c)."""
        return np.isfinite(self.variance)

    @classmethod
    def joined(cls, chunks: Sequence["Innovations"]) -> "Innovations":
        """Join chunks in time order."""
        return cls(
            time=np.concatenate([chunk.time for chunk in chunks]),
            innovation=np.concatenate([chunk.innovation for chunk in chunks]),
            variance=np.concatenate([chunk.variance for chunk in chunks]),
            nis=np.concatenate([chunk.nis for chunk in chunks]),
            standard_deviation=chunks[0].standard_deviation,
        )
