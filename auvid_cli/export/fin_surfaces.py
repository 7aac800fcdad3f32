"""Rudder and elevator as surfaces that lift across the flow where their force acts.

The model's fins push across the hull by ``c u^2 delta``. A lifting surface at the place ``x`` on the axis pushes across
the flow there, with ``V^2`` of that flow in its plane: with ``s`` the velocity across the hull, ``c u V delta`` across
it and ``-c s V delta`` along it. Both are the same where ``s`` is zero, and differ by the second order of ``s / u``
across.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, MOTION_SYMBOLS

Array = NDArray[np.float64]


class FinSurface(NamedTuple):
    """A pair of fins as one surface.

    Attributes
    ----------
    name : str
        "rudder" or "elevator".
    symbols : tuple of str
        Of its force's and its moment's coefficient.
    force : float
        Coefficient of the force to starboard or down, kg/(m rad).
    place : float
        Where force and moment meet, forward of the origin, m.
    """

    name: str
    symbols: tuple[str, str]
    force: float
    place: float


def fin_surfaces(coefficients: Mapping[str, float]) -> list[FinSurface]:
    """Return those that there are; one with a moment and no force acts nowhere, and is left out."""
    pairs = (("rudder", ("Y_uudr", "N_uudr"), 1.0), ("elevator", ("Z_uude", "M_uude"), -1.0))
    return [
        FinSurface(name, (force, moment), coefficients[force], sign * coefficients[moment] / coefficients[force])
        for name, (force, moment), sign in pairs
        if coefficients[force]
    ]


def surface_changes(coefficients: Mapping[str, float], motion: Array, inputs: Array) -> dict[str, float]:
    """Return how much changes if the fins are such surfaces.

    Parameters
    ----------
    coefficients : mapping
        All by symbol, SI.
    motion : ndarray, shape (n, 9)
    inputs : ndarray, shape (n, 4)

    Returns
    -------
    dict of float
        Root mean square by row of the equations of motion, N or N m.
    """
    signals = dict(zip(MOTION_SYMBOLS, motion.T, strict=True)) | dict(zip(INPUT_SYMBOLS, inputs.T, strict=False))
    changes = dict.fromkeys("XYZMN", np.zeros(len(motion)))
    for surface in fin_surfaces(coefficients):
        is_rudder = surface.name == "rudder"
        drift, turning = (signals["v"], signals["r"]) if is_rudder else (signals["w"], -signals["q"])
        across = drift + surface.place * turning
        speed, strength = np.hypot(signals["u"], across), surface.force * signals[surface.name]
        sideways = strength * signals["u"] * (speed - signals["u"])
        changes["X"] = changes["X"] - strength * across * speed
        changes["Y" if is_rudder else "Z"] = sideways
        changes["N" if is_rudder else "M"] = surface.place * sideways
    return {row: float(np.sqrt(np.mean(change**2))) for row, change in changes.items()}
