"""The files of `auvid init` as texts: vehicle, sensors, experiment, map and README. They work without changes."""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

from auvid_cli.config.loading import parse_vehicle
from auvid_cli.config.outline import Outline
from auvid_cli.config.shipped import shipped_files, shipped_part
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError
from auvid_cli.export.derived_vehicle import derived_vehicle_yaml
from auvid_cli.start.first_spiral import FirstSpiral, cruising_speed, first_spiral
from auvid_cli.text import printable

_DEFAULT_SPEED = 1.5  # m/s, if neither the user nor the vehicle file gives one

_SENSORS = """\
# Sensors of a small survey vehicle: replace rates and noise (standard deviations) by those of your sensors.
# `auvid list sensors` lists other suites; the reference explains all keys.
name: first sensors
gyroscope: {rate: 50 Hz, noise: 0.1 deg/s}
attitude: {source: direct, rate: 20 Hz, noise: 0.2 deg}
dvl: {rate: 5 Hz, noise: 0.5 cm/s}
depth: {rate: 5 Hz, noise: 2 cm}
"""

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
# `auvid import --suggest dive.csv -o suggested.yaml` reads the log and writes most of such a map.
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

_ASSUMED = """\
- `zG`: distance of the centre of gravity below that of buoyancy: incline the vehicle, or time its roll oscillation.
- `W` and `B`: weight, and buoyancy from the weight in water. They are assumed to be equal.
- `Ixx`, `Iyy`, `Izz`: assumed to be those of a solid of uniform density.
- `X_prop`, `K_prop`: thrust and torque at the speed in `geometry.speed`. A bollard pull gives an upper limit of the
  thrust; the torque is assumed to be 0.
- `geometry`: nose, tail and fins from the drawing. After a change run `auvid init` again for new derived values."""
_DERIVED = "The vehicle is derived from length, diameter, mass and fins; each number has its method and uncertainty."
_SHIPPED = "All numbers are those of the shipped vehicle; `notes` in `vehicle.yaml` lists known problems with them."


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
        "sensors.yaml": _SENSORS,
        "experiment.yaml": _EXPERIMENT % values,
        "map.yaml": _MAP % values,
        "README.md": _README % values,
    }
    return FirstFolder(texts, vehicle, spiral)


def _name_of(folder: Path) -> str:
    """Return the folder's name, without the characters that names of experiments cannot have."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", folder.absolute().name, flags=re.ASCII).lstrip("_.-") or "first"
