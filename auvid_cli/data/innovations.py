"""What measurements said beyond their predictions, sensor by sensor."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# s; innovations are also judged by windows of this length.
NIS_WINDOW = 20.0
# So many places apart innovations are compared, where there are no fewer than these.
N_LAGS, _FEWEST = 20, 50


class InnovationSums(NamedTuple):
    """Sums over all innovations of a sensor.

    Attributes
    ----------
    start : float
        Time of the first, s.
    squares, components : ndarray, shape (k,)
        Sum of the NIS, and number of components used, in each `NIS_WINDOW` from `start` on.
    measurements, rejected : int
        Measurements used; components beyond the gate, or of which a fit counted less than half.
    """

    start: float
    squares: Array
    components: Array
    measurements: int
    rejected: int

    @property
    def mean_nis(self) -> float:
        """Return the normalised innovation squared per component; NaN if none was used."""
        components = float(self.components.sum())
        return float(self.squares.sum()) / components if components else float("nan")

    def plus(self, other: "InnovationSums") -> "InnovationSums":
        """Add later ones, of windows from the same start on."""
        size = max(self.squares.size, other.squares.size)
        squares, components = np.zeros(size), np.zeros(size)
        for part in (self, other):
            squares[: part.squares.size] += part.squares
            components[: part.components.size] += part.components
        measurements, rejected = self.measurements + other.measurements, self.rejected + other.rejected
        return InnovationSums(self.start, squares, components, measurements, rejected)


class Autocorrelation(NamedTuple):
    """How innovations of a sensor, by their standard deviations, depend on those before.

    Attributes
    ----------
    correlation : ndarray, shape (c, N_LAGS)
        Of each component with itself so many places later, of what was used.
    samples : ndarray, shape (c,)
        Of how many; 0 where there are too few to say.
    """

    correlation: Array
    samples: Array

    def plus(self, other: "Autocorrelation") -> "Autocorrelation":
        """Add later ones; what the first of them owe to the last of these is left out."""
        samples = self.samples + other.samples
        total = self.correlation * self.samples[:, None] + other.correlation * other.samples[:, None]
        return Autocorrelation(total / np.maximum(samples, 1.0)[:, None], samples)


@dataclass(frozen=True)
class Innovations:
    """One sensor's innovations.

    Attributes
    ----------
    time : ndarray, shape (k,)
    innovation, variance : ndarray, shape (k, c)
        SI; NaN where a component was missing or the filter had ended. Of a component that the gate rejected, or
        that a fit counted less than half, only the variance is NaN.
    nis : ndarray, shape (k,)
        Normalised innovation squared.
    standard_deviation : ndarray, shape (c,)
        Of the measurement noise, as the filter was told.
    all_sums : InnovationSums or None
        Of all, where these are but evenly spaced ones.
    all_autocorrelation : Autocorrelation or None
        The same.
    weight : ndarray, shape (k, c), or None
        By how much each component counts in a fit that weighs them; 1 where missing.
    """

    time: Array
    innovation: Array
    variance: Array
    nis: Array
    standard_deviation: Array
    all_sums: InnovationSums | None = None
    all_autocorrelation: Autocorrelation | None = None
    weight: Array | None = None

    def sums(self, start: float | None = None) -> InnovationSums:
        """Sum over all of them, also over those that were left out when they were read."""
        if self.all_sums is not None:
            return self.all_sums
        start = start if start is not None else float(self.time[0]) if self.time.size else 0.0
        used = self.used().sum(axis=1)
        window = ((self.time - start) // NIS_WINDOW).astype(int)
        squares, components = (np.bincount(window, w).astype(np.float64) for w in (np.nan_to_num(self.nis), used))
        rejected = int((np.isfinite(self.innovation) & ~self.used()).sum())
        return InnovationSums(start, squares, components, int(np.isfinite(self.nis).sum()), rejected)

    @cached_property
    def autocorrelation(self) -> Autocorrelation:
        """Return how each component correlates with itself, also over those left out when they were read."""
        if self.all_autocorrelation is not None:
            return self.all_autocorrelation
        n_components = self.innovation.shape[1]
        correlation, samples = np.zeros((n_components, N_LAGS)), np.zeros(n_components)
        # A fit may leave a residual no room, and its variance 0.
        for c, used in enumerate((np.isfinite(self.innovation) & (self.variance > 0.0)).T):
            values = self.innovation[used, c] / np.sqrt(self.variance[used, c])
            if values.size >= _FEWEST and values.std() > 0.0:
                centred = values - values.mean()
                products = [float(centred[lag:] @ centred[:-lag]) for lag in range(1, N_LAGS + 1)]
                correlation[c], samples[c] = np.array(products) / float(centred @ centred), values.size
        return Autocorrelation(correlation, samples)

    def mean_weight(self) -> float | None:
        """Average the weights of all components that are there; None where a fit did not weigh them."""
        if self.weight is None or not np.isfinite(self.innovation).any():
            return None
        return float(self.weight[np.isfinite(self.innovation)].mean())

    def used(self) -> NDArray[np.bool_]:
        """Say which components the filter took, shape (k, c)."""
        return np.isfinite(self.variance)

    @classmethod
    def joined(cls, chunks: Sequence["Innovations"]) -> "Innovations":
        """Join chunks in time order."""
        weights = [chunk.weight for chunk in chunks if chunk.weight is not None]
        return cls(
            time=np.concatenate([chunk.time for chunk in chunks]),
            innovation=np.concatenate([chunk.innovation for chunk in chunks]),
            variance=np.concatenate([chunk.variance for chunk in chunks]),
            nis=np.concatenate([chunk.nis for chunk in chunks]),
            standard_deviation=chunks[0].standard_deviation,
            weight=np.concatenate(weights) if weights else None,
        )
