"""Whether the numbers of a vehicle can be those of one body in water: what is doubtful, and what would be expected."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.vehicle.kinematics import GRAVITY
from auvid_cli.vehicle.matrices import central_inertia

_ADDED_MASS = ("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot")
_UNITS = {"K_pdot": "kg m^2/rad", "M_qdot": "kg m^2/rad", "N_rdot": "kg m^2/rad"}
_LARGEST_WEIGHT_ERROR = 0.03  # of mass times gravity
_LARGEST_TRIM = 0.15  # difference of buoyancy and weight, of the weight
# Buoyancy may differ from that of a full cylinder: hulls taper or are flooded, or carry more than their hull.
_LEAST_SHARE = 0.3  # of the buoyancy of a full cylinder of that size
_LARGEST_SHARE = 1.5  # of the buoyancy of a full cylinder of that size
_LEAST_INERTIA = 0.1  # of the inertia of a full cylinder of that size and mass
_LARGEST_INERTIA = 5.0  # of the inertia of a full cylinder of that size and mass
# Differences between the drawing and the rest of the vehicle file.
_LARGEST_SIZE_ERROR = 0.05  # of the size
_LARGEST_VOLUME_ERROR = 0.25  # of the volume
_LARGEST_OFFSET = 0.1  # of the length
# Range of the formulas of a drawing.
MIN_SLENDERNESS = 4.0  # length per diameter
MAX_SLENDERNESS = 15.0  # length per diameter
# Coefficients that are a third off hardly exceed these limits.
MIN_FIN_STRENGTH = 0.55  # times the strength that the vehicle file states
MAX_FIN_STRENGTH = 1.8  # times the strength that the vehicle file states


class SanityWarning(NamedTuple):
    """A number of a vehicle that can hardly be.

    Attributes
    ----------
    subject : str
        What it is of, such as ``W``.
    value, expected : str
        Its value, and what it would be in a vehicle like that.
    """

    subject: str
    value: str
    expected: str

    def __str__(self) -> str:
        """Return one line of text."""
        return f"{self.subject} is {self.value}; expected {self.expected}"


def sanity_warnings(vehicle: VehicleSettings) -> list[SanityWarning]:
    """Return the doubtful values of a vehicle.

    Raises
    ------
    ConfigError
        If the inertia is none that a body can have.
    """
    k, size = vehicle.known_parameters(), vehicle.size
    full = size.density * GRAVITY * 0.25 * np.pi * size.diameter**2 * size.length
    return [
        *_added_mass(k),
        *_weight(k),
        *_displacement(k, full),
        *_inertia(k, size.length, size.diameter),
        *_centres(k, size.length, size.diameter),
        *_shape(vehicle),
    ]


def _added_mass(k: Mapping[str, float]) -> Iterator[SanityWarning]:
    for symbol in _ADDED_MASS:
        if k[symbol] > 0.0:
            yield SanityWarning(
                symbol, f"{k[symbol]:+.4g} {_UNITS.get(symbol, 'kg')}", "0 or less: added mass counts as minus"
            )


def _weight(k: Mapping[str, float]) -> Iterator[SanityWarning]:
    weight = k["m"] * GRAVITY
    if abs(k["W"] / weight - 1.0) > _LARGEST_WEIGHT_ERROR:
        yield SanityWarning("W", f"{k['W']:.4g} N", f"m g = {weight:.4g} N of a mass m of {k['m']:.4g} kg")
    if abs(k["B"] / k["W"] - 1.0) > _LARGEST_TRIM:
        yield SanityWarning("B", f"{k['B']:.4g} N", f"about the weight W of {k['W']:.4g} N")


def _displacement(k: Mapping[str, float], full: float) -> Iterator[SanityWarning]:
    if not _LEAST_SHARE * full <= k["B"] <= _LARGEST_SHARE * full:
        limits = f"{_LEAST_SHARE * full:.3g} to {_LARGEST_SHARE * full:.3g} N"
        yield SanityWarning("B", f"{k['B']:.4g} N", f"{limits} of a hull of that length and diameter")


def full_cylinder(mass: float, length: float, diameter: float) -> tuple[float, float]:
    """Return the inertia of a full cylinder about its axis and across it, kg m^2."""
    return mass * diameter**2 / 8.0, mass * (length**2 / 12.0 + diameter**2 / 16.0)


def _inertia(k: Mapping[str, float], length: float, diameter: float) -> Iterator[SanityWarning]:
    across, along = full_cylinder(k["m"], length, diameter)
    central = central_inertia(k)
    for i, (symbol, full) in enumerate({"Ixx": across, "Iyy": along, "Izz": along}.items()):
        if not _LEAST_INERTIA * full <= central[i, i] <= _LARGEST_INERTIA * full:
            limits = f"{_LEAST_INERTIA * full:.2g} to {_LARGEST_INERTIA * full:.2g} kg m^2"
            yield SanityWarning(symbol, f"{k[symbol]:.4g} kg m^2", f"{limits} of that mass, length and diameter")
    small, middle, large = np.linalg.eigvalsh(central)
    # As exactly as vehicle files state them.
    if large > 1.001 * (small + middle):
        moments = ", ".join(f"{moment:.4g}" for moment in (small, middle, large))
        yield SanityWarning(
            "the inertia", f"{moments} kg m^2 about the centre of gravity", "none larger than the others' sum"
        )


def _centres(k: Mapping[str, float], length: float, diameter: float) -> Iterator[SanityWarning]:
    if k["zG"] <= k["zB"]:
        yield SanityWarning("zG", f"{k['zG']:.4g} m", f"below the centre of buoyancy, more than zB = {k['zB']:.4g} m")
    for axis, reach in {"x": length, "y": diameter, "z": diameter}.items():
        for centre in "GB":
            if abs(lever := k[f"{axis}{centre}"]) > reach:
                yield SanityWarning(f"{axis}{centre}", f"{lever:.4g} m", f"within the hull, {reach:.4g} m")


def _shape(vehicle: VehicleSettings) -> Iterator[SanityWarning]:
    """Compare the geometry, where it is stated, with the rest of the file and with what its formulas are for."""
    shape = vehicle.shape()
    if shape is None:
        return
    hull, size, buoyancy = shape.hull, vehicle.size, vehicle.known_parameters()["B"]
    for what, drawn, stated in (
        ("length", hull.length, size.length),
        ("diameter", hull.diameter, size.diameter),
    ):
        if abs(drawn / stated - 1.0) > _LARGEST_SIZE_ERROR:
            yield SanityWarning(f"the geometry's {what}", f"{drawn:.4g} m", f"size.{what}, {stated:.4g} m")
    displaced = size.density * GRAVITY * hull.volume
    if abs(displaced / buoyancy - 1.0) > _LARGEST_VOLUME_ERROR:
        yield SanityWarning(
            "the geometry's hull", f"{displaced:.4g} N of water", f"about the buoyancy B of {buoyancy:.4g} N"
        )
    if not MIN_SLENDERNESS <= hull.slenderness <= MAX_SLENDERNESS:
        limits = f"{MIN_SLENDERNESS:g} to {MAX_SLENDERNESS:g} diameters, for which its formulas are"
        yield SanityWarning("the geometry's length", f"{hull.slenderness:.3g} diameters", limits)
    if abs(shape.centre_of_buoyancy - hull.centre) > _LARGEST_OFFSET * hull.length:
        centre = f"near the centre of the hull's volume, {hull.centre:.4g} m"
        yield SanityWarning(
            "the geometry's centre_of_buoyancy", f"{shape.centre_of_buoyancy:.4g} m from the nose", centre
        )
