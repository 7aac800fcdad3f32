"""A cubature Kalman filter in plain NumPy, written with care: all 62 points at once, and no library."""

from collections.abc import Callable

import numpy as np

from benchmarks.peers.plain_dynamics import advance, vehicle_of
from benchmarks.peers.problem import N_STATE, Answer, Peer, Problem


def _cubature(problem: Problem) -> Callable[[], Answer]:
    vehicle = vehicle_of(problem.process)
    spread = np.sqrt(N_STATE)

    def run() -> Answer:
        mean, covariance = problem.prior.mean, problem.covariance
        for event in problem.events:
            if event.duration:
                factor = spread * np.linalg.cholesky(covariance)
                points = mean[:, None] + np.hstack([factor, -factor])
                moved = advance(points, event.duration, event.held, vehicle, np)
                mean = moved.mean(axis=1)
                deviation = moved - mean[:, None]
                covariance = deviation @ deviation.T / (2 * N_STATE) + event.process_noise
            # The sensors are linear, so their points need not be drawn: the sums are these.
            measured = event.measured
            cross = covariance[:, measured]
            gain = np.linalg.solve(cross[measured] + event.noise, cross.T).T
            mean = mean + gain @ (event.measurement - mean[measured])
            covariance = covariance - gain @ cross.T
        return Answer(mean, covariance)

    return run


PEERS = (Peer("CKF", "numpy", f"NumPy, {2 * N_STATE} points at once", "ckf", _cubature),)
