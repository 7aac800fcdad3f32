"""Checks that the numbers of a vehicle are plausible for one body in water, and consistent with each other."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.vehicle.rigid_body import GRAVITY, central_inertia

_ADDED_MASS = ("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot")
_UNITS = {"K_pdot": "kg m^2/rad", "M_qdot": "kg m^2/rad", "N_rdot": "kg m^2/rad"}
_MAX_WEIGHT_ERROR = 0.03  # share of mass times gravity
_MAX_TRIM = 0.15  # difference of buoyancy and weight, share of the weight
# Buoyancy differs from that of a full cylinder: hulls taper or are flooded, or have parts outside the hull.
_MIN_BUOYANCY = 0.3  # share of the buoyancy of a full cylinder of that size
_MAX_BUOYANCY = 1.5  # share of the buoyancy of a full cylinder of that size
_MIN_INERTIA = 0.1  # share of the inertia of a full cylinder of that size and mass
_MAX_INERTIA = 5.0  # share of the inertia of a full cylinder of that size and mass
# Differences between the drawing and the rest of the vehicle file.
_MAX_SIZE_ERROR = 0.05  # share of the size
_MAX_VOLUME_ERROR = 0.25  # share of the volume
_MAX_OFFSET = 0.1  # share of the length
# Range of the formulas that derive coefficients from a drawing.
MIN_SLENDERNESS = 4.0  # length per diameter
MAX_SLENDERNESS = 15.0  # length per diameter
# The limits accept coefficients with an error of one third.
MIN_FIN_STRENGTH = 0.55  # share of the strength in the vehicle file
MAX_FIN_STRENGTH = 1.8  # share of the strength in the vehicle file


class SanityWarning(NamedTuple):
    """An implausible number of a vehicle: its name, such as ``W``, its value, and the expected value in words."""

    subject: str
    value: str
    expected: str

    def __str__(self) -> str:
        """Return one line of text."""
        return f"{self.subject} is {self.value}; expected {self.expected}"


def sanity_warnings(vehicle: VehicleSettings) -> list[SanityWarning]:
    """Return the implausible numbers of a vehicle; ConfigError if its inertia is impossible."""
    k, size = vehicle.known_parameters(), vehicle.size
    full_cylinder_buoyancy = size.density * GRAVITY * 0.25 * np.pi * size.diameter**2 * size.length
    return [
        *_added_mass(k),
        *_forces(k, full_cylinder_buoyancy),
        *_inertia(k, size.length, size.diameter),
        *_centres(k, size.length, size.diameter),
        *_shape(vehicle),
    ]


def _added_mass(k: Mapping[str, float]) -> Iterator[SanityWarning]:
    for symbol in _ADDED_MASS:
        if k[symbol] > 0.0:
            yield SanityWarning(
                symbol, f"{k[symbol]:+.4g} {_UNITS.get(symbol, 'kg')}", "0 or less: added-mass derivatives are negative"
            )


def _forces(k: Mapping[str, float], full: float) -> Iterator[SanityWarning]:
    weight = k["m"] * GRAVITY
    if abs(k["W"] / weight - 1.0) > _MAX_WEIGHT_ERROR:
        yield SanityWarning("W", f"{k['W']:.4g} N", f"m g = {weight:.4g} N for a mass m of {k['m']:.4g} kg")
    if abs(k["B"] / k["W"] - 1.0) > _MAX_TRIM:
        yield SanityWarning("B", f"{k['B']:.4g} N", f"about the weight W of {k['W']:.4g} N")

    if not _MIN_BUOYANCY * full <= k["B"] <= _MAX_BUOYANCY * full:
        limits = f"{_MIN_BUOYANCY * full:.3g} to {_MAX_BUOYANCY * full:.3g} N"
        yield SanityWarning("B", f"{k['B']:.4g} N", f"{limits} for a hull of that length and diameter")


def full_cylinder(mass: float, length: float, diameter: float) -> tuple[float, float]:
    """Return the inertia of a solid cylinder about its axis and about a transverse axis, kg m^2."""
    return mass * diameter**2 / 8.0, mass * (length**2 / 12.0 + diameter**2 / 16.0)


def _inertia(k: Mapping[str, float], length: float, diameter: float) -> Iterator[SanityWarning]:
    axial, transverse = full_cylinder(k["m"], length, diameter)
    central = central_inertia(k)
    for i, (symbol, full) in enumerate({"Ixx": axial, "Iyy": transverse, "Izz": transverse}.items()):
        if not _MIN_INERTIA * full <= central[i, i] <= _MAX_INERTIA * full:
            limits = f"{_MIN_INERTIA * full:.2g} to {_MAX_INERTIA * full:.2g} kg m^2"
            yield SanityWarning(symbol, f"{k[symbol]:.4g} kg m^2", f"{limits} for that mass, length and diameter")
    small, middle, large = np.linalg.eigvalsh(central)
    # Vehicle files have rounded numbers.
    if large > 1.001 * (small + middle):
        moments = ", ".join(f"{moment:.4g}" for moment in (small, middle, large))
        yield SanityWarning(
            "the inertia",
            f"{moments} kg m^2 about the centre of gravity",
            "no moment larger than the sum of the other two",
        )


def _centres(k: Mapping[str, float], length: float, diameter: float) -> Iterator[SanityWarning]:
    if k["zG"] <= k["zB"]:
        expected = f"more than zB = {k['zB']:.4g} m: a centre of gravity below the centre of buoyancy"
        yield SanityWarning("zG", f"{k['zG']:.4g} m", expected)
    for axis, reach in {"x": length, "y": diameter, "z": diameter}.items():
        for centre in "GB":
            if abs(lever := k[f"{axis}{centre}"]) > reach:
                yield SanityWarning(f"{axis}{centre}", f"{lever:.4g} m", f"within the hull, {reach:.4g} m")


def _shape(vehicle: VehicleSettings) -> Iterator[SanityWarning]:
    """Compare the geometry with the rest of the file and with the range of its formulas."""
    shape = vehicle.shape()
    if shape is None:
        return
    hull, size, buoyancy = shape.hull, vehicle.size, vehicle.known_parameters()["B"]
    for name in ("length", "diameter"):
        drawn, size_value = getattr(hull, name), getattr(size, name)
        if abs(drawn / size_value - 1.0) > _MAX_SIZE_ERROR:
            yield SanityWarning(f"the geometry's {name}", f"{drawn:.4g} m", f"size.{name}, {size_value:.4g} m")
    displaced = size.density * GRAVITY * hull.volume
    if abs(displaced / buoyancy - 1.0) > _MAX_VOLUME_ERROR:
        yield SanityWarning(
            "the geometry's hull", f"{displaced:.4g} N of water", f"about the buoyancy B, {buoyancy:.4g} N"
        )
    if not MIN_SLENDERNESS <= hull.slenderness <= MAX_SLENDERNESS:
        limits = f"{MIN_SLENDERNESS:g} to {MAX_SLENDERNESS:g} diameters, the range of the formulas"
        yield SanityWarning("the geometry's length", f"{hull.slenderness:.3g} diameters", limits)
    if abs(shape.centre_of_buoyancy - hull.centre) > _MAX_OFFSET * hull.length:
        centre = f"near the centre of the hull's volume, {hull.centre:.4g} m"
        yield SanityWarning(
            "the geometry's centre_of_buoyancy", f"{shape.centre_of_buoyancy:.4g} m from the nose", centre
        )
