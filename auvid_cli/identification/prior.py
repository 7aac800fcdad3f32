"""Priors of the coefficients: from the vehicle's size alone, or from an earlier estimate."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.vehicle import Size
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.errors import DataError
from auvid_cli.vehicle.coefficients import COEFFICIENTS, Coefficient

Array = NDArray[np.float64]

# Lift-curve slope of a short fin, per radian: about 3 at the aspect ratios of AUV fins (Hoerner,
# Fluid-Dynamic Lift, 1985, ch. 3), on a fin area of about the hull diameter squared.
_LIFT_SLOPE = 3.0


def natural_magnitude(coefficient: Coefficient, size: Size) -> float:
    """Return the magnitude that a coefficient would have on a plain body of this size, SI.

    Drag is ``rho/2 C A`` with C = 1 on the frontal area for surge and on the lateral area for the
    cross-flow terms; lift and control are ``rho/2 C_L d^2``. A moment, and every rate among the
    signals, brings a lever: half the length, for roll the diameter.

    Parameters
    ----------
    coefficient : Coefficient
    size : Size
        Length, diameter, density of water. No coefficient of any vehicle enters.
    """
    pressure = 0.5 * size.density
    half_length = 0.5 * size.length
    if coefficient.group == "damping":
        frontal = 0.25 * np.pi * size.diameter**2
        area = frontal if coefficient.row == 0 else size.length * size.diameter
    else:
        area = _LIFT_SLOPE * size.diameter**2
    lever = size.diameter if coefficient.row == 3 else half_length
    turns = sum(signal in ("p", "q", "r") for signal in coefficient.signals)
    return float(pressure * area * lever ** (turns + (coefficient.row >= 3)))


def prior_standard_deviations(size: Size, factor: float, given: dict[str, float]) -> dict[str, float]:
    """Return the standard deviation of each coefficient's zero-mean prior, SI, by symbol.

    Parameters
    ----------
    size : Size
    factor : float
        Times the natural magnitude.
    given : dict
        By symbol, instead of that.
    """
    return {c.symbol: given.get(c.symbol, factor * natural_magnitude(c, size)) for c in COEFFICIENTS}


def earlier_gaussian(path: Path, dataset: Dataset, estimated: Sequence[str], scale: Array) -> tuple[Array, Array]:
    """Return what an earlier estimate says of coefficients, in units of `scale`; others keep their prior.

    Parameters
    ----------
    path : pathlib.Path
        Estimate file.
    dataset : Dataset
        That is to be identified.
    estimated : sequence of str
        Symbols.
    scale : ndarray, shape (p,)
        Prior standard deviations.

    Returns
    -------
    mean : ndarray, shape (p,)
    factor : ndarray, shape (p, p)
        Lower triangular square root of the covariance.

    Raises
    ------
    DataError
        If the estimate is of the same data, which would count twice, or did not end well.
    FileError
        If it cannot be read.
    """
    earlier = read_estimate(path)
    if not earlier.completed:
        raise DataError(f"identification.prior.from_estimate: {path} {earlier.status}; it is no prior for anything")
    if earlier.dataset_sha256 and earlier.dataset_sha256 == dataset.sha256:
        raise DataError(
            f"identification.prior.from_estimate: {path} was made from this very dataset, which would count twice; "
            "name an estimate of other data"
        )
    mean, covariance = np.zeros(scale.size), np.eye(scale.size)
    here = [i for i, symbol in enumerate(estimated) if symbol in earlier.state]
    there = [earlier.state.index(estimated[i]) for i in here]
    mean[here] = earlier.mean[-1, there] / scale[here]
    covariance[np.ix_(here, here)] = earlier.covariance[np.ix_(there, there)] / np.outer(scale[here], scale[here])
    try:
        return mean, np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    except np.linalg.LinAlgError:
        message = f"identification.prior.from_estimate: the covariance in {path} is not positive definite"
        raise DataError(message) from None
