"""filterpy's extended Kalman filter, moved by a process and measured with stacks."""

from math import isfinite

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from auvid_cli.filters.problem import Gaussian, Process
from auvid_cli.filters.stacked import Stack

Array = NDArray[np.float64]


class ProcessEkf(ExtendedKalmanFilter):
    """filterpy's filter with the mean moved by the process instead of by F.

    The state is a vector, not filterpy's default column: a column with a 1-d measurement broadcasts
    to a matrix without an error.
    """

    def __init__(self, process: Process, gaussian: Gaussian) -> None:
        n = gaussian.mean.size
        super().__init__(dim_x=n, dim_z=1)
        self.x = gaussian.mean.copy()
        self.P = gaussian.factor @ gaussian.factor.T
        self.F = np.eye(n)
        self.Q = np.zeros((n, n))
        self._process = process
        self.density = process.noise_density**2
        # A view of the moving part of the diagonal.
        self._noise = self.Q.reshape(-1)[-1 - (process.noise_density.size - 1) * (n + 1) :: n + 1]
        self._scratch = np.zeros(process.scratch_size)
        self._inputs = np.zeros(0)

    def move(self, inputs: Array, substep_input: NDArray[np.int64], substep_duration: Array, noise: Array) -> None:
        """Predict over consecutive substeps of constant input, which add so much to the moving variances."""
        self._substeps = inputs, substep_input, substep_duration
        self._noise[:] = noise
        self.predict()

    def hold(self, inputs: Array) -> None:
        """Take the inputs that hold from now on, which nonlinear sensors may depend on."""
        self._inputs = inputs

    def start_from(self, mean: Array, covariance: Array) -> None:
        """Go back to a state, as if nothing had come after it."""
        self.x, self.P = mean.copy(), covariance
        self.x_prior, self.P_prior = mean, covariance

    def was_sound(self) -> bool:
        """Say whether the last prediction, at least, was finite."""
        return isfinite(self.x_prior.sum() + self.P_prior.diagonal().sum())

    def outside_gate(self, gate: float, stack: Stack, measurement: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the innovation of each present component, and whether it lies outside the gate."""
        predicted, matrix = self._predicted_measurement(stack)
        innovation = stack.residual(measurement, predicted)
        variance = np.einsum("ij,jk,ik->i", matrix, self.P, matrix) + stack.noise.diagonal()
        return innovation, innovation**2 > gate * variance

    def update_with(self, stack: Stack, measurement: Array) -> None:
        """Update with the present components of some measurements."""
        derivative, predict = stack.derivative, stack.matrix.dot
        if stack.nonlinear:
            predicted, matrix = self._predicted_measurement(stack)
            derivative, predict = (lambda _: matrix), (lambda _: predicted)
        self.update(measurement, HJacobian=derivative, Hx=predict, R=stack.noise, residual=stack.residual)

    def _predicted_measurement(self, stack: Stack) -> tuple[Array, Array]:
        """Predict a measurement, and its derivative by the state."""
        if stack.nonlinear:
            process, width = self._process, stack.width
            predicted, matrix = np.zeros(width), np.zeros((width, self.x.size))
            model = process.constants, process.selection
            process.linearise(self.x, stack.sensors[0], self._inputs, *model, predicted, matrix, self._scratch)
            return predicted[stack.places], matrix[stack.places]
        return stack.matrix @ self.x, stack.matrix

    def predict_x(self, u: float = 0) -> None:
        """Integrate the mean and set F to its transition matrix."""
        process = self._process
        process.transition(self.x, *self._substeps, process.constants, process.selection, self.F, self._scratch)
