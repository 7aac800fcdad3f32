"""auvid design: the next run."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli.options import (
    ExperimentOptions,
    FigureFormatOption,
    OverwriteOption,
    TerminalOptions,
    command,
    refuse_log,
)
from auvid_cli.config.enums import FigureFormat
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

    from auvid_cli.config.manoeuvre import Envelope


def _limit(name: str, what: str) -> typer.models.OptionInfo:
    return typer.Option(f"--{name}", metavar="QUANTITY", help=what, show_default=False)


@dataclass(frozen=True)
class EnvelopeOptions:
    """Limits of the run, as they were written."""

    duration: Annotated[str, _limit("duration", "Length of the run. Default: 120 s.")] = "120 s"
    box: Annotated[str | None, _limit("box", "Largest extent of the track. Default: 200 m.")] = None
    depth: Annotated[str | None, _limit("depth", "From the shallowest to the deepest point. Default: 40 m.")] = None
    pitch: Annotated[str | None, _limit("pitch", "Largest pitch. Default: 40 deg.")] = None
    roll: Annotated[str | None, _limit("roll", "Largest roll. Default: 40 deg.")] = None
    speed: Annotated[str | None, _limit("speed", "Least speed. Default: 0.4 of the cruise.")] = None
    energy: Annotated[str | None, _limit("energy", "Largest work of the thrust, without losses. Default: any.")] = None
    fins: Annotated[str | None, _limit("fins", "Largest fin angle. Default: the manoeuvre's limits.")] = None
    fin_rate: Annotated[str | None, _limit("fin-rate", "Largest fin rate. Default: the manoeuvre's limits.")] = None


@dataclass(frozen=True)
class WishOptions:
    """Aim of the design, and what is known of the vehicle before it."""

    chosen: Annotated[
        list[str] | None,
        typer.Option(
            "--for", metavar="COEFFICIENT", help="Count this coefficient only; repeatable.", show_default=False
        ),
    ] = None
    criterion: Annotated[
        str, typer.Option("--criterion", metavar="D|worst", help="Mean of the logarithms of the sd, or the largest.")
    ] = "D"
    at: Annotated[
        Path | None,
        typer.Option("--at", metavar="ESTIMATE", help="Draw vehicles from this estimate (.h5).", show_default=False),
    ] = None
    given: Annotated[
        list[Path] | None,
        typer.Option(
            "--given",
            metavar="DATASET",
            help="Count what this dataset (.h5) says as known already; repeatable.",
            show_default=False,
        ),
    ] = None
    spread: Annotated[
        str | None,
        _limit("spread", "Draw vehicles so far about the vehicle file's values. Default: as it states, else 30 %."),
    ] = None
    draws: Annotated[int, typer.Option("--draws", metavar="N", min=1, max=1000, help="Vehicles the search sees.")] = 8


@dataclass(frozen=True)
class SearchOptions:
    """Limits of the search, and its workers."""

    budget: Annotated[str, _limit("budget", "Time to search. Default: 3 min.")] = "3 min"
    generations: Annotated[
        int | None,
        typer.Option(
            "--generations", metavar="N", min=1, help="Search so many generations instead.", show_default=False
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="Dask scheduler, such as tcp://10.0.0.1:8786. Default: the cores of this machine.",
            show_default=False,
        ),
    ] = None


@command
def design(
    *,
    experiment: ExperimentOptions,
    limits: EnvelopeOptions,
    wish: WishOptions,
    search: SearchOptions,
    origin: Annotated[
        str, typer.Option("--origin", metavar="LAT,LON", help="Where the run begins, degrees, for track.geojson.")
    ] = "0,0",
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the files of the crew.")
    ] = Path("mission"),
    overwrite: OverwriteOption = False,
    figure_format: FigureFormatOption = None,
    console: TerminalOptions,
) -> None:
    """Find the run that tells most of a vehicle, and write what a crew needs to sail it.

    Manoeuvres are tried on vehicles drawn about what is known, with process noise, in an envelope that all of them
    keep. What comes out is compared with spiral, doublets and zigzag on vehicles that the search has not seen; where
    the spiral is as good, it is written. Ctrl-C ends the search and keeps the best so far; one that was killed goes on
    by the same command.
    """
    terminal = console.terminal()
    loaded, files = experiment.load()
    for path in wish.given or ():
        refuse_log(path)
    envelope = _envelope(
        box=limits.box,
        depth=limits.depth,
        pitch=limits.pitch,
        roll=limits.roll,
        speed=limits.speed,
        energy=limits.energy,
    )
    time = None if search.generations else _quantity("budget", search.budget, "s")
    duration = _quantity("duration", limits.duration, "s")
    fin_angle = None if limits.fins is None else _quantity("fins", limits.fins, "rad", 1.6)
    fin_rate = None if limits.fin_rate is None else _quantity("fin-rate", limits.fin_rate, "rad/s")
    spread = None if wish.spread is None else _quantity("spread", wish.spread, "1")
    place = _origin(origin)
    if wish.criterion not in ("D", "worst"):
        raise ConfigError(f"--criterion {wish.criterion}: expected D or worst")
    with terminal.compiling():
        from auvid_cli.api.design import DesignSources, Requirement, SearchLimits, design_into
        from auvid_cli.report.screens import print_design

    result, written = design_into(
        output,
        DesignSources(loaded, files, wish.at, wish.given or []),
        Requirement(
            duration,
            envelope,
            fin_angle,
            fin_rate,
            tuple(wish.chosen or ()),
            "D" if wish.criterion == "D" else "worst",
            wish.draws,
            spread,
        ),
        SearchLimits(search.generations, time),
        search.scheduler,
        place,
        overwrite,
        figure_format or (FigureFormat.PNG,),
        terminal,
    )
    print_design(terminal.out, result)
    terminal.print_lines(written)


def _quantity(option: str, text: str, unit: str, below: float = float("inf")) -> float:
    """Read a quantity above 0 and below a limit.

    Raises
    ------
    ConfigError
        If it is not such a quantity.
    """
    from auvid_cli.config.units import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except ValueError as error:
        raise ConfigError(f"--{option}: {error}") from None
    if not 0.0 < value < below:
        upper = f" and below {below:g} {unit}" if below < float("inf") else ""
        raise ConfigError(f"--{option} {text}: expected more than 0{upper}")
    return value


def _envelope(**limits: str | None) -> "Envelope":
    """Read the limits that are given, each by the name of its option.

    Raises
    ------
    ConfigError
        With a line for each that is wrong.
    """
    from pydantic import ValidationError

    from auvid_cli.config.manoeuvre import Envelope

    try:
        return Envelope.model_validate({name: text for name, text in limits.items() if text is not None})
    except ValidationError as error:
        raise ConfigError("\n".join(_complaint(Envelope, each) for each in error.errors())) from None


def _complaint(model: "type[Envelope]", error: "ErrorDetails") -> str:
    from auvid_cli.config.locate import LIMITS
    from auvid_cli.config.units import Unit

    name, limit = str(error["loc"][0]), LIMITS.get(error["type"])
    if limit is None:
        return f"--{name}: {error['msg'].removeprefix('Value error, ')}"
    unit = next(each.unit for each in model.model_fields[name].metadata if isinstance(each, Unit))
    return f"--{name} {error['input']}: {limit.format(**error.get('ctx', {}))} {unit}"


def _origin(text: str) -> tuple[float, float]:
    """Read latitude and longitude, degrees.

    Raises
    ------
    ConfigError
        If the text is anything else.
    """
    from auvid_cli.config.units import parse_number

    try:
        latitude, longitude = (parse_number(part) for part in text.split(","))
    except ValueError:
        latitude, longitude = float("nan"), float("nan")
    if not (abs(latitude) < 89.0 and abs(longitude) <= 180.0):
        raise ConfigError(f"--origin {text}: expected latitude and longitude in degrees, such as 41.18,-8.70")
    return latitude, longitude
