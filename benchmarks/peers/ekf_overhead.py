"""What filterpy's EKF costs by itself, to set auvid's EKF, which is built on it, against."""

from collections.abc import Callable

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from benchmarks.peers.problem import N_STATE, Problem


def filterpy_alone(problem: Problem) -> Callable[[], None]:
    """As many predictions and updates as auvid makes, of the same sizes, with F, H and Q given and nothing else."""
    process = problem.process
    transition = np.eye(N_STATE)
    event = problem.events[-1]
    substep = event.held[None, :], np.zeros(1, dtype=np.int64), np.array([event.duration])
    scratch = np.zeros(process.scratch_size)
    process.transition(problem.prior.mean.copy(), *substep, process.constants, process.selection, transition, scratch)

    def run() -> None:
        ekf = ExtendedKalmanFilter(N_STATE, 1)
        ekf.x, ekf.P = problem.prior.mean.copy(), problem.covariance.copy()
        ekf.F, ekf.Q = transition, event.process_noise
        for heard in problem.events:
            if heard.duration:
                ekf.predict()
            ekf.update(
                heard.measurement,
                HJacobian=lambda _, matrix=heard.matrix: matrix,
                Hx=lambda _, measurement=heard.measurement: 0.0 * measurement,
                R=heard.noise,
            )

    return run
