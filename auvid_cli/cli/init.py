"""auvid init."""

from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.options import QuietOption
from auvid_cli.cli.terminal import Terminal, reporting_errors


def _quantity(metavar: str, text: str) -> typer.models.OptionInfo:
    return typer.Option(metavar=metavar, help=text, show_default=False)


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="New folder.", show_default=False)],
    length: Annotated[str | None, _quantity("LENGTH", "Of the hull, e.g. 2 m.")] = None,
    diameter: Annotated[str | None, _quantity("LENGTH", "Of the hull, e.g. 20 cm.")] = None,
    mass: Annotated[str | None, _quantity("MASS", "With all water inside, e.g. 60 kg.")] = None,
    fin_span: Annotated[str | None, _quantity("LENGTH", "Of one fin from root to tip, e.g. 10 cm.")] = None,
    fin_area: Annotated[str | None, _quantity("AREA", "Of one fin, e.g. 80 cm^2.")] = None,
    fin_position: Annotated[
        str | None, _quantity("LENGTH", "Of the fins' hinges, from the nose. Default: 94 % of the length.")
    ] = None,
    fins: Annotated[int | None, _quantity("NUMBER", "Number of fins. Default: 4.")] = None,
    tail: Annotated[str | None, _quantity("+|x", "How they stand. Default: +.")] = None,
    nose: Annotated[str | None, _quantity("LENGTH", "Length of the nose. Default: about a diameter.")] = None,
    tail_length: Annotated[
        str | None, _quantity("LENGTH", "Of the tapering tail. Default: about 2.5 diameters.")
    ] = None,
    speed: Annotated[str | None, _quantity("SPEED", "At which it travels. Default: 1.5 m/s.")] = None,
    density: Annotated[str | None, _quantity("DENSITY", "Of the water. Default: 1025 kg/m^3.")] = None,
    like: Annotated[
        str | None, _quantity("NAME", "Start at a vehicle that ships, e.g. remus100, instead of all that.")
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """Make a folder to begin with: a vehicle from a few numbers, sensors, an experiment, a map, and what to do next.

    A number without a unit is SI. What is missing is asked for on a terminal.
    """
    options = {
        "length": length,
        "diameter": diameter,
        "mass": mass,
        "fin_span": fin_span,
        "fin_area": fin_area,
        "fin_position": fin_position,
        "fins": fins,
        "tail": tail,
        "nose": nose,
        "tail_length": tail_length,
        "speed": speed,
        "density": density,
    }
    with reporting_errors():
        from auvid_cli.cli.initialising import initialise

        given = {key: value for key, value in options.items() if value is not None}
        initialise(folder, given, like, Terminal(quiet, verbose=False))
