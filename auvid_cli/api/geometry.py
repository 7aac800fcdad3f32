"""Vehicles from their shape."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from auvid_cli.api.argument_types import typed
from auvid_cli.config.load import parse_drawing
from auvid_cli.data.files import write_text
from auvid_cli.export.derived_vehicle import derived_vehicle_yaml


@typed
def vehicle_from_geometry(
    name: str,
    mass: float | str,
    size: Mapping[str, Any],
    geometry: Mapping[str, Any],
    file: str | Path | None = None,
) -> str:
    """Make a vehicle file of what a drawing says: inertia, added mass and the 22 coefficients, with how sure each is.

    Parameters
    ----------
    name : str
    mass : float or str
        With all water inside, kg or with a unit.
    size : mapping
        Keys of `vehicle.size`: ``length``, ``diameter``, perhaps ``density``; m and kg/m^3, or with units.
    geometry : mapping
        Keys of `vehicle.geometry`.
    file : str or pathlib.Path, optional
        To write it to; one that stands there is replaced. Default: nothing is written.

    Returns
    -------
    str
        A vehicle file. Each value that is derived has its standard deviation, the formula's number in the theory, and
        a source.

    Raises
    ------
    ConfigError
        With every mistake at once.
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> hull = {"type": "nose_cylinder_tail", "nose": "0.25 m", "tail": "0.5 m"}
    >>> fins = {"position": "1.9 m", "span": "0.1 m", "area": "80 cm^2"}
    >>> size = {"length": "2 m", "diameter": "0.2 m"}
    >>> text = auvid.vehicle_from_geometry("mine", "53 kg", size, {"hull": hull, "fins": fins}, "mine.yaml")
    >>> auvid.load_experiment("spiral", "vehicle=mine.yaml", "identification.prior=geometry").vehicle.name
    'mine'
    """
    text = derived_vehicle_yaml(parse_drawing({"name": name, "mass": mass, "size": size, "geometry": geometry}))
    if file is not None:
        write_text(Path(file), text)
    return text
