"""filterpy's filters, on auvid's compiled process and, as most people would write it, on plain NumPy."""

from collections.abc import Callable
from functools import partial

import numpy as np
from filterpy.kalman import (
    CubatureKalmanFilter,
    ExtendedKalmanFilter,
    MerweScaledSigmaPoints,
    UnscentedKalmanFilter,
    spherical_radial_sigmas,
)
from numpy.typing import NDArray

from benchmarks.peers.compiled_point import compiled_point
from benchmarks.peers.plain_dynamics import advance, vehicle_of
from benchmarks.peers.problem import N_STATE, Answer, Array, Peer, Problem


def _seen(state: Array, measured: NDArray[np.int64]) -> Array:
    return state[measured]


def _cubature(problem: Problem, *, plain: bool = False, redrawn: bool = False) -> Callable[[], Answer]:
    if plain:
        move = partial(advance, vehicle=vehicle_of(problem.process), numeric=np)
    else:
        move = compiled_point(problem.process)
    # Sensors differ in their number of components, and the filter keeps an array of one size for what they see.
    seen_points = {event.measurement.size: np.zeros((2 * N_STATE, event.measurement.size)) for event in problem.events}

    def run() -> Answer:
        ckf = CubatureKalmanFilter(N_STATE, 3, 0.01, _seen, move)
        ckf.x, ckf.P = problem.prior.mean.copy(), problem.covariance.copy()
        ckf.sigmas_f = spherical_radial_sigmas(ckf.x, ckf.P)
        ckf.x = ckf.x[:, None]
        for event in problem.events:
            if event.duration:
                ckf.Q = event.process_noise
                ckf.predict(event.duration, event.held)
                if redrawn:
                    ckf.sigmas_f = spherical_radial_sigmas(ckf.x, ckf.P)
            ckf.sigmas_h = seen_points[event.measurement.size]
            # A column: a 1-d measurement would broadcast against the predicted one to a matrix, without an error.
            ckf.update(event.measurement[:, None], R=event.noise, hx_args=event.measured)
        return Answer(ckf.x.ravel(), ckf.P)

    return run


def _unscented(problem: Problem) -> Callable[[], Answer]:
    move = compiled_point(problem.process)

    def run() -> Answer:
        points = MerweScaledSigmaPoints(N_STATE, *problem.unscented)
        ukf = UnscentedKalmanFilter(N_STATE, 3, 0.01, _seen, move, points)
        ukf.x, ukf.P = problem.prior.mean.copy(), problem.covariance.copy()
        ukf.sigmas_f = points.sigma_points(ukf.x, ukf.P)
        for event in problem.events:
            if event.duration:
                ukf.Q = event.process_noise
                ukf.predict(event.duration, held=event.held)
            ukf.update(event.measurement, R=event.noise, measured=event.measured)
        return Answer(ukf.x, ukf.P)

    return run


class _Ekf(ExtendedKalmanFilter):
    """With the mean moved by the process, as filterpy's documentation advises."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(N_STATE, 3)
        self.x, self.P = problem.prior.mean.copy(), problem.covariance.copy()
        self.substep = np.zeros((1, 4)), np.zeros(1, dtype=np.int64), np.zeros(1)
        self._process = problem.process
        self._scratch = np.zeros(problem.process.scratch_size)

    def predict_x(self, u: float = 0) -> None:
        process = self._process
        process.transition(self.x, *self.substep, process.constants, process.selection, self.F, self._scratch)


def _extended(problem: Problem) -> Callable[[], Answer]:
    def run() -> Answer:
        ekf = _Ekf(problem)
        inputs, _, duration = ekf.substep
        for event in problem.events:
            if event.duration:
                inputs[0], duration[0], ekf.Q = event.held, event.duration, event.process_noise
                ekf.predict()
            ekf.update(
                event.measurement,
                HJacobian=lambda _, matrix=event.matrix: matrix,
                Hx=lambda x, measured=event.measured: x[measured],
                R=event.noise,
            )
        return Answer(ekf.x, ekf.P)

    return run


_BASE = "The class that auvid's EKF is built on, with the same transition, but without auvid's records and checks."
_STALE = (
    "filterpy's CKF updates with the propagated points, which lack the process noise, instead of new points from the "
    "predicted covariance. So its result is different; the difference grows with the process noise."
)
_REDRAWN = (
    "One line, added here between filterpy's `predict` and `update`, draws the points from the predicted covariance."
)

PEERS = (
    Peer("EKF", "filterpy", "compiled", "ekf", _extended, note=_BASE),
    Peer("CKF", "filterpy", "compiled", "ckf", _cubature, note=_STALE),
    Peer("CKF, points redrawn", "filterpy", "compiled", "ckf", partial(_cubature, redrawn=True), note=_REDRAWN),
    Peer(
        "CKF, points redrawn",
        "filterpy",
        "NumPy, point by point",
        "ckf",
        partial(_cubature, plain=True, redrawn=True),
        max_events=100,
        note=_REDRAWN,
    ),
    Peer("UKF", "filterpy", "compiled", "ukf", _unscented),
)
