"""What filterpy's EKF costs by itself, to set auvid's EKF, which is built on it, against."""

from collections.abc import Callable

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from problem import N_STATE, Problem


def filterpy_alone(problem: Problem) -> Callable[[], None]:
    """As many predictions and updates as auvid makes, of the same sizes, with F, H and Q given and nothing else."""
    process, sensors, timeline = problem.process, problem.sensors, problem.timeline
    transition = np.eye(N_STATE)
    event = problem.events[-1]
    piece = event.held[None, :], np.zeros(1, dtype=np.int64), np.array([event.duration])
    scratch = np.zeros(process.scratch_size)
    process.transition(problem.prior.mean.copy(), *piece, process.constants, process.selection, transition, scratch)
    matrices, noises = tuple(sensors.matrix), [np.diag(variance) for variance in sensors.variance]
    nothing = np.zeros(sensors.matrix.shape[1])
    readings = [
        [(int(timeline.reading_sensor[k]), timeline.reading[k]) for k in range(first, last)]
        for first, last in zip(timeline.reading_offset[:-1], timeline.reading_offset[1:], strict=True)
    ]

    def run() -> None:
        ekf = ExtendedKalmanFilter(N_STATE, nothing.size)
        ekf.x, ekf.P = problem.prior.mean.copy(), problem.covariance.copy()
        ekf.F, ekf.Q = transition, event.process_noise
        for k, heard in enumerate(readings):
            if k:
                ekf.predict()
            for sensor, reading in heard:
                ekf.update(
                    reading,
                    HJacobian=lambda _, matrix=matrices[sensor]: matrix,
                    Hx=lambda _: nothing,
                    R=noises[sensor],
                )

    return run
