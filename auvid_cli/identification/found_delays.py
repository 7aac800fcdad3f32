"""Delays that were found beside a filter, and how unsure they leave what it estimates."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class FoundDelays(NamedTuple):
    """Delays, SI: constants which no filter has among its states, for they move times.

    Attributes
    ----------
    symbols : tuple of str
    value : ndarray, shape (d,)
        In all, as the settings then state them.
    covariance : ndarray, shape (d, d)
    effect : ndarray, shape (n_parameters, d)
        Parameters of a filter that is told the true delays less those of one that is told these, per second of each.
    """

    symbols: tuple[str, ...]
    value: Array
    covariance: Array
    effect: Array

    @property
    def deviation(self) -> Array:
        """Return the standard deviation of each, shape (d,)."""
        return np.sqrt(np.diagonal(self.covariance))

    def along(self, mean: Array, deviation: Array) -> tuple[Array, Array]:
        """Put them behind the states of some events, whose parameters they make unsure from the first on.

        Parameters
        ----------
        mean, deviation : ndarray, shape (n, states)

        Returns
        -------
        mean, deviation : ndarray, shape (n, states + d)
        """
        n, parameters, wider = len(mean), slice(0, len(self.effect)), deviation.copy()
        wider[:, parameters] = self.widened(deviation[:, parameters])
        return np.hstack([mean, np.tile(self.value, (n, 1))]), np.hstack([wider, np.tile(self.deviation, (n, 1))])

    def widened(self, deviation: Array) -> Array:
        """Return what standard deviations of the parameters, shape (..., n_parameters), become; of none, none."""
        effect = self.effect[: deviation.shape[-1]]
        return np.sqrt(deviation**2 + np.einsum("if,fg,ig->i", effect, self.covariance, effect))

    def joint(self, covariance: Array) -> Array:
        """Return the covariance of a state, whose parameters come first, and these behind it."""
        n, effect = len(covariance), np.zeros((len(covariance), len(self.symbols)))
        effect[: len(self.effect)] = self.effect
        whole = np.zeros((n + len(self.symbols),) * 2)
        whole[:n, :n] = covariance + effect @ self.covariance @ effect.T
        whole[:n, n:] = effect @ self.covariance
        whole[n:, :n] = whole[:n, n:].T
        whole[n:, n:] = self.covariance
        return whole
