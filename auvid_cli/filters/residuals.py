"""What a fit hands over in place of a filter's records: the motion of its solution, and what it leaves unexplained."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.huber import SET_ASIDE, weight
from auvid_cli.filters.information import Uncertainty
from auvid_cli.filters.problem import OnChunk, Records, Sensors
from auvid_cli.filters.sensitivities import Response

Array = NDArray[np.float64]

# Shares of a residual's variance below this are rounding: measurements that the fit meets exactly say nothing.
_ROUNDING = 1e-9


def hand_over(
    solution: Iterable[Response], sensors: Sensors, uncertainty: Uncertainty, on_chunk: OnChunk
) -> tuple[Array, int]:
    """Pass on the motion from a fitted state, chunk by chunk.

    Parameters
    ----------
    solution : iterable of Response
        From the fitted state.
    sensors : Sensors
    uncertainty : Uncertainty
        Of the fitted state, P.
    on_chunk : callable
        Told every chunk. Standard deviations are those of ``X_k P X_k'``. For measurements that were fitted the
        variance of a residual is what the fit leaves of the noise, ``S = noise - H X_k P X_k' H'``; the NIS is ``r'
        S^-1 r``.

    Returns
    -------
    covariance : ndarray, shape (n, n)
        Of the state after the last sound event.
    n_good : int
        Events until the end, or until the motion blew up.
    """
    n = len(uncertainty.root)
    n_good, last = 0, np.eye(n)
    for response in solution:
        on_chunk(response.timeline, _records(response, sensors, uncertainty))
        if len(response.mean):
            moving = response.sensitivity[-1]
            last = np.vstack([np.eye(n)[: n - len(moving)], moving])
        n_good += len(response.mean)
    return uncertainty.covariance(last), n_good


def _records(response: Response, sensors: Sensors, uncertainty: Uncertainty) -> Records:
    events, n = response.mean.shape
    n_parameters = n - response.sensitivity.shape[1]
    deviation = np.empty((events, n))
    deviation[:, :n_parameters] = uncertainty.deviation(np.eye(n)[:n_parameters])
    deviation[:, n_parameters:] = uncertainty.deviation(response.sensitivity)
    weights, whitened = None, response.whitened
    if not np.isinf(sensors.threshold):
        weights = weight(whitened[..., -1] ** 2, sensors.threshold)
        whitened = np.where(weights[..., None] < SET_ASIDE, 0.0, whitened)
    variance, nis = _left_over(response._replace(whitened=whitened), sensors, uncertainty)
    if weights is not None:
        variance[weights < SET_ASIDE] = np.nan
    return Records(response.mean, deviation, response.innovation, variance, nis, weights)


def _left_over(response: Response, sensors: Sensors, uncertainty: Uncertainty) -> tuple[Array, Array]:
    """Return the variance of each residual and normalised residual squared of each measurement."""
    explained = response.whitened[..., :-1] @ uncertainty.root
    share = explained @ explained.swapaxes(-1, -2)
    sensor = response.timeline.measurement_sensor[: len(share)]
    left = np.maximum(1.0 - np.diagonal(share, axis1=1, axis2=2), 0.0)
    variance = np.where(np.isnan(response.innovation), np.nan, sensors.variance[sensor] * left)
    # Missing components have rows of zeros: a residual of nothing.
    shares, directions = np.linalg.eigh(share)
    parts = np.einsum("kij,ki->kj", directions, response.whitened[..., -1])
    free = 1.0 - shares
    nis = np.where(free > _ROUNDING, parts**2 / np.maximum(free, _ROUNDING), 0.0).sum(axis=1)
    return variance, nis
