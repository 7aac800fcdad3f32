"""Priors of the coefficients from the vehicle's size alone."""

import numpy as np

from auvid_cli.config.vehicle import Size
from auvid_cli.vehicle.coefficients import COEFFICIENTS, Coefficient

# Lift-curve slope of a short fin, per radian: about 3 at the aspect ratios of AUV fins (Hoerner,
# Fluid-Dynamic Lift, 1985, ch. 3), on a fin area of about the hull diameter squared.
_LIFT_SLOPE = 3.0


def natural_magnitude(coefficient: Coefficient, size: Size) -> float:
    """Magnitude a coefficient would have on a plain body of this size, SI.

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


def prior_standard_deviations(size: Size, factor: float, stated: dict[str, float]) -> dict[str, float]:
    """Standard deviation of each coefficient's zero-mean prior, SI, by symbol.

    Parameters
    ----------
    size : Size
    factor : float
        Times the natural magnitude.
    stated : dict
        By symbol, instead of that.
    """
    return {c.symbol: stated.get(c.symbol, factor * natural_magnitude(c, size)) for c in COEFFICIENTS}
