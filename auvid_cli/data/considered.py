"""Considered errors: known quantities that are not estimated, and what they add to the covariance of an estimate.

With the first-order change D of the estimated parameters by the considered quantities, of covariance S, the covariance
of both together is ``[[P + D S D', D S], [S D', S]]`` (consider covariance: Schmidt 1966; Tapley, Schutz and Born,
Statistical Orbit Determination, 2004, ch. 6). S is not larger than the data allow: where they contradict an error of
the size of its tolerance, it is the error's second moment given the data.
"""

from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.array_checks import check_finite, check_shapes
from auvid_cli.data.faults import Fault
from auvid_cli.errors import InvalidDataError

_ROUNDING = 1e-9  # of a variance


class Contributor(NamedTuple):
    """Considered error that makes an estimate uncertain."""

    fault: Fault
    deviation: float  # root of the variance of the estimate that would vanish if it were known


class ConsideredErrors(NamedTuple):
    """Errors of known quantities, and their effects on the constant states of an estimate, SI."""

    faults: tuple[Fault, ...]
    units: tuple[str, ...]
    # Shape (k, k); second moments of the errors, from tolerances and data; zero for a fault that no total has to allow
    # for
    covariance: Array
    effect: Array  # shape (n, k); error of each constant state, true less estimated, per unit of each
    inflation: Array  # shape (n,); factor of the standard deviations by autocorrelated residuals

    def check(self, n_states: int) -> None:
        """Raise an InvalidDataError if shapes or values are impossible for an estimate with `n_states` states."""
        k, n = len(self.faults), self.inflation.size
        check_shapes("/considered", (self.covariance, (k, k)), (self.effect, (n, k)))
        check_finite("/considered", self.covariance, self.effect, self.inflation)
        if n > n_states or len(self.units) != k:
            raise InvalidDataError("/considered does not match the state, or has columns of different lengths")
        if (self.inflation < 1.0 - _ROUNDING).any():
            raise InvalidDataError("/considered/inflation has factors below 1")
        self._square_root()

    @property
    def added(self) -> Array:
        """Return the covariance of the constant states that they add to that of the data, shape (n, n)."""
        return self.effect @ self.covariance @ self.effect.T

    def total_deviation(self, of_data: Array) -> Array:
        """Return the total standard deviations of the constant states from those by the data, shape (n,)."""
        return np.sqrt(of_data**2 + np.diagonal(self.added))

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Return errors drawn from their second moments, shape (count, k)."""
        root = self._square_root()
        return np.asarray(rng.standard_normal((count, root.shape[1])) @ root.T, dtype=np.float64)

    def _square_root(self) -> Array:
        """Return a matrix R with ``R R' = covariance``, shape (k, rank).

        Raises
        ------
        InvalidDataError
            If the covariance is not symmetric and positive semidefinite.
        """
        variance = np.diagonal(self.covariance)
        if (variance < 0.0).any():
            raise InvalidDataError("/considered/covariance has negative variances")
        # Normalised, because the units differ.
        deviation = np.sqrt(variance)
        product = np.outer(deviation, deviation)
        correlation = np.divide(self.covariance, product, out=np.zeros_like(product), where=product > 0.0)
        is_rest = (product == 0.0) & (self.covariance != 0.0)
        if is_rest.any() or (np.abs(correlation - correlation.T) > _ROUNDING).any():
            raise InvalidDataError("/considered/covariance is not symmetric, or has covariances without variances")
        values, directions = np.linalg.eigh(correlation)
        rounding = _ROUNDING * values.max(initial=0.0)
        if values.min(initial=0.0) < -rounding:
            raise InvalidDataError("/considered/covariance is not positive semidefinite")
        kept = values > rounding
        return np.asarray(deviation[:, None] * directions[:, kept] * np.sqrt(values[kept]), dtype=np.float64)

    def given(self, k: int) -> "ConsideredErrors":
        """Return the errors if the one of column k were known."""
        variance, joint = self.covariance[k, k], self.covariance[k]
        if variance <= 0.0:
            return self
        covariance = self.covariance - np.outer(joint, joint) / variance
        # The rest of the known one is rounding.
        covariance[k], covariance[:, k] = 0.0, 0.0
        return self._replace(covariance=covariance)

    def contributors(self, row: int, count: int = 2) -> list[Contributor]:
        """Return the errors whose knowledge would reduce the variance of a constant state most, one after another."""
        left, found = self, list[Contributor]()
        for _ in range(count):
            variance, joint = np.diagonal(left.covariance), left.covariance @ self.effect[row]
            unknown = variance > _ROUNDING * np.diagonal(self.covariance)
            reduction = np.divide(joint**2, variance, out=np.zeros_like(joint), where=unknown)
            k = int(reduction.argmax()) if reduction.size else 0
            if not reduction.size or reduction[k] <= 0.0:
                break
            found.append(Contributor(self.faults[k], float(np.sqrt(reduction[k]))))
            left = left.given(k)
        return found
