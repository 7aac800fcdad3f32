"""Whether a filter's innovations are as large as it says they are."""

from typing import NamedTuple

import numpy as np

from auvid_cli.data.estimate import Estimate


class SensorConsistency(NamedTuple):
    """Innovations of one sensor in one filter; a row of ``consistency.csv``.

    Attributes
    ----------
    filter, sensor : str
    readings : int
        Readings used.
    mean_nis : float
        Normalised innovation squared per component: 1 for a consistent filter with white noise,
        more if the data contradict the model, less if the stated noise is larger than the scatter.
    """

    filter: str
    sensor: str
    readings: int
    mean_nis: float


def sensor_consistency(estimate: Estimate) -> list[SensorConsistency]:
    """Consistency of every sensor, in the order of the estimate."""
    results = []
    for name, innovations in estimate.innovations.items():
        components = int(np.isfinite(innovations.innovation).sum())
        mean = float(np.nansum(innovations.nis) / components) if components else float("nan")
        results.append(SensorConsistency(estimate.filter, name, int(np.isfinite(innovations.nis).sum()), mean))
    return results


# More than this over a whole run is neither chance (a thousand readings scatter by 0.05) nor the coloured
# noise of an AHRS. A filter thrown off course early leaves that trace even where it looks settled at the end.
LARGEST_NIS = 1.5


def verdict(estimate: Estimate) -> str:
    """Status of an estimate: as the filter ended, or "inconsistent" where its innovations belie it.

    A filter can reach the end of the data with a covariance that says all is well and coefficients
    that are far off; its innovations then are larger than their stated variance.
    """
    if not estimate.completed:
        return estimate.status
    for result in sensor_consistency(estimate):
        if result.mean_nis > LARGEST_NIS:
            return (
                f"inconsistent: innovations of {result.sensor} are {np.sqrt(result.mean_nis):.3g} times as large as "
                f"the filter says (NIS {result.mean_nis:.3g}, expected 1)"
            )
    return estimate.status


def mean_nis(estimate: Estimate) -> float:
    """Normalised innovation squared per component, over all sensors."""
    squares = sum(float(np.nansum(i.nis)) for i in estimate.innovations.values())
    components = sum(int(np.isfinite(i.innovation).sum()) for i in estimate.innovations.values())
    return squares / components if components else float("nan")
