"""Extended Kalman filter on filterpy."""

import warnings
from collections.abc import Iterable
from math import isfinite

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray
from scipy.linalg import LinAlgWarning

from auvid_cli.filters.problem import (
    OK,
    PREDICTION,
    Belief,
    Ending,
    Process,
    Receiver,
    Records,
    Sensors,
    Timeline,
    empty_records,
    until,
)

Array = NDArray[np.float64]

# Events between two checks that the covariance is positive definite.
_CHECK = 10


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
        # A view of the moving part of the diagonal.
        self._noise = self.Q.reshape(-1)[-1 - (process.noise_density.size - 1) * (n + 1) :: n + 1]
        self._density = process.noise_density**2
        self._scratch = np.zeros(process.scratch_size)

    def move(self, inputs: Array, piece_input: NDArray[np.int64], piece_duration: Array) -> None:
        """Predict over consecutive pieces of constant input."""
        self._pieces = inputs, piece_input, piece_duration
        self._noise[:] = self._density * piece_duration.sum()
        self.predict()

    def _see(self, view: "_View") -> tuple[Array, Array]:
        """What a sensor is predicted to say, and the derivative."""
        if view.nonlinear:
            assert self._process.linearise is not None, "a nonlinear sensor needs `Process.linearise`"
            predicted, matrix = self._process.linearise(self.x, view.sensor)
            return predicted[view.present], matrix[view.present]
        return view.matrix @ self.x, view.matrix

    def beyond(self, gate: float, view: "_View", reading: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Innovation of every present component, and whether its square is beyond so many times its variance."""
        predicted, matrix = self._see(view)
        innovation = view.residual(reading, predicted)
        variance = np.einsum("ij,jk,ik->i", matrix, self.P, matrix) + view.noise.diagonal()
        return innovation, innovation**2 > gate * variance

    def hear(self, view: "_View", reading: Array) -> None:
        """Update with the present components of a reading."""
        predicted, matrix = self._see(view)
        self.update(reading, HJacobian=lambda x: matrix, Hx=lambda x: predicted, R=view.noise, residual=view.residual)

    def predict_x(self, u: float = 0) -> None:
        """Integrate the mean and set F to its transition matrix."""
        process = self._process
        process.transition(self.x, *self._pieces, process.constants, process.selection, self.F, self._scratch)


class _View:
    """What does not change between readings of a sensor with the same components missing."""

    def __init__(self, sensors: Sensors, sensor: int, missing: NDArray[np.bool_]) -> None:
        self.sensor = sensor
        # A slice is several times faster than a list of places.
        self.present = np.flatnonzero(~missing) if missing.any() else slice(None)
        self.silent = bool(missing.all())
        self.nonlinear = bool(sensors.nonlinear[sensor])
        self.matrix = sensors.matrix[sensor, self.present]
        self.noise = np.diag(sensors.variance[sensor, self.present])
        angular = sensors.angular[sensor, self.present]

        def wrapped_residual(a: Array, b: Array) -> Array:
            return np.where(angular, (a - b + np.pi) % (2.0 * np.pi) - np.pi, a - b)

        self.residual = wrapped_residual if angular.any() else np.subtract


def _views(sensors: Sensors, timeline: Timeline) -> list[_View]:
    """The view of each reading; those that are alike share one."""
    missing = np.isnan(timeline.reading)
    patterns = (missing @ (1 << np.arange(missing.shape[1]))).tolist()
    views: dict[tuple[int, int], _View] = {}
    of_reading = []
    for row, key in enumerate(zip(timeline.reading_sensor.tolist(), patterns, strict=True)):
        if key not in views:
            views[key] = _View(sensors, key[0], missing[row])
        of_reading.append(views[key])
    return of_reading


def run_extended_filter(
    process: Process, sensors: Sensors, timelines: Iterable[Timeline], prior: Belief, receive: Receiver
) -> Ending:
    """Filter data with the EKF; arguments and result as of `run_square_root_filter`.

    Sabet et al. 2018, Table A1. A reading with missing components is shortened to the rest:
    filterpy's ``update(None)`` would skip all of it.
    """
    ekf = _ProcessEkf(process, prior)
    n_good, ending = 0, Ending(ekf.P, 0, OK)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        # What overflows or is nearly singular is judged after every step, and reported as divergence.
        warnings.simplefilter("ignore", LinAlgWarning)
        for timeline in timelines:
            ending = _run(ekf, sensors, timeline, receive)
            n_good += ending.n_good
            if ending.culprit != OK:
                break
    return ending._replace(n_good=n_good)


def _run(ekf: _ProcessEkf, sensors: Sensors, timeline: Timeline, receive: Receiver) -> Ending:
    """Filter a part; its end is sound, or the end of all."""
    n_events = timeline.time.size
    sound, covariance = 0, ekf.P
    records = empty_records(timeline, ekf.x.size)
    views = _views(sensors, timeline)
    culprit, event = OK, 0
    for event in range(n_events):
        before = ekf.P
        culprit = _step(ekf, sensors, timeline, views, event, records)
        if culprit != OK:
            if _is_definite(before):
                sound, covariance = event, before
            break
        records.mean[event] = ekf.x
        records.standard_deviation[event] = np.sqrt(ekf.P.diagonal())
        if event % _CHECK == _CHECK - 1 or event == n_events - 1:
            if not _is_definite(ekf.P):
                culprit = PREDICTION
                break
            sound, covariance = event + 1, ekf.P
    receive(timeline, until(records, sound, timeline.reading_offset[min(event + 1, n_events)]))
    return Ending(covariance, sound, culprit)


def _step(
    ekf: _ProcessEkf, sensors: Sensors, timeline: Timeline, views: list[_View], event: int, records: Records
) -> int:
    """Predict to an event and update with its readings; what failed, or `OK`."""
    first, last = timeline.piece_offset[event], timeline.piece_offset[event + 1]
    if last > first:
        ekf.move(timeline.inputs, timeline.piece_input[first:last], timeline.piece_duration[first:last])
    culprit = PREDICTION
    for k in range(timeline.reading_offset[event], timeline.reading_offset[event + 1]):
        view = views[k]
        records.nis[k] = 0.0
        if sensors.gate < np.inf and not view.silent:
            innovation, rejected = ekf.beyond(sensors.gate, view, timeline.reading[k, view.present])
            if rejected.any():
                records.innovation[k, view.present] = innovation
                missing = np.isnan(timeline.reading[k])
                missing[np.flatnonzero(~missing)[rejected]] = True
                view = _View(sensors, view.sensor, missing)
        if view.silent:
            continue
        culprit = view.sensor
        try:
            ekf.hear(view, timeline.reading[k, view.present])
        except (np.linalg.LinAlgError, ValueError):
            # Of scipy's inverse: a singular matrix, or one that is not finite.
            records.nis[k] = np.nan
            return culprit if _was_sound(ekf) else PREDICTION
        records.innovation[k, view.present] = ekf.y
        records.innovation_variance[k, view.present] = ekf.S.diagonal()
        records.nis[k] = nis = float(ekf.y @ ekf.SI @ ekf.y)
        if not 0.0 <= nis < np.inf:
            return culprit if _was_sound(ekf) else PREDICTION
    return OK if _is_sound(ekf) else culprit


def _was_sound(ekf: _ProcessEkf) -> bool:
    """Whether the last prediction, at least, was finite."""
    return isfinite(ekf.x_prior.sum() + ekf.P_prior.diagonal().sum())


def _is_sound(ekf: _ProcessEkf) -> bool:
    """Finite state and positive, finite variances."""
    variances = ekf.P.diagonal()
    return isfinite(ekf.x.sum() + variances.sum()) and variances.min() > 0.0


def _is_definite(covariance: Array) -> bool:
    # Scaled to unit diagonal first, so that rounding is judged against each state's own size.
    scale = 1.0 / np.sqrt(np.diagonal(covariance))
    try:
        np.linalg.cholesky(covariance * np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return False
    return True
