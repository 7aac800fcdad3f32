"""The files of a folder to begin with, as texts: they work at once, and say what to put in their place."""

import re
import shlex
from collections.abc import Iterable
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

# m/s, where neither the user nor the vehicle file says.
_USUAL_SPEED = 1.5

_SENSORS = """\
# What a small survey vehicle carries: put in the rates and the noise of your own.
# One standard deviation each. `auvid list sensors` names other suites; the reference has every key.
name: first sensors
gyroscope: {rate: 50 Hz, noise: 0.1 deg/s}
attitude: {source: direct, rate: 20 Hz, noise: 0.2 deg}
dvl: {rate: 5 Hz, noise: 0.5 cm/s}
depth: {rate: 5 Hz, noise: 2 cm}
"""

_EXPERIMENT = """\
# An experiment with the vehicle beside: `auvid run` simulates it, identifies it and reports.
name: %(name)s
seed: 1
vehicle: vehicle.yaml
sensors: sensors.yaml
# Or one of `auvid list manoeuvres`: --set manoeuvre=manoeuvres/zigzag_20_20.yaml --set "manoeuvre.speed=%(speed)s"
manoeuvre:
  # Excitation in proportion to length, speed and righting moment; the simulated vehicle survives it.
%(spiral)s
identification:
  filters: [smoother] # others: `auvid list filters`
"""

_MAP = """\
# A template: what is what in a log of yours. Put in its columns and units, and how sure each sensor is.
# `auvid import --suggest dive.csv -o suggested.yaml` looks at the log itself and writes most of such a map.
name: %(name)s_dive
vehicle: vehicle.yaml
identification:
  filters: [smoother]
  prior: %(prior)s # of what the log does not tell; leave it out to go by the log alone
logs: {log: dive.csv}
time: time # column, s
sensors: # leave out what the log does not have
  gyroscope: {columns: {p: p, q: q, r: r}, unit: deg/s, standard_deviation: 0.1 deg/s}
  attitude: {columns: {phi: roll, theta: pitch, psi: heading}, unit: deg, standard_deviation: 0.5 deg}
  dvl: {columns: {u: u, v: v, w: w}, unit: m/s, standard_deviation: 1 cm/s}
  depth: {columns: {down: depth}, unit: m, standard_deviation: 2 cm}
inputs:
  rudder: {column: rudder, unit: deg} # positive pushes the tail to starboard; else sign: -1
  elevator: {column: elevator, unit: deg} # positive pushes the tail up; else sign: -1
  thrust: {revolutions: {column: revolutions, unit: rpm}, a: %(gain)s} # a n|n|, n in turns a second
"""

_README = """\
# %(name)s

%(origin)s Made by `auvid init`; everything here is to be changed.

| file | what it is |
| --- | --- |
| `vehicle.yaml` | size, mass, inertia, added mass and coefficients, each with where it is from |
| `sensors.yaml` | rates and noise of the sensors |
| `experiment.yaml` | a spiral that suits the vehicle, and how to identify |
| `map.yaml` | a template: what is what in a log of yours |

## Next

    auvid run %(folder)s
    auvid import dive.csv --map %(map)s
    auvid identify %(dataset)s

The first is a rehearsal: it simulates the vehicle, identifies it from what its sensors said, and compares the two.
The second makes a dataset of a log `dive.csv` of yours, once its columns stand in `map.yaml`; the third identifies
from that.

## Measure what you can

%(assumed)s
"""

_ASSUMED = """\
- `zG`: how far the centre of gravity is below that of buoyancy: incline the vehicle, or time how it rolls.
- `W` and `B`: weight, and buoyancy by the weight in water. They are taken to be equal.
- `Ixx`, `Iyy`, `Izz`: taken to be those of a solid of one density.
- `X_prop`, `K_prop`: thrust at the speed in `geometry.speed`, which a bollard pull bounds; no torque is assumed.
- `geometry`: nose, tail and fins from the drawing. What is derived changes with `auvid init`, not by itself."""
_DERIVED = "The vehicle follows from length, diameter, mass and fins; each number says how, and how sure it is."
_SHIPPED = (
    "All numbers are those of the shipped vehicle; `notes` in `vehicle.yaml` says what is known to be odd about them."
)


class FirstFolder(NamedTuple):
    """A folder to begin with.

    Attributes
    ----------
    texts : dict of str
        By the name of each file.
    vehicle : VehicleSettings
    spiral : FirstSpiral
        What the simulated vehicle did.
    assumed : tuple of str
        What of the vehicle was taken where nothing was said, each as an option of `auvid init`.
    """

    texts: dict[str, str]
    vehicle: VehicleSettings
    spiral: FirstSpiral
    assumed: tuple[str, ...] = ()


def folder_of_outline(folder: Path, outline: Outline) -> FirstFolder:
    """Make the files for a vehicle that follows from its outline.

    Raises
    ------
    ConfigError
        If it survives no spiral.
    """
    name = _name_of(folder)
    heading = (
        f"# {name}: all that is derived follows from hull, fins and mass, by formulas numbered in auvid's theory.\n"
    )
    text = heading + derived_vehicle_yaml(outline.drawing(name))
    return _folder(folder, text, outline.speed, _DERIVED, _ASSUMED)._replace(assumed=outline.assumed())


def folder_like(folder: Path, like: str, speed: float | None) -> FirstFolder:
    """Make the files for a vehicle that starts as one that ships with auvid.

    Parameters
    ----------
    folder : pathlib.Path
    like : str
        Name of the vehicle, such as ``remus100``.
    speed : float or None
        m/s; else that for which its thrust is stated.

    Raises
    ------
    ConfigError
        If no such vehicle ships, or it survives no spiral.
    """
    part = like if like.endswith(".yaml") else f"vehicles/{like}.yaml"
    path = shipped_part(part)
    if path is None or path.parent.name != "vehicles":
        known = ", ".join(Path(file.name).stem for file in shipped_files("vehicles"))
        raise ConfigError(f"--like {like}: no such vehicle ships with auvid; there are {known}")
    described, _, rest = path.read_text(encoding="utf-8").partition("\n")
    text = f"# As {part} of auvid: {described.removeprefix('# ')}\n{rest}"
    return _folder(folder, text, speed, f"The vehicle starts as `{part}`.", _SHIPPED)


def _folder(folder: Path, vehicle_text: str, speed: float | None, origin: str, assumed: str) -> FirstFolder:
    vehicle = parse_vehicle(vehicle_text, "vehicle.yaml")
    speed = speed or cruising_speed(vehicle) or _USUAL_SPEED
    spiral, name = first_spiral(vehicle, speed), _name_of(folder)
    drag = -vehicle.all_coefficients()["X_u|u|"]
    values = {
        "name": name,
        "spiral": _indented(spiral.lines),
        "speed": f"{speed:.3g} m/s",
        "prior": "geometry" if vehicle.geometry else "{mean: vehicle}",
        # As if 25 turns a second made the thrust of that speed.
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


def _indented(lines: Iterable[str]) -> str:
    return "\n".join(f"  {line}" for line in lines)


def _name_of(folder: Path) -> str:
    """Return the folder's name as far as experiments can have it."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", folder.absolute().name, flags=re.ASCII).lstrip("_.-") or "first"
