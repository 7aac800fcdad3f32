"""What a first vehicle comes to, beside what a body in water would have: to see a mistaken unit at once."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from auvid_cli.config.plausibility import LARGEST_SLENDERNESS, LEAST_SLENDERNESS, SanityWarning, doubts, full_cylinder
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.start.first_spiral import FirstSpiral
from auvid_cli.vehicle.matrices import central_inertia

# Of mass from what the hull displaces; a nose and a tail that nobody measured are worth as much.
_LARGEST_EXCESS = 0.15


class SanityRow(NamedTuple):
    """A quantity of a vehicle, its value, and what to hold it against."""

    quantity: str
    value: str
    beside: str


def sanity_rows(vehicle: VehicleSettings, spiral: FirstSpiral) -> Iterator[SanityRow]:
    """List what a vehicle comes to, and what it did in the simulated spiral."""
    known, size = vehicle.known_parameters(), vehicle.size
    slenderness = size.length / size.diameter
    usual = f"usual are {LEAST_SLENDERNESS:g} to {LARGEST_SLENDERNESS:g}"
    yield SanityRow("length", f"{size.length:.4g} m", f"{slenderness:.3g} diameters; {usual}")
    if (shape := vehicle.shape()) is not None:
        span, chord = shape.fins.span, shape.fins.area / shape.fins.span
        beside = (
            f"{span / size.diameter:.2g} diameters by {chord / size.length:.2g} lengths, {shape.fins.number} of them"
        )
        yield SanityRow("fin: span, mean chord", f"{span:.3g}, {chord:.3g} m", beside)
    if displaced := _displaced(vehicle):
        share = f"{known['m'] / displaced:.3g} times as much"
        yield SanityRow("water displaced by the hull", f"{displaced:.4g} kg", f"mass {known['m']:.4g} kg, {share}")
    yield SanityRow("buoyancy", f"{known['B']:.4g} N", f"weight {known['W']:.4g} N")
    central = central_inertia(known)
    across, along = (
        f"{full:.3g} kg m^2 of a full cylinder" for full in full_cylinder(known["m"], size.length, size.diameter)
    )
    yield SanityRow("inertia about x", f"{central[0, 0]:.3g} kg m^2", across)
    yield SanityRow("inertia about y, z", f"{central[1, 1]:.3g}, {central[2, 2]:.3g} kg m^2", along)
    righting = known["W"] * known["zG"] - known["B"] * known["zB"]
    below = f"centre of gravity {1e3 * (known['zG'] - known['zB']):.3g} mm below that of buoyancy"
    yield SanityRow("righting moment", f"{np.deg2rad(righting):.3g} N m for each degree", below)
    drag = -vehicle.all_coefficients()["X_u|u|"]
    slowest, fastest = spiral.speed
    yield SanityRow("spiral: speed", f"{slowest:.3g} to {fastest:.3g} m/s", f"drag {drag * fastest**2:.3g} N at most")
    roll, pitch, slip = np.rad2deg([spiral.roll, spiral.pitch, spiral.slip])
    yield SanityRow("spiral: largest roll, pitch", f"{roll:.0f}, {pitch:.0f} deg", f"slip {slip:.0f} deg at most")


def sanity_notes(vehicle: VehicleSettings, spiral: FirstSpiral) -> Iterator[str]:
    """Say what of it is doubtful, a line each."""
    yield from (str(doubt) for doubt in doubts(vehicle))
    slenderness = vehicle.size.length / vehicle.size.diameter
    if vehicle.geometry is None and not LEAST_SLENDERNESS <= slenderness <= LARGEST_SLENDERNESS:
        usual = f"{LEAST_SLENDERNESS:g} to {LARGEST_SLENDERNESS:g}, as torpedo-shaped vehicles have"
        yield str(SanityWarning("length", f"{slenderness:.3g} diameters", usual))
    displaced, mass = _displaced(vehicle), vehicle.known_parameters()["m"]
    if displaced and abs(mass / displaced - 1.0) > _LARGEST_EXCESS:
        yield str(
            SanityWarning("mass", f"{mass:.4g} kg", f"about the {displaced:.4g} kg of water that the hull displaces")
        )
    if spiral.vigour < 1.0:
        yield f"the spiral has {spiral.vigour:.0%} of the usual excitation; with more it rolls or pitches too far"


def _displaced(vehicle: VehicleSettings) -> float | None:
    """Return the mass of the water that the hull displaces, kg; None where its shape is not stated."""
    shape = vehicle.shape()
    return None if shape is None else vehicle.size.density * shape.hull.volume
