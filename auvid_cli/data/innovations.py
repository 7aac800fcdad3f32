"""Innovations of a sensor: the differences of measurements and predictions, their sums and autocorrelation."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.data.array_checks import (
    check_deviations,
    check_sensor,
    check_shapes,
    check_times,
    check_type,
    put_arrays,
)
from auvid_cli.errors import InvalidDataError
from auvid_cli.vehicle.parameters import SENSORS

NIS_WINDOW = 20.0  # s
N_LAGS = 20
_MIN_SAMPLES = 50  # smallest number of samples for an autocorrelation
# Least standard deviation of an innovation as a share of the measurement noise, to allow for rounding.
_MIN_SHARE_OF_NOISE = 0.999


class InnovationSums(NamedTuple):
    """Sums over all innovations of a sensor."""

    start: float  # time of the first, s
    squares: Array  # shape (k,); sum of the NIS in each `NIS_WINDOW` from `start` on
    components: Array  # shape (k,); number of components used in each `NIS_WINDOW`
    measurements: int  # number of measurements used
    rejected: int  # number of components beyond the gate, or with a weight below 0.5

    @property
    def mean_nis(self) -> float:
        """Return the normalised innovation squared per component; NaN if none was used."""
        components = float(self.components.sum())
        return float(self.squares.sum()) / components if components else float("nan")

    def plus(self, other: "InnovationSums") -> "InnovationSums":
        """Return the sums including later innovations, with windows from the same start."""
        size = max(self.squares.size, other.squares.size)
        squares, components = np.zeros(size), np.zeros(size)
        for part in (self, other):
            squares[: part.squares.size] += part.squares
            components[: part.components.size] += part.components
        measurements, rejected = self.measurements + other.measurements, self.rejected + other.rejected
        return InnovationSums(self.start, squares, components, measurements, rejected)


class Autocorrelation(NamedTuple):
    """Autocorrelation of the normalised innovations of a sensor."""

    correlation: Array  # shape (c, N_LAGS); by component, at lags of 1 to `N_LAGS` used samples
    samples: Array  # shape (c,); number of samples; 0 if there are too few

    def plus(self, other: "Autocorrelation") -> "Autocorrelation":
        """Return the autocorrelation including later innovations, without products across the boundary."""
        samples = self.samples + other.samples
        total = self.correlation * self.samples[:, None] + other.correlation * other.samples[:, None]
        return Autocorrelation(total / np.maximum(samples, 1.0)[:, None], samples)


class InnovationStatistics(NamedTuple):
    """Statistics of all innovations of a sensor, by which an estimate is judged."""

    sums: InnovationSums
    autocorrelation: Autocorrelation

    def plus(self, other: "InnovationStatistics") -> "InnovationStatistics":
        """Return the statistics including later innovations."""
        return InnovationStatistics(self.sums.plus(other.sums), self.autocorrelation.plus(other.autocorrelation))


@dataclass(frozen=True)
class Innovations:
    """Innovations of one sensor."""

    time: Array  # shape (k,)
    # Measurement minus prediction, shape (k, c), SI; NaN where a component is missing or the filter had ended
    innovation: Array
    # Variance of `innovation`, shape (k, c), SI; NaN also where the gate rejected it or its weight is below 0.5
    variance: Array
    nis: Array  # shape (k,); normalised innovation squared
    standard_deviation: Array  # shape (c,); measurement noise assumed by the filter
    all_statistics: InnovationStatistics | None = None  # of all innovations, if these are thinned
    weight: Array | None = None  # shape (k, c), or None; weight of each component in a robust fit; 1 where missing

    def __post_init__(self) -> None:
        arrays = {"time": 1, "innovation": 2, "variance": 2, "nis": 1, "standard_deviation": 1}
        put_arrays(self, "/innovations", **arrays, **({} if self.weight is None else {"weight": 2}))
        if self.all_statistics is not None:
            check_type("all_statistics", self.all_statistics, InnovationStatistics)

    def __getstate__(self) -> dict[str, Any]:
        # Without what is computed later, which may be while a thread sends the innovations to another process.
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def check(self, sensor: str, is_fit: bool) -> None:
        """Raise an InvalidDataError if values are impossible; NaN is a missing or rejected one.

        `is_fit` is for residuals of a fit without process noise, whose variance may be infinite.
        """
        check_sensor(sensor)
        where, n, width = f"/innovations/{sensor}", self.time.size, len(SENSORS[sensor])
        innovation, variance, nis = self.innovation, self.variance, self.nis
        check_times(where, self.time)
        shapes = (innovation, (n, width)), (variance, (n, width)), (nis, (n,)), (self.standard_deviation, (width,))
        check_shapes(where, *shapes, *([] if self.weight is None else [(self.weight, (n, width))]))
        if self.weight is not None and not ((self.weight > 0.0) & (self.weight <= 1.0)).all():
            raise InvalidDataError(f"{where} has weights that are not between 0 and 1")
        check_deviations(where, self.standard_deviation)
        if any(np.isinf(array).any() for array in (innovation, nis, *(() if is_fit else (variance,)))):
            raise InvalidDataError(f"{where} has infinite values")
        if (variance < 0.0).any() or (nis < 0.0).any():
            raise InvalidDataError(f"{where} has a negative variance or NIS")
        if (nis[np.isnan(variance).all(axis=1)] > 0.0).any():
            raise InvalidDataError(f"{where} has a NIS of a measurement without a variance")
        # S = H P H' + R; only a residual of a fit varies less than the noise R.
        if not is_fit and (np.sqrt(variance) < _MIN_SHARE_OF_NOISE * self.standard_deviation).any():
            raise InvalidDataError(f"{where} has variances below that of the measurement noise")

    def sums(self, start: float | None = None) -> InnovationSums:
        """Return sums over all innovations, also those that were thinned out."""
        if self.all_statistics is not None:
            return self.all_statistics.sums
        start = start if start is not None else float(self.time[0]) if self.time.size else 0.0
        used = self.used().sum(axis=1)
        window = ((self.time - start) // NIS_WINDOW).astype(int)
        squares, components = (np.bincount(window, w).astype(np.float64) for w in (np.nan_to_num(self.nis), used))
        rejected = int((np.isfinite(self.innovation) & ~self.used()).sum())
        return InnovationSums(start, squares, components, int(np.isfinite(self.nis).sum()), rejected)

    @cached_property
    def autocorrelation(self) -> Autocorrelation:
        """Return the autocorrelation of all innovations, also those that were thinned out."""
        if self.all_statistics is not None:
            return self.all_statistics.autocorrelation
        n_components = self.innovation.shape[1]
        correlation, samples = np.zeros((n_components, N_LAGS)), np.zeros(n_components)
        # The variance of a residual of a fit may be 0.
        for c, used in enumerate((np.isfinite(self.innovation) & (self.variance > 0.0)).T):
            values = self.innovation[used, c] / np.sqrt(self.variance[used, c])
            if values.size >= _MIN_SAMPLES and values.std() > 0.0:
                centred = values - values.mean()
                products = [float(centred[lag:] @ centred[:-lag]) for lag in range(1, N_LAGS + 1)]
                correlation[c], samples[c] = np.array(products) / float(centred @ centred), values.size
        return Autocorrelation(correlation, samples)

    def statistics(self, start: float | None = None) -> InnovationStatistics:
        """Return sums, with windows from `start` on, and autocorrelation."""
        return InnovationStatistics(self.sums(start), self.autocorrelation)

    def mean_weight(self) -> float | None:
        """Return the mean weight of the measured components; None without weights."""
        if self.weight is None or not np.isfinite(self.innovation).any():
            return None
        return float(self.weight[np.isfinite(self.innovation)].mean())

    def used(self) -> NDArray[np.bool_]:
        """Whether the filter used each component, shape (k, c)."""
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
