"""A first spiral manoeuvre for a vehicle, and whether its simulation is plausible."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import yaml

from auvid_cli.config.manoeuvre import Spiral
from auvid_cli.config.sanity import MAX_SLENDERNESS, MIN_SLENDERNESS, SanityWarning, doubts, full_cylinder
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError, SimulationError
from auvid_cli.simulation.manoeuvres import make_plan
from auvid_cli.simulation.motion import Truth, simulate_motion
from auvid_cli.vehicle.matrices import central_inertia

# Shares of the full excitation that are tried in turn.
_VIGOURS = 1.0, 0.7, 0.5, 0.35, 0.25
# rad; beyond, the next manoeuvre that differs a little capsizes.
_LARGEST_ROLL, _LARGEST_PITCH = np.deg2rad(45.0), np.deg2rad(60.0)
# Of the full excitation: fins in degrees; thrust of the drag; roll moment of that which rights it at 1 rad.
_FINS, _THRUST, _ROLL = 25.0, 0.4, 0.1
# Yaw rate, and lowest and highest frequencies, Hz, of rudder, elevator and thrust, times length by speed.
_TURN, _RUDDER, _ELEVATOR, _SURGE = 0.1, (0.027, 0.27), (0.06, 0.4), (0.015, 0.1)
# The same of the roll moment, by the frequency in which the vehicle rolls.
_ROLLING = 0.06, 0.6
# s; times length by speed, as long as the slowest of these takes to turn four times.
_SHORTEST, _LENGTHS = 300.0, 150.0
# Of mass from what the hull displaces; a nose and a tail that nobody measured are worth as much.
_LARGEST_EXCESS = 0.15


class FirstSpiral(NamedTuple):
    """A spiral that a vehicle survives.

    Attributes
    ----------
    lines : tuple of str
        Its settings as YAML, a line each.
    vigour : float
        Share of the full excitation.
    speed : tuple of float
        Lowest and highest after the start, m/s.
    roll, pitch : float
        Largest of the whole run, rad.
    slip : float
        Largest angle between axis and flow after the start, rad.
    depth : float
        At the end, m.
    """

    lines: tuple[str, ...]
    excitation: float
    speed: tuple[float, float]
    roll: float
    pitch: float
    slip: float
    depth: float


def cruising_speed(vehicle: VehicleSettings) -> float | None:
    """Return the speed at which drag takes the stated thrust of the propeller, m/s; None if nothing is stated."""
    thrust, drag = vehicle.known_parameters()["X_prop"], -vehicle.all_coefficients()["X_u|u|"]
    return float(np.sqrt(thrust / drag)) if thrust > 0.0 and drag > 0.0 else None


def first_spiral(vehicle: VehicleSettings, speed: float) -> FirstSpiral:
    """Find the most vigorous spiral that a vehicle survives without rolling or pitching far.

    Parameters
    ----------
    vehicle : VehicleSettings
        With all coefficients.
    speed : float
        To be held, m/s.

    Raises
    ------
    ConfigError
        If it survives none.
    """
    said = ""
    for vigour in _VIGOURS:
        lines = spiral_lines(vehicle, speed, vigour)
        spiral = Spiral.model_validate(yaml.safe_load("\n".join(lines)))
        plan = make_plan(spiral)
        try:
            truth = simulate_motion(vehicle, spiral, plan, np.zeros((plan.time.size, 6)))
        except SimulationError as error:
            said = str(error)
            continue
        tried = _tried(truth, lines, vigour, spiral.excitation.fade_in)
        if tried.roll <= _LARGEST_ROLL and tried.pitch <= _LARGEST_PITCH:
            return tried
        said = f"roll reached {np.rad2deg(tried.roll):.0f} deg and pitch {np.rad2deg(tried.pitch):.0f} deg"
    slenderness = vehicle.size.length / vehicle.size.diameter
    is_usual = MIN_SLENDERNESS <= slenderness <= MAX_SLENDERNESS
    usual = f"usual are {MIN_SLENDERNESS:g} to {MAX_SLENDERNESS:g}"
    raise ConfigError(
        f"{vehicle.name}: does not survive the gentlest spiral at {speed:g} m/s ({said}); name a lower --speed, or "
        f"check fins, mass and size{'' if is_usual else f' ({slenderness:.3g} diameters long; {usual})'}"
    )


def spiral_lines(vehicle: VehicleSettings, speed: float, vigour: float) -> tuple[str, ...]:
    """Write the settings of a spiral that suits a vehicle, with so much of the full excitation."""
    known, slowness = vehicle.known_parameters(), vehicle.size.length / speed
    righting = max(known["W"] * known["zG"] - known["B"] * known["zB"], 0.01 * known["W"] * vehicle.size.diameter)
    rolling = float(np.sqrt(righting / (known["Ixx"] - known["K_pdot"]))) / (2.0 * np.pi)
    drag = -vehicle.all_coefficients()["X_u|u|"] * speed**2
    fins, duration = f"{vigour * _FINS:.3g} deg", max(_SHORTEST, 10.0 * np.ceil(0.1 * _LENGTHS * slowness))
    by_length, by_roll = 1.0 / slowness, rolling
    return (
        f"name: spiral at {speed:.3g} m/s",
        "type: spiral",
        f"duration: {duration:.0f} s",
        f"speed: {speed:.4g} m/s",
        f"initial_speed: {min(0.2, 0.2 * speed):.3g} m/s",
        f"turn_rate: {np.rad2deg(vigour * _TURN * by_length):.3g} deg/s",
        "pitch: -10 deg",
        "limits: {fin_angle: 25 deg, fin_rate: 60 deg/s}",
        "autopilot: {bandwidth: 0.6}",
        "excitation:",
        "  fade_in: 30 s",
        _sines("rudder", fins, _RUDDER, by_length, 9, 0),
        _sines("elevator", fins, _ELEVATOR, by_length, 9, 60),
        _sines("surge_force", f"{_THRUST * drag:.3g} N", _SURGE, by_length, 5, 120),
        _sines("roll_moment", f"{vigour * _ROLL * righting:.3g} N*m", _ROLLING, by_roll, 7, 180),
    )


def _sines(channel: str, amplitude: str, band: tuple[float, float], times: float, lines: int, phase: int) -> str:
    low, high = (f"{times * bound:.3g} Hz" for bound in band)
    return (
        f"  {channel}: {{amplitude: {amplitude}, lowest: {low}, highest: {high}, lines: {lines}, phase: {phase} deg}}"
    )


def _tried(truth: Truth, lines: tuple[str, ...], vigour: float, after: float) -> FirstSpiral:
    motion = truth.motion[truth.time >= after]
    speed = motion[:, 0]
    slip = np.arctan2(np.hypot(motion[:, 1], motion[:, 2]), speed)
    roll, pitch = np.abs(truth.motion[:, 6:8]).max(axis=0)
    return FirstSpiral(
        lines,
        vigour,
        (float(speed.min()), float(speed.max())),
        float(roll),
        float(pitch),
        float(slip.max()),
        float(truth.position[-1, 2]),
    )


class SanityRow(NamedTuple):
    """A quantity of a vehicle, its value, and what to hold it against."""

    quantity: str
    value: str
    comparison: str


def sanity_rows(vehicle: VehicleSettings, spiral: FirstSpiral) -> Iterator[SanityRow]:
    """List what a vehicle comes to, and what it did in the simulated spiral."""
    known, size = vehicle.known_parameters(), vehicle.size
    slenderness = size.length / size.diameter
    usual = f"usual are {MIN_SLENDERNESS:g} to {MAX_SLENDERNESS:g}"
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
    if vehicle.geometry is None and not MIN_SLENDERNESS <= slenderness <= MAX_SLENDERNESS:
        usual = f"{MIN_SLENDERNESS:g} to {MAX_SLENDERNESS:g}, as torpedo-shaped vehicles have"
        yield str(SanityWarning("length", f"{slenderness:.3g} diameters", usual))
    displaced, mass = _displaced(vehicle), vehicle.known_parameters()["m"]
    if displaced and abs(mass / displaced - 1.0) > _LARGEST_EXCESS:
        yield str(
            SanityWarning("mass", f"{mass:.4g} kg", f"about the {displaced:.4g} kg of water that the hull displaces")
        )
    if spiral.excitation < 1.0:
        yield f"the spiral has {spiral.excitation:.0%} of the usual excitation; with more it rolls or pitches too far"


def _displaced(vehicle: VehicleSettings) -> float | None:
    """Return the mass of the water that the hull displaces, kg; None where its shape is not stated."""
    shape = vehicle.shape()
    return None if shape is None else vehicle.size.density * shape.hull.volume
