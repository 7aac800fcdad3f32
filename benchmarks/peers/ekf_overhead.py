"""What filterpy's EKF costs by itself, to set auvid's EKF, which is built on it, against."""

from collections.abc import Callable

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from benchmarks.peers.problem import N_STATE, Problem


def filterpy_alone(problem: Problem) -> Callable[[], None]:
    """Make as many predictions and updates as auvid does, of the same sizes, with F, H and Q given and nothing else."""
    process = problem.process
    transition = np.eye(N_STATE)
    last = problem.events[-1]
    substep = last.held[None, :], np.zeros(1, dtype=np.int64), np.array([last.duration])
    scratch = np.zeros(process.scratch_size)
    process.transition(problem.prior.mean.copy(), *substep, process.constants, process.selection, transition, scratch)

    def run() -> None:
        ekf = ExtendedKalmanFilter(N_STATE, 1)
        ekf.x, ekf.P = problem.prior.mean.copy(), problem.covariance.copy()
        ekf.F, ekf.Q = transition, last.process_noise
        for event in problem.events:
            if event.duration:
                ekf.predict()
            ekf.update(
                event.measurement,
                HJacobian=lambda _, matrix=event.matrix: matrix,
                Hx=lambda _, measurement=event.measurement: 0.0 * measurement,
                R=event.noise,
            )

    return run
