"""Whether a filter's innovations are as large as it says they are."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.estimate import Estimate
from auvid_cli.data.innovations import WINDOW, Innovations


class SensorConsistency(NamedTuple):
    """Innovations of one sensor in one filter; a row of ``consistency.csv``.

    Attributes
    ----------
    filter, sensor : str
    measurements : int
        Measurements used.
    rejected : int
        Components beyond the gate, or of which a robust fit counted less than half.
    mean_weight : float or None
        Of all components in a robust fit; None where there are no weights.
    mean_nis : float
        Normalised innovation squared per component: 1 for a consistent filter with white noise,
        more if the data contradict the model, less if the stated noise is larger than the scatter.
    expected_low, expected_high : float
        Between which chance leaves it 99 times of 100, were the innovations independent.
    """

    filter: str
    sensor: str
    measurements: int
    rejected: int
    mean_weight: float | None
    mean_nis: float
    expected_low: float
    expected_high: float


def sensor_consistency(estimate: Estimate) -> list[SensorConsistency]:
    """Return the consistency of every sensor, in the order of the estimate."""
    results = []
    for name, innovations in estimate.innovations.items():
        tally = innovations.tally()
        components = tally.components.sum()
        # Of chi-squared with so many components, whose mean is its number, and its variance twice that.
        scatter = _QUANTILE * float(np.sqrt(2.0 / components)) if components else float("nan")
        counts = tally.measurements, tally.rejected, innovations.mean_weight()
        results.append(
            SensorConsistency(estimate.filter, name, *counts, tally.mean_nis, max(1.0 - scatter, 0.0), 1.0 + scatter)
        )
    return results


# Limits of the mean NIS of a sensor, over a whole run and over any `WINDOW` of it. Neither chance nor the
# coloured noise of an AHRS reaches them (400 components scatter by 0.07). The window is for a filter that was
# thrown off course early and looks settled later: what it learned then was wrong.
LARGEST_NIS, LARGEST_NIS_IN_WINDOW = 1.5, 2.0
_FEWEST_COMPONENTS = 200
# Standard deviations within which 99 % of a Gaussian are.
_QUANTILE = 2.576


def status_of(estimate: Estimate) -> str:
    """Return the status of an estimate: as the filter ended, or "inconsistent" where its innovations belie it.

    A filter can reach the end of the data with a covariance that says all is well and coefficients
    that are far off; its innovations then are, or were, larger than their stated variance.
    """
    if not estimate.completed:
        return estimate.status
    for sensor, innovations in estimate.innovations.items():
        tally = innovations.tally()
        if tally.squares.sum() > LARGEST_NIS * tally.components.sum():
            return _belied(sensor, tally.mean_nis, "")
        for start, nis in windowed_nis(innovations):
            if nis > LARGEST_NIS_IN_WINDOW:
                return _belied(sensor, nis, f" from t = {start:.0f} s on for {WINDOW:.0f} s")
    return estimate.status


def windowed_nis(innovations: Innovations) -> NDArray[np.float64]:
    """Return start, s, and mean NIS per component of every `WINDOW` that has enough measurements to tell.

    Returns
    -------
    ndarray, shape (k, 2)
    """
    tally = innovations.tally()
    enough = np.flatnonzero(tally.components >= _FEWEST_COMPONENTS)
    starts = tally.start + WINDOW * enough.astype(np.float64)
    return np.stack([starts, tally.squares[enough] / tally.components[enough]], axis=1).astype(np.float64)


def _belied(sensor: str, nis: float, when: str) -> str:
    return (
        f"inconsistent: innovations of {sensor} are {np.sqrt(nis):.3g} times as large as the filter says{when} "
        f"(NIS {nis:.3g}, expected 1)"
    )


def mean_nis(estimate: Estimate) -> float:
    """Return the normalised innovation squared per component, over all sensors."""
    tallies = [innovations.tally() for innovations in estimate.innovations.values()]
    components = sum(float(tally.components.sum()) for tally in tallies)
    return sum(float(tally.squares.sum()) for tally in tallies) / components if components else float("nan")
