"""The files of `auvid init` as texts, with a spiral that suits the vehicle. They work without changes."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from auvid_cli.config.enums import shipped_files, shipped_part
from auvid_cli.config.loading import parse_vehicle
from auvid_cli.config.manoeuvre import Spiral
from auvid_cli.config.outline import Outline, derived_vehicle_yaml
from auvid_cli.config.sanity import MAX_SLENDERNESS, MIN_SLENDERNESS, SanityWarning, full_cylinder, sanity_warnings
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError, SimulationError
from auvid_cli.simulation.manoeuvres import make_plan
from auvid_cli.simulation.motion import Truth, simulate_motion
from auvid_cli.text import printable
from auvid_cli.vehicle.rigid_body import central_inertia

_EXCITATIONS = (1.0, 0.7, 0.5, 0.35, 0.25)  # shares of the full excitation, tried in turn
# Beyond these angles, a slightly different manoeuvre would capsize the vehicle.
_MAX_ROLL = np.deg2rad(45.0)  # rad
_MAX_PITCH = np.deg2rad(60.0)  # rad
# Full excitation.
_FIN_ANGLE = 25.0  # deg
_THRUST = 0.4  # share of the drag
_ROLL_MOMENT = 0.1  # share of the righting moment at 1 rad
_TURN_RATE = 0.1  # rad per time of travel along the vehicle's length
# Lowest and highest frequencies, in cycles per time of travel along the vehicle's length.
_RUDDER_BAND = (0.027, 0.27)
_ELEVATOR_BAND = (0.06, 0.4)
_THRUST_BAND = (0.015, 0.1)
_ROLL_BAND = (0.06, 0.6)  # shares of the natural frequency of roll
MIN_DURATION = 300.0  # s
_DURATION = 150.0  # times of travel along the vehicle's length: four periods of the lowest frequency of the rudder
_MAX_EXCESS_MASS = 0.15  # difference of mass and displaced water, share; estimated nose and tail have this error
_DEFAULT_SPEED = 1.5  # m/s, if neither the user nor the vehicle file gives one
SENSORS = """\
# Sensors of a small survey vehicle: replace rates and noise (standard deviations) by those of your sensors.
# `auvid list sensors` lists other suites; the reference explains all keys.
name: first sensors
gyroscope: {rate: 50 Hz, noise: 0.1 deg/s}
attitude: {source: direct, rate: 20 Hz, noise: 0.2 deg}
dvl: {rate: 5 Hz, noise: 0.5 cm/s}
depth: {rate: 5 Hz, noise: 2 cm}
"""
_ASSUMED = """\
- `zG`: distance of the centre of gravity below that of buoyancy: incline the vehicle, or time its roll oscillation.
- `W` and `B`: weight, and buoyancy from the weight in water. They are assumed to be equal.
- `Ixx`, `Iyy`, `Izz`: assumed to be those of a solid of uniform density.
- `X_prop`, `K_prop`: thrust and torque at the speed in `geometry.speed`. A bollard pull gives an upper limit of the
  thrust; the torque is assumed to be 0.
- `geometry`: nose, tail and fins from the drawing. After a change run `auvid init` again for new derived values."""
_DERIVED = "The vehicle is derived from length, diameter, mass and fins; each number has its method and uncertainty."
_SHIPPED = "All numbers are those of the shipped vehicle; `notes` in `vehicle.yaml` lists known problems with them."


class FirstSpiral(NamedTuple):
    """A spiral that a vehicle can follow, and its simulation."""

    lines: tuple[str, ...]  # settings as YAML
    excitation: float  # share of the full excitation
    speed: tuple[float, float]  # lowest and highest speed after the start, m/s
    roll: float  # largest roll of the whole run, to either side, rad
    pitch: float  # largest pitch of the whole run, up or down, rad
    slip: float  # largest angle between axis and flow after the start, rad
    depth: float  # depth at the end, m


def cruising_speed(vehicle: VehicleSettings) -> float | None:
    """Return the speed at which drag equals the thrust in the vehicle file, m/s; None without thrust or drag."""
    thrust, drag = vehicle.known_parameters()["X_prop"], -vehicle.all_coefficients()["X_u|u|"]
    return float(np.sqrt(thrust / drag)) if thrust > 0.0 and drag > 0.0 else None


def first_spiral(vehicle: VehicleSettings, speed: float) -> FirstSpiral:
    """Return the spiral with the most excitation in which the vehicle does not roll or pitch too far.

    The vehicle needs all coefficients; `speed` is in m/s. ConfigError if even the least excitation is too much.
    """
    reason = ""
    for excitation in _EXCITATIONS:
        lines = spiral_lines(vehicle, speed, excitation)
        spiral = Spiral.model_validate(yaml.safe_load("\n".join(lines)))
        plan = make_plan(spiral)
        try:
            truth = simulate_motion(vehicle, spiral, plan, np.zeros((plan.time.size, 6)))
        except SimulationError as error:
            reason = str(error)
            continue
        result = _result(truth, lines, excitation, spiral.excitation.fade_in)
        if result.roll <= _MAX_ROLL and result.pitch <= _MAX_PITCH:
            return result
        reason = f"roll reached {np.rad2deg(result.roll):.0f} deg and pitch {np.rad2deg(result.pitch):.0f} deg"
    slenderness = vehicle.size.length / vehicle.size.diameter
    is_usual = MIN_SLENDERNESS <= slenderness <= MAX_SLENDERNESS
    usual = f"expected {MIN_SLENDERNESS:g} to {MAX_SLENDERNESS:g}"
    raise ConfigError(
        f"{vehicle.name}: cannot follow the gentlest spiral at {speed:g} m/s ({reason}); give a lower --speed, or "
        f"check fins, mass and size{'' if is_usual else f' ({slenderness:.3g} diameters long; {usual})'}"
    )


def spiral_lines(vehicle: VehicleSettings, speed: float, excitation: float) -> tuple[str, ...]:
    """Return the settings of a spiral for a vehicle, with a share of the full excitation."""
    parameters, length_time = vehicle.known_parameters(), vehicle.size.length / speed
    righting = max(
        parameters["W"] * parameters["zG"] - parameters["B"] * parameters["zB"],
        0.01 * parameters["W"] * vehicle.size.diameter,
    )
    rolling = float(np.sqrt(righting / (parameters["Ixx"] - parameters["K_pdot"]))) / (2.0 * np.pi)
    drag = -vehicle.all_coefficients()["X_u|u|"] * speed**2
    fins, duration = (
        f"{excitation * _FIN_ANGLE:.3g} deg",
        max(MIN_DURATION, 10.0 * np.ceil(0.1 * _DURATION * length_time)),
    )
    by_length, by_roll = 1.0 / length_time, rolling
    return (
        f"name: spiral at {speed:.3g} m/s",
        "type: spiral",
        f"duration: {duration:.0f} s",
        f"speed: {speed:.4g} m/s",
        f"initial_speed: {min(0.2, 0.2 * speed):.3g} m/s",
        f"turn_rate: {np.rad2deg(excitation * _TURN_RATE * by_length):.3g} deg/s",
        "pitch: -10 deg",
        "limits: {fin_angle: 25 deg, fin_rate: 60 deg/s}",
        "autopilot: {bandwidth: 0.6}",
        "excitation:",
        "  fade_in: 30 s",
        _sines("rudder", fins, _RUDDER_BAND, by_length, 9, 0),
        _sines("elevator", fins, _ELEVATOR_BAND, by_length, 9, 60),
        _sines("surge_force", f"{_THRUST * drag:.3g} N", _THRUST_BAND, by_length, 5, 120),
        _sines("roll_moment", f"{excitation * _ROLL_MOMENT * righting:.3g} N*m", _ROLL_BAND, by_roll, 7, 180),
    )


def _sines(channel: str, amplitude: str, band: tuple[float, float], times: float, lines: int, phase: int) -> str:
    low, high = (f"{times * bound:.3g} Hz" for bound in band)
    return (
        f"  {channel}: {{amplitude: {amplitude}, lowest: {low}, highest: {high}, lines: {lines}, phase: {phase} deg}}"
    )


def _result(truth: Truth, lines: tuple[str, ...], excitation: float, start: float) -> FirstSpiral:
    motion = truth.motion[truth.time >= start]
    speed = motion[:, 0]
    slip = np.arctan2(np.hypot(motion[:, 1], motion[:, 2]), speed)
    roll, pitch = np.abs(truth.motion[:, 6:8]).max(axis=0)
    return FirstSpiral(
        lines,
        excitation,
        (float(speed.min()), float(speed.max())),
        float(roll),
        float(pitch),
        float(slip.max()),
        float(truth.position[-1, 2]),
    )


class SanityRow(NamedTuple):
    """A quantity of a vehicle, its value, and a value to compare it with."""

    quantity: str
    value: str
    comparison: str


def sanity_rows(vehicle: VehicleSettings, spiral: FirstSpiral) -> Iterator[SanityRow]:
    """Yield quantities that follow from a vehicle, and results of the simulated spiral."""
    parameters, size = vehicle.known_parameters(), vehicle.size
    slenderness = size.length / size.diameter
    usual = f"expected {MIN_SLENDERNESS:g} to {MAX_SLENDERNESS:g}"
    yield SanityRow("length", f"{size.length:.4g} m", f"{slenderness:.3g} diameters; {usual}")
    if (shape := vehicle.shape()) is not None:
        span, chord = shape.fins.span, shape.fins.area / shape.fins.span
        relative = f"{span / size.diameter:.2g} diameters, {chord / size.length:.2g} lengths; {shape.fins.number} fins"
        yield SanityRow("fin: span, mean chord", f"{span:.3g}, {chord:.3g} m", relative)
    if displaced := _displaced(vehicle):
        share = f"{parameters['m'] / displaced:.3g} times as much"
        yield SanityRow("water displaced by the hull", f"{displaced:.4g} kg", f"mass {parameters['m']:.4g} kg, {share}")
    yield SanityRow("buoyancy", f"{parameters['B']:.4g} N", f"weight {parameters['W']:.4g} N")
    central = central_inertia(parameters)
    axial, transverse = (
        f"full cylinder: {full:.3g} kg m^2" for full in full_cylinder(parameters["m"], size.length, size.diameter)
    )
    yield SanityRow("inertia about x", f"{central[0, 0]:.3g} kg m^2", axial)
    yield SanityRow("inertia about y, z", f"{central[1, 1]:.3g}, {central[2, 2]:.3g} kg m^2", transverse)
    righting = parameters["W"] * parameters["zG"] - parameters["B"] * parameters["zB"]
    below = f"centre of gravity {1e3 * (parameters['zG'] - parameters['zB']):.3g} mm below the centre of buoyancy"
    yield SanityRow("righting moment", f"{np.deg2rad(righting):.3g} N m per degree", below)
    drag = -vehicle.all_coefficients()["X_u|u|"]
    slowest, fastest = spiral.speed
    yield SanityRow("spiral: speed", f"{slowest:.3g} to {fastest:.3g} m/s", f"drag {drag * fastest**2:.3g} N at most")
    roll, pitch, slip = np.rad2deg([spiral.roll, spiral.pitch, spiral.slip])
    yield SanityRow("spiral: largest roll, pitch", f"{roll:.0f}, {pitch:.0f} deg", f"sideslip at most {slip:.0f} deg")


def sanity_notes(vehicle: VehicleSettings, spiral: FirstSpiral) -> Iterator[str]:
    """Yield a line for each implausible value."""
    yield from (str(warning) for warning in sanity_warnings(vehicle))
    slenderness = vehicle.size.length / vehicle.size.diameter
    if vehicle.geometry is None and not MIN_SLENDERNESS <= slenderness <= MAX_SLENDERNESS:
        usual = f"{MIN_SLENDERNESS:g} to {MAX_SLENDERNESS:g} for a torpedo-shaped vehicle"
        yield str(SanityWarning("length", f"{slenderness:.3g} diameters", usual))
    displaced, mass = _displaced(vehicle), vehicle.known_parameters()["m"]
    if displaced and abs(mass / displaced - 1.0) > _MAX_EXCESS_MASS:
        yield str(
            SanityWarning("mass", f"{mass:.4g} kg", f"about the {displaced:.4g} kg of water that the hull displaces")
        )
    if spiral.excitation < 1.0:
        yield f"the spiral has {spiral.excitation:.0%} of the usual excitation; with more it rolls or pitches too far"


def _displaced(vehicle: VehicleSettings) -> float | None:
    """Return the mass of the water that the hull displaces, kg; None without a geometry."""
    shape = vehicle.shape()
    return None if shape is None else vehicle.size.density * shape.hull.volume


_EXPERIMENT = """\
# An experiment with the vehicle in vehicle.yaml: `auvid run` simulates it, identifies it and reports.
name: %(name)s
seed: 1
vehicle: vehicle.yaml
sensors: sensors.yaml
# Or one of `auvid list manoeuvres`: --set manoeuvre=manoeuvres/zigzag_20_20.yaml --set "manoeuvre.speed=%(speed)s"
manoeuvre:
  # The excitation is scaled by length, speed and righting moment; the simulated vehicle can follow it.
%(spiral)s
identification:
  filters: [smoother] # others: `auvid list filters`
  tolerances: usual # of known quantities; or what you measured, such as {inertia: 2 %%, delay: 1 ms}
"""

_MAP = """\
# A template of a map for your log: enter the log's columns and units, and the standard deviation of each sensor.
# `auvid import --suggest dive.csv --vehicle vehicle.yaml -o suggested.yaml` writes most of such a map from the log.
name: %(name)s_dive
vehicle: vehicle.yaml
identification:
  filters: [smoother]
  prior: %(prior)s # for coefficients that the log does not determine; without it, only the log counts
  tolerances: usual # of known quantities; or what you measured, such as {inertia: 2 %%, delay: 1 ms}
logs: {log: dive.csv}
time: time # column, s
sensors: # leave out sensors that the log does not have
  gyroscope: {columns: {p: p, q: q, r: r}, unit: deg/s, standard_deviation: 0.1 deg/s}
  attitude: {columns: {phi: roll, theta: pitch, psi: heading}, unit: deg, standard_deviation: 0.5 deg}
  dvl: {columns: {u: u, v: v, w: w}, unit: m/s, standard_deviation: 1 cm/s}
  depth: {columns: {down: depth}, unit: m, standard_deviation: 2 cm}
inputs:
  rudder: {column: rudder, unit: deg} # positive pushes the tail to starboard; else sign: -1
  elevator: {column: elevator, unit: deg} # positive pushes the tail up; else sign: -1
  thrust: {revolutions: {column: revolutions, unit: rpm}, a: %(gain)s} # thrust a n|n|, n in turns per second
"""

_README = """\
# %(name)s

%(origin)s Made by `auvid init`; change everything as you need.

| file | content |
| --- | --- |
| `vehicle.yaml` | size, mass, inertia, added mass and coefficients, each with its source |
| `sensors.yaml` | rates and noise of the sensors |
| `experiment.yaml` | a spiral for the vehicle, and the identification |
| `map.yaml` | a template of a map for your log |

## Next

    auvid run %(folder)s
    auvid import dive.csv --map %(map)s
    auvid fit %(dataset)s

The first command is a rehearsal: it simulates the vehicle, identifies it from the simulated data and compares both.
The second makes a dataset from your log `dive.csv`, once its columns are in `map.yaml`. The third finds the model of
your vehicle from that dataset: coefficients, and errors such as a current, trims and delays.

## Measure what you can

%(assumed)s
"""


class FirstFolder(NamedTuple):
    """Files of a first folder."""

    texts: dict[str, str]  # text of each file, by its name
    vehicle: VehicleSettings
    spiral: FirstSpiral
    assumed: tuple[str, ...] = ()  # defaults in use, each as an option of `auvid init`


def folder_of_outline(folder: Path, outline: Outline) -> FirstFolder:
    """Return the files for a vehicle that is derived from its outline; ConfigError if it cannot follow any spiral."""
    name = _name_of(folder)
    heading = f"# {name}: derived values follow from hull, fins and mass, by the numbered formulas of auvid's theory.\n"
    text = heading + derived_vehicle_yaml(outline.drawing(name))
    return _folder(folder, text, outline.speed, _DERIVED, _ASSUMED)._replace(assumed=outline.assumed())


def folder_like(folder: Path, like: str, speed: float | None) -> FirstFolder:
    """Return the files for a copy of a shipped vehicle.

    Parameters
    ----------
    like : str
        Name of the vehicle, such as ``remus100``.
    speed : float or None
        Speed of the spiral, m/s; None for the speed at which drag equals the thrust in the vehicle file.

    Raises
    ------
    ConfigError
        If no such vehicle ships, or it cannot follow any spiral.
    """
    part = like if like.endswith(".yaml") else f"vehicles/{like}.yaml"
    path = shipped_part(part)
    if path is None or path.parent.name != "vehicles":
        names = ", ".join(Path(file.name).stem for file in shipped_files("vehicles"))
        raise ConfigError(f"--like {like}: no such vehicle ships with auvid; expected one of {names}")
    described, _, rest = path.read_text(encoding="utf-8").partition("\n")
    text = f"# As {part} of auvid: {described.removeprefix('# ')}\n{rest}"
    return _folder(folder, text, speed, f"The vehicle is a copy of `{part}`.", _SHIPPED)


def _folder(folder: Path, vehicle_text: str, speed: float | None, origin: str, assumed: str) -> FirstFolder:
    vehicle = parse_vehicle(vehicle_text, "vehicle.yaml")
    speed = speed or cruising_speed(vehicle) or _DEFAULT_SPEED
    spiral, name = first_spiral(vehicle, speed), _name_of(folder)
    drag = -vehicle.all_coefficients()["X_u|u|"]
    values = {
        "name": name,
        "spiral": "\n".join(f"  {line}" for line in spiral.lines),
        "speed": f"{speed:.3g} m/s",
        "prior": "geometry" if vehicle.geometry else "{mean: vehicle}",
        # Guess: the propeller makes 25 turns per second at that speed.
        "gain": f"{drag * speed**2 / 25.0**2:.3g}",
        "folder": printable(shlex.quote(str(folder))),
        "map": printable(shlex.quote(str(folder / "map.yaml"))),
        "dataset": f"results/{name}_dive/dataset.h5",
        "origin": origin,
        "assumed": assumed,
    }
    texts = {
        "vehicle.yaml": vehicle_text,
        "sensors.yaml": SENSORS,
        "experiment.yaml": _EXPERIMENT % values,
        "map.yaml": _MAP % values,
        "README.md": _README % values,
    }
    return FirstFolder(texts, vehicle, spiral)


def _name_of(folder: Path) -> str:
    """Return the folder's name, without the characters that names of experiments cannot have."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", folder.absolute().name, flags=re.ASCII).lstrip("_.-") or "first"
