"""Extended Kalman filter on filterpy."""

import warnings
from collections.abc import Callable

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray
from scipy.linalg import LinAlgWarning

from auvid_cli.filters.problem import (
    OK,
    PREDICTION,
    Belief,
    History,
    Process,
    Records,
    Sensors,
    Timeline,
    empty_records,
)

Array = NDArray[np.float64]

# Events between two reports of progress, and between two checks that the covariance is positive definite.
_CHUNK, _CHECK = 500, 10


class _ProcessEkf(ExtendedKalmanFilter):
    """filterpy's filter with the mean moved by the process instead of by F.

    The state is a vector, not filterpy's default column: a column with a 1-d measurement broadcasts
    to a matrix without an error.
    """

    def __init__(self, process: Process, belief: Belief) -> None:
        n = belief.mean.size
        super().__init__(dim_x=n, dim_z=1)
        self.x = belief.mean.copy()
        self.P = belief.factor @ belief.factor.T
        self.F = np.eye(n)
        self.Q = np.zeros((n, n))
        self._process = process
        self._moving = np.arange(n - process.noise_density.size, n)
        self._density = process.noise_density**2

    def move(self, inputs: Array, piece_input: NDArray[np.int64], piece_duration: Array) -> None:
        """Predict over consecutive pieces of constant input."""
        self._pieces = inputs, piece_input, piece_duration
        self.Q[self._moving, self._moving] = self._density * piece_duration.sum()
        self.predict()

    def predict_x(self, u: float = 0) -> None:
        """Integrate the mean and set F to its transition matrix."""
        self._process.transition(self.x, *self._pieces, self.F)


def run_extended_filter(
    process: Process, sensors: Sensors, timeline: Timeline, prior: Belief, progress: Callable[[int, int], None]
) -> History:
    """Filter a timeline with the EKF; arguments and result as of `run_square_root_filter`.

    Sabet et al. 2018, Table A1. A reading with missing components is shortened to the rest:
    filterpy's ``update(None)`` would skip all of it.
    """
    with np.errstate(all="ignore"), warnings.catch_warnings():
        # What overflows or is nearly singular is judged after every step, and reported as divergence.
        warnings.simplefilter("ignore", LinAlgWarning)
        return _run(_ProcessEkf(process, prior), sensors, timeline, progress)


def _run(ekf: _ProcessEkf, sensors: Sensors, timeline: Timeline, progress: Callable[[int, int], None]) -> History:
    records = empty_records(timeline, ekf.x.size)
    n_events = timeline.time.size
    sound, covariance = 0, ekf.P
    for event in range(n_events):
        before = ekf.P
        culprit = _step(ekf, sensors, timeline, event, records)
        if culprit != OK:
            if _is_definite(before):
                sound, covariance = event, before
            return _ended(records, covariance, sound, culprit)
        records.mean[event] = ekf.x
        records.standard_deviation[event] = np.sqrt(np.diagonal(ekf.P))
        if event % _CHECK == 0 or event == n_events - 1:
            if not _is_definite(ekf.P):
                return _ended(records, covariance, sound, PREDICTION)
            sound, covariance = event + 1, ekf.P
        if event % _CHUNK == 0:
            progress(event, n_events)
    progress(n_events, n_events)
    return History(records, covariance, n_events, OK)


def _ended(records: Records, covariance: Array, n_good: int, culprit: int) -> History:
    records.mean[n_good:] = np.nan
    records.standard_deviation[n_good:] = np.nan
    return History(records, covariance, n_good, culprit)


def _step(ekf: _ProcessEkf, sensors: Sensors, timeline: Timeline, event: int, records: Records) -> int:
    """Predict to an event and update with its readings; what failed, or `OK`."""
    pieces = slice(timeline.piece_offset[event], timeline.piece_offset[event + 1])
    if pieces.stop > pieces.start:
        ekf.move(timeline.inputs, timeline.piece_input[pieces], timeline.piece_duration[pieces])
        if not _is_sound(ekf):
            return PREDICTION
    for k in range(timeline.reading_offset[event], timeline.reading_offset[event + 1]):
        sensor = int(timeline.reading_sensor[k])
        present = np.flatnonzero(~np.isnan(timeline.reading[k]))
        if present.size == 0:
            continue
        matrix = sensors.matrix[sensor, present]
        angular = sensors.angular[sensor, present]

        def residual(a: Array, b: Array, angular: NDArray[np.bool_] = angular) -> Array:
            return np.where(angular, (a - b + np.pi) % (2.0 * np.pi) - np.pi, a - b)

        try:
            ekf.update(
                timeline.reading[k, present],
                HJacobian=lambda x, matrix=matrix: matrix,
                Hx=lambda x, matrix=matrix: matrix @ x,
                R=np.diag(sensors.variance[sensor, present]),
                residual=residual,
            )
        except np.linalg.LinAlgError:
            return sensor
        records.innovation[k, present] = ekf.y
        records.innovation_variance[k, present] = np.diagonal(ekf.S)
        records.nis[k] = ekf.y @ ekf.SI @ ekf.y
        if not (_is_sound(ekf) and records.nis[k] >= 0.0):
            return sensor
    return OK


def _is_sound(ekf: _ProcessEkf) -> bool:
    """Finite state and positive, finite variances."""
    variances = np.diagonal(ekf.P)
    return bool(np.isfinite(ekf.x).all() and np.isfinite(variances).all() and variances.min() > 0.0)


def _is_definite(covariance: Array) -> bool:
    # Scaled to unit diagonal first, so that rounding is judged against each state's own size.
    scale = 1.0 / np.sqrt(np.diagonal(covariance))
    try:
        np.linalg.cholesky(covariance * np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return False
    return True
