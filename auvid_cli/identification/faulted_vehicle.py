"""A vehicle along a known motion, for what faults do to it: how fast it moves, and what its sensors feel there."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.ballast import N_BALLAST
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.dynamics import N_BLOCK, N_FACTORS, N_SLOPE, motion_derivative, vehicle_constants
from auvid_cli.vehicle.kinematics import current_in_body_axes, earth_to_body, specific_force
from auvid_cli.vehicle.matrices import mass_matrix
from auvid_cli.vehicle.parameters import N_MOTION

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


class Motion(NamedTuple):
    """States of a vehicle under inputs.

    Attributes
    ----------
    motion : ndarray, shape (n, 9)
    inputs, input_rate, small_rate : ndarray, shape (n, 4)
        And how fast they change, per second; and that without their largest changes.
    rates : ndarray, shape (n, 9)
        How fast the states change.
    current : ndarray, shape (n, 2)
        North and east, in which the vehicle moves, as far as it is estimated.
    ballast : ndarray, shape (n, 2)
        See `Ballast`, as far as it is estimated.
    time : ndarray, shape (n,)
        s, of each.
    """

    motion: Array
    inputs: Array
    input_rate: Array
    small_rate: Array
    rates: Array
    current: Array
    ballast: Array
    time: Array

    @property
    def drift(self) -> Array:
        """Return the current in the axes of the vehicle, shape (n, 3)."""
        return current_in_body_axes(self.motion[:, 6:9], *self.current.T)

    @property
    def over_ground(self) -> Array:
        """Return the velocity that a DVL measures, shape (n, 3)."""
        return self.motion[:, :3] + self.drift

    @property
    def over_ground_rate(self) -> Array:
        """Return how fast that changes, shape (n, 3): seen from a vehicle that turns, a steady current turns back."""
        return self.rates[:, :3] - np.cross(self.motion[:, 3:6], self.drift)


class FaultedVehicle:
    """A vehicle with its coefficients, as faults disturb it.

    Parameters
    ----------
    parameters : mapping
        Known ones by symbol, SI.
    coefficients : ndarray, shape (N_FACTORS + terms,)
        From `auvid_cli.vehicle.dynamics.factors`.
    terms : sequence of Coefficient
        Those of the vehicle's own.
    arm : sequence of float
        Where the accelerometer sits, m; see `auvid_cli.data.dataset.SensorRecord`, as of the next.
    earth_field : sequence of float
        T.
    """

    def __init__(
        self,
        parameters: Mapping[str, float],
        coefficients: Array,
        terms: Sequence[Coefficient] = (),
        arm: Sequence[float] = (0.0, 0.0, 0.0),
        earth_field: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        self._parameters, self._coefficients, self._terms = parameters, coefficients, terms
        self._constants = vehicle_constants(parameters, terms)
        self._arm, self._earth_field = np.array(arm), np.array(earth_field)

    def rates(self, motion: Array, inputs: Array, ballast: Array) -> Array:
        """Return how fast motions change, shape (n, 9)."""
        return self._rates(motion, inputs, ballast, self._constants)

    def at_accelerometer(self, rates: Array) -> Array:
        """Return the part of rates of motion that it feels where it sits, shape (n, 3), m/s^2."""
        return np.asarray(rates[:, :3] + np.cross(rates[:, 3:6], self._arm), dtype=np.float64)

    def specific_force(self, motion: Array, inputs: Array, ballast: Array) -> Array:
        """Return what an accelerometer measures, shape (n, 3), m/s^2."""
        return specific_force(motion, self.rates(motion, inputs, ballast), self._arm)

    def magnetic_field(self, motion: Array) -> Array:
        """Return what a magnetometer measures along three axes, shape (n, 3), T."""
        return earth_to_body(motion[:, 6:9], np.tile(self._earth_field, (len(motion), 1)))

    def by_parameter(self, at: Motion, **steps: float) -> Array:
        """Return by how much more they change if known parameters are so much greater."""
        changed = {s: self._parameters[s] + by for s, by in steps.items()}
        other = vehicle_constants({**self._parameters, **changed}, self._terms)
        return self._rates(at.motion, at.inputs, at.ballast, other) - at.rates

    def by_ballast(self, at: Motion, change: Array) -> Array:
        """Return by how much more they change if the ballast is so much greater; the rates are linear in it."""
        return self.rates(at.motion, at.inputs, at.ballast + change) - at.rates

    def by_inputs(self, at: Motion, change: Array) -> Array:
        """Return by how much more they change if the inputs are so much greater; the rates are linear in them."""
        return self.rates(at.motion, at.inputs + change, at.ballast) - at.rates

    def by_force(self, at: Motion, row: int, force: Array) -> Array:
        """Return by how much more they change under a force, N, or moment, N m: the row-th of X Y Z K M N."""
        rates = np.zeros((len(force), N_MOTION))
        rates[:, :6] = force[:, None] * np.linalg.inv(mass_matrix(self._parameters))[:, row]
        return rates

    def _rates(self, motion: Array, inputs: Array, ballast: Array, constants: Array) -> Array:
        rates = np.empty(motion.shape)
        lanes = np.repeat(self._coefficients, LANES)
        each = (np.ascontiguousarray(values) for values in (motion, inputs, ballast))
        _fill_in_rates(*each, lanes, constants, rates, np.zeros(N_BLOCK + N_SLOPE))
        return rates


@compiled(types.void(_matrix, _matrix, _matrix, _vector, _vector, _matrix, _vector))
def _fill_in_rates(motion, inputs, ballast, coefficient_block, constants, rates, work):
    """Fill in how fast motions change, one by one."""
    block, derivative = work[:N_BLOCK], work[N_BLOCK:]
    for k in range(motion.shape[0]):
        for i in range(N_MOTION):
            block[i * LANES] = motion[k, i]
        for i in range(N_BALLAST):
            coefficient_block[(N_FACTORS - N_BALLAST + i) * LANES] = ballast[k, i]
        motion_derivative(block, coefficient_block, inputs[k], constants, 1, derivative)
        for i in range(N_MOTION):
            rates[k, i] = derivative[i * LANES]
