"""Measurements that a filter with a covariance takes in at once."""

from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf  # pyright: ignore[reportAttributeAccessIssue]

from auvid_cli.angles import wrap
from auvid_cli.filters.problem import Sensors

Array = NDArray[np.float64]

# A sensor, and what its measurement lacks: bit c for component c.
Kind = tuple[int, int]


class Stack:
    """What does not change between measurements of the same sensors with the same components missing.

    Parameters
    ----------
    sensors : Sensors
    kinds : tuple of (int, int)
        One nonlinear sensor, or any number of linear ones; each with what its measurement lacks.

    Attributes
    ----------
    width, size : int
        Most components of a sensor, and how many measurements there are.
    sensors, measurements : list of int
        Sensors that say anything, and the places of their measurements in the stack.
    begins : ndarray of int
        Where the components of each of them begin.
    places : slice or ndarray of int
        Of the components that are present, in measurements laid end to end.
    nonlinear : bool
    matrix, noise : ndarray
        Measurement matrix and noise covariance.
    """

    def __init__(self, sensors: Sensors, kinds: tuple[Kind, ...]) -> None:
        self.width, self.size = width, _ = sensors.variance.shape[1], len(kinds)
        present = [(k, c) for k, (_, missing) in enumerate(kinds) for c in range(width) if not missing >> c & 1]
        of_measurement = np.array([k for k, _ in present], dtype=np.int64)
        self.measurements = np.unique(of_measurement).tolist()
        self.sensors = [kinds[k][0] for k in self.measurements]
        self.begins = np.searchsorted(of_measurement, self.measurements)
        self._same_measurement = np.equal.outer(of_measurement, of_measurement).astype(np.float64)
        # A slice is several times faster than a list of places.
        places = [k * width + c for k, c in present]
        self.places = slice(len(places)) if places == list(range(len(places))) else np.array(places)
        rows = [kinds[k][0] for k, _ in present], [c for _, c in present]
        self.nonlinear = any(sensors.nonlinear[sensor] for sensor in self.sensors)
        self.matrix = sensors.matrix[rows]
        self.noise = np.diag(sensors.variance[rows])
        self._angular = np.flatnonzero(sensors.angular[rows]).tolist()

    def derivative(self, state: Array) -> Array:
        """Return the measurement matrix of linear sensors, whatever the state is."""
        return self.matrix

    def residual(self, measurement: Array, predicted: Array) -> Array:
        """Subtract the components present, angles wrapped to [-pi, pi)."""
        difference = measurement - predicted
        for component in self._angular:
            angle = difference.item(component)
            # Wrapping is a dozen times as slow as seeing that there is nothing to wrap.
            if not -pi <= angle < pi:
                difference[component] = wrap(angle)
        return difference

    def one_by_one(self, innovation: Array, covariance: Array) -> tuple[Array, Array, Array]:
        """Find what the innovations would have been, had the measurements been used one after the other.

        With the factor L of their covariance, L^-1 y is white, and its part of a measurement is what this says beyond
        those before; the diagonal block of L carries it back to the units of the measurement.

        Parameters
        ----------
        innovation : ndarray, shape (k, m)
            At k times.
        covariance : ndarray, shape (k, m, m)
            Of each.

        Returns
        -------
        innovation, variance : ndarray, shape (k, m)
        nis : ndarray, shape (k, n)
            Normalised innovation squared of each of the n `sensors`.

        Raises
        ------
        numpy.linalg.LinAlgError
            If a covariance is not positive definite.
        """
        factor = np.linalg.cholesky(covariance)
        white = np.zeros_like(innovation)
        for i in range(innovation.shape[1]):
            explained = np.einsum("kj,kj->k", factor[:, i, :i], white[:, :i])
            white[:, i] = (innovation[:, i] - explained) / factor[:, i, i]
        alone = factor * self._same_measurement
        variance = np.einsum("kij,kij->ki", alone, alone)
        return np.einsum("kij,kj->ki", alone, white), variance, np.add.reduceat(white**2, self.begins, axis=1)

    def first_broken(self, innovation: Array, covariance: Array) -> int:
        """Find the first of `sensors` up to which innovations are not finite or not definite; else the last."""
        ends = [*self.begins[1:], len(covariance)]
        whole = (np.isfinite(innovation[:end]).all() and is_definite(covariance[:end, :end]) for end in ends)
        return next((s for s, sound in zip(self.sensors, whole, strict=True) if not sound), self.sensors[-1])


def is_definite(covariance: Array) -> bool:
    """Say whether a matrix is positive definite, each row judged by its own size."""
    # Scaled to unit diagonal first, so that rounding is judged against each state's own size.
    scale = 1.0 / np.sqrt(np.diagonal(covariance))
    _, failed = dpotrf(covariance * np.outer(scale, scale), lower=True)
    return not failed
