"""What the compiled square-root filter works on: a model, and a state whose covariance is carried as a factor."""

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.filters.basis import BASIS, Basis
from auvid_cli.filters.problem import (
    MODEL_DATA,
    OBSERVATION_SIGNATURE,
    PROCESS_SIGNATURE,
    Gaussian,
    Indices,
    ModelData,
    Sensors,
)
from auvid_cli.lanes import zeros_on_lines

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


class Components(NamedTuple):
    """Which rows of the factor each component of each sensor is made of: few of the state's, or one that rides along.

    Attributes
    ----------
    begin : ndarray of int, shape (n_sensors * c + 1,)
        Component i of sensor s has the entries from ``begin[s * c + i]`` to the next one's.
    place : ndarray of int
        Row of the factor.
    weight : ndarray
        How many times it counts.
    """

    begin: Indices
    place: Indices
    weight: Array

    @classmethod
    def of(cls, sensors: Sensors) -> "Components":
        """Find the entries of measurement matrices that are not zero."""
        n_sensors, n_components, n = sensors.matrix.shape
        rows = np.concatenate([sensors.matrix, np.zeros((n_sensors, n_components, n_components))], axis=2)
        rows[sensors.nonlinear] = np.eye(n_components, n + n_components, n)
        rows = rows.reshape(n_sensors * n_components, -1)
        component, place = np.nonzero(rows)
        begin = np.searchsorted(component, np.arange(len(rows) + 1))
        return cls(begin, np.ascontiguousarray(place), rows[component, place])


_indices = types.int64[::1]
COMPONENTS = types.NamedTuple((_indices, _indices, _vector), Components)


class SquareRootModel(NamedTuple):
    """A process with its sensors, see `auvid_cli.filters.problem`, and the sigma points.

    Attributes
    ----------
    advance, observe
        As in `Process`.
    data : ModelData
    components : Components
    basis : Basis
    """

    advance: Any
    observe: Any
    data: ModelData
    components: Components
    basis: Basis


MODEL = types.NamedTuple(
    (types.FunctionType(PROCESS_SIGNATURE), types.FunctionType(OBSERVATION_SIGNATURE), MODEL_DATA, COMPONENTS, BASIS),
    SquareRootModel,
)


class State(NamedTuple):
    """A Gaussian in the layout of the compiled loops; updated in place.

    Attributes
    ----------
    n : int
        Dimension.
    mean : ndarray, shape (width,)
        Behind the n components of the state there is room for the prediction of a nonlinear sensor, if there is any.
    columns : ndarray, shape (m, width)
        Row j holds column j of the lower-triangular factor of the covariance, then entry j of the rows of that
        prediction. Zero elsewhere.
    """

    n: int
    mean: Array
    columns: Array

    @classmethod
    def of(cls, gaussian: Gaussian, n_columns: int, width: int) -> "State":
        """Lay out a Gaussian."""
        n = gaussian.mean.size
        state = cls(n, zeros_on_lines(width), zeros_on_lines(n_columns, width))
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
