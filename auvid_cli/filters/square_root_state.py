"""What the compiled square-root filter works on: a model, and a state whose covariance is carried as a factor."""

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.filters.basis import BASIS, Basis
from auvid_cli.filters.problem import MODEL_DATA, OBSERVATION_SIGNATURE, PROCESS_SIGNATURE, Gaussian, ModelData

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


class SquareRootModel(NamedTuple):
    """A process with its sensors, see `auvid_cli.filters.problem`, and the sigma points.

    Attributes
    ----------
    advance, observe
        As in `Process`.
    data : ModelData
    basis : Basis
    """

    advance: Any
    observe: Any
    data: ModelData
    basis: Basis


MODEL = types.NamedTuple(
    (types.FunctionType(PROCESS_SIGNATURE), types.FunctionType(OBSERVATION_SIGNATURE), MODEL_DATA, BASIS),
    SquareRootModel,
)


class State(NamedTuple):
    """A Gaussian in the layout of the compiled loops; updated in place.

    Attributes
    ----------
    n : int
        Dimension.
    mean : ndarray, shape (width,)
        Behind the n components of the state there is room for a predicted measurement.
    columns : ndarray, shape (m, width)
        Row j holds column j of the lower-triangular factor of the covariance, then entry j of the rows of a predicted
        measurement. Zero elsewhere.
    """

    n: int
    mean: Array
    columns: Array

    @classmethod
    def of(cls, gaussian: Gaussian, n_columns: int, width: int) -> "State":
        """Lay out a Gaussian."""
        n = gaussian.mean.size
        state = cls(n, np.zeros(width), np.zeros((n_columns, width)))
        state.mean[:n], state.columns[:n, :n] = gaussian.mean, gaussian.factor.T
        return state

    def copy(self) -> "State":
        """Copy it into arrays of its own."""
        return State(self.n, self.mean.copy(), self.columns.copy())

    def covariance(self) -> Array:
        """Return the covariance, shape (n, n)."""
        factor = self.columns[: self.n, : self.n]
        return factor.T @ factor


STATE = types.NamedTuple((types.int64, _vector, _matrix), State)
