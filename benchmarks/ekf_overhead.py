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
    spans = [slice(*span) for span in zip(timeline.reading_offset[:-1], timeline.reading_offset[1:], strict=True)]
    kinds = [tuple(timeline.reading_sensor[span].tolist()) for span in spans]
    matrices = {kind: np.concatenate(sensors.matrix[list(kind)]) for kind in set(kinds)}
    noises = {kind: np.diag(sensors.variance[list(kind)].ravel()) for kind in set(kinds)}
    heard = [(matrices[k], noises[k], timeline.reading[span].ravel()) for k, span in zip(kinds, spans, strict=True)]

    def run() -> None:
        ekf = ExtendedKalmanFilter(N_STATE, 1)
        ekf.x, ekf.P = problem.prior.mean.copy(), problem.covariance.copy()
        ekf.F, ekf.Q = transition, event.process_noise
        for k, (matrix, noise, reading) in enumerate(heard):
            if k:
                ekf.predict()
            ekf.update(
                reading, HJacobian=lambda _, matrix=matrix: matrix, Hx=lambda _, reading=reading: 0.0 * reading, R=noise
            )

    return run
