"""Whether a filter's innovations are as large as it says they are."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.estimate import Estimate, Innovations


class SensorConsistency(NamedTuple):
    """Innovations of one sensor in one filter; a row of ``consistency.csv``.

    Attributes
    ----------
    filter, sensor : str
    readings : int
        Readings used.
    rejected : int
        Components beyond the gate.
    mean_nis : float
        Normalised innovation squared per component: 1 for a consistent filter with white noise,
        more if the data contradict the model, less if the stated noise is larger than the scatter.
    """

    filter: str
    sensor: str
    readings: int
    rejected: int
    mean_nis: float


def sensor_consistency(estimate: Estimate) -> list[SensorConsistency]:
    """Consistency of every sensor, in the order of the estimate."""
    results = []
    for name, innovations in estimate.innovations.items():
        components = int(innovations.used().sum())
        mean = float(np.nansum(innovations.nis) / components) if components else float("nan")
        readings = int(np.isfinite(innovations.nis).sum())
        results.append(SensorConsistency(estimate.filter, name, readings, innovations.rejected(), mean))
    return results


# Limits of the mean NIS of a sensor, over a whole run and over any `WINDOW` of it. Neither chance nor the
# coloured noise of an AHRS reaches them (400 components scatter by 0.07). The window is for a filter that was
# thrown off course early and looks settled later: what it learned then was wrong.
LARGEST_NIS, LARGEST_NIS_IN_WINDOW, WINDOW = 1.5, 2.0, 20.0
_FEWEST_COMPONENTS = 200


def verdict(estimate: Estimate) -> str:
    """Status of an estimate: as the filter ended, or "inconsistent" where its innovations belie it.

    A filter can reach the end of the data with a covariance that says all is well and coefficients
    that are far off; its innovations then are, or were, larger than their stated variance.
    """
    if not estimate.completed:
        return estimate.status
    for sensor, innovations in estimate.innovations.items():
        components = innovations.used().sum()
        if components and (nis := float(np.nansum(innovations.nis)) / components) > LARGEST_NIS:
            return _belied(sensor, nis, "")
        for start, nis in windowed_nis(innovations):
            if nis > LARGEST_NIS_IN_WINDOW:
                return _belied(sensor, nis, f" from t = {start:.0f} s on for {WINDOW:.0f} s")
    return estimate.status


def windowed_nis(innovations: Innovations) -> NDArray[np.float64]:
    """Start, s, and mean NIS per component of every `WINDOW` that has enough readings to tell.

    Returns
    -------
    ndarray, shape (k, 2)
    """
    present = innovations.used().sum(axis=1)
    if not present.any():
        return np.zeros((0, 2))
    window = ((innovations.time - innovations.time[0]) // WINDOW).astype(int)
    squares, components = np.bincount(window, np.nan_to_num(innovations.nis)), np.bincount(window, present)
    told = np.flatnonzero(components >= _FEWEST_COMPONENTS)
    return np.stack([innovations.time[0] + told * WINDOW, squares[told] / components[told]], axis=1)


def _belied(sensor: str, nis: float, when: str) -> str:
    return (
        f"inconsistent: innovations of {sensor} are {np.sqrt(nis):.3g} times as large as the filter says{when} "
        f"(NIS {nis:.3g}, expected 1)"
    )


def mean_nis(estimate: Estimate) -> float:
    """Normalised innovation squared per component, over all sensors."""
    squares = sum(float(np.nansum(i.nis)) for i in estimate.innovations.values())
    components = sum(int(i.used().sum()) for i in estimate.innovations.values())
    return squares / components if components else float("nan")
