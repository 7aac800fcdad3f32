"""auvid design: plan the next run."""

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


def _limit(name: str, text: str) -> typer.models.OptionInfo:
    return typer.Option(f"--{name}", metavar="QUANTITY", help=text, show_default=False)


@dataclass(frozen=True)
class EnvelopeOptions:
    """Limits of the run: texts with units."""

    duration: Annotated[str, _limit("duration", "Duration of the run. Default: 120 s.")] = "120 s"
    box: Annotated[str | None, _limit("box", "Largest horizontal extent of the track. Default: 200 m.")] = None
    depth: Annotated[str | None, _limit("depth", "Largest range of depth. Default: 40 m.")] = None
    pitch: Annotated[str | None, _limit("pitch", "Largest pitch angle. Default: 40 deg.")] = None
    roll: Annotated[str | None, _limit("roll", "Largest roll angle. Default: 40 deg.")] = None
    speed: Annotated[str | None, _limit("speed", "Lowest speed. Default: 0.4 of the cruise speed.")] = None
    energy: Annotated[str | None, _limit("energy", "Largest work of the thrust, without losses. Default: none.")] = None
    fins: Annotated[str | None, _limit("fins", "Largest fin angle. Default: limit of the manoeuvre.")] = None
    fin_rate: Annotated[str | None, _limit("fin-rate", "Largest fin rate. Default: limit of the manoeuvre.")] = None


@dataclass(frozen=True)
class AimOptions:
    """Aim of the design, and prior knowledge of the vehicle."""

    chosen: Annotated[
        list[str] | None,
        typer.Option(
            "--for", metavar="COEFFICIENT", help="Design for this coefficient only; repeatable.", show_default=False
        ),
    ] = None
    criterion: Annotated[
        str,
        typer.Option(
            "--criterion",
            metavar="D|worst",
            help="Minimise the mean log standard deviation (D) or the largest.",
        ),
    ] = "D"
    at: Annotated[
        Path | None,
        typer.Option(
            "--at", metavar="ESTIMATE", help="Draw trial vehicles from this estimate (.h5).", show_default=False
        ),
    ] = None
    given: Annotated[
        list[Path] | None,
        typer.Option(
            "--given",
            metavar="DATASET",
            help="Dataset (.h5) whose information is already available; repeatable.",
            show_default=False,
        ),
    ] = None
    spread: Annotated[
        str | None,
        _limit("spread", "Spread of trial vehicles around the vehicle file. Default: its uncertainties, or 30 %."),
    ] = None
    draws: Annotated[int, typer.Option("--draws", metavar="N", min=1, max=1000, help="Number of trial vehicles.")] = 8


@dataclass(frozen=True)
class SearchOptions:
    """Limits and workers of the search."""

    budget: Annotated[str, _limit("budget", "Duration of the search. Default: 3 min.")] = "3 min"
    generations: Annotated[
        int | None,
        typer.Option(
            "--generations", metavar="N", min=1, help="Number of generations, instead of --budget.", show_default=False
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="Dask scheduler, such as tls://HOST:8786. Default: this machine only. At tcp://, everyone who reaches "
            "the scheduler can run code.",
            show_default=False,
        ),
    ] = None


@command
def design(
    *,
    experiment: ExperimentOptions,
    limits: EnvelopeOptions,
    aim: AimOptions,
    search: SearchOptions,
    origin: Annotated[
        str, typer.Option("--origin", metavar="LAT,LON", help="Start of the run in degrees, for track.geojson.")
    ] = "0,0",
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the mission files.")] = Path(
        "mission"
    ),
    overwrite: OverwriteOption = False,
    figure_format: FigureFormatOption = None,
    console: TerminalOptions,
) -> None:
    """Search for the most informative manoeuvre, and write the mission files for the crew.

    Each manoeuvre is tried in simulation on several vehicles, drawn from the prior knowledge, with process noise. All
    of them must keep the limits. The result is compared with spiral, doublets and zigzag on vehicles that the search
    did not use; if the spiral is as good, the spiral is written. Ctrl-C ends the search and keeps the best manoeuvre.
    A search that was killed continues with the same command.
    """
    terminal = console.terminal()
    loaded, files = experiment.load()
    for path in aim.given or ():
        refuse_log(path)
    envelope = _envelope(limits)
    time = None if search.generations else _quantity("budget", search.budget, "s")
    duration = _quantity("duration", limits.duration, "s")
    fin_angle = None if limits.fins is None else _quantity("fins", limits.fins, "rad", 1.6)
    fin_rate = None if limits.fin_rate is None else _quantity("fin-rate", limits.fin_rate, "rad/s")
    spread = None if aim.spread is None else _quantity("spread", aim.spread, "1")
    place = _origin(origin)
    if aim.criterion not in ("D", "worst"):
        raise ConfigError(f"--criterion {aim.criterion}: expected D or worst")
    with terminal.compiling():
        from auvid_cli.api.design import DesignSources, Requirement, SearchLimits, design_into
        from auvid_cli.report.screens import print_design

    result, written = design_into(
        output,
        DesignSources(loaded, files, aim.at, aim.given or []),
        Requirement(
            duration,
            envelope,
            fin_angle,
            fin_rate,
            tuple(aim.chosen or ()),
            "D" if aim.criterion == "D" else "worst",
            aim.draws,
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
    """Return a quantity in SI; refuse values outside 0 to `below`."""
    from auvid_cli.config.units import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except ValueError as error:
        raise ConfigError(f"--{option}: {error}") from None
    if not 0.0 < value < below:
        upper = f" and below {below:g} {unit}" if below < float("inf") else ""
        raise ConfigError(f"--{option} {text}: must be larger than 0{upper}")
    return value


def _envelope(limits: EnvelopeOptions) -> "Envelope":
    """Return the envelope; report all invalid limits by the names of their options."""
    from pydantic import ValidationError

    from auvid_cli.config.manoeuvre import Envelope

    texts = {name: getattr(limits, name) for name in Envelope.model_fields}
    try:
        return Envelope.model_validate({name: text for name, text in texts.items() if text is not None})
    except ValidationError as error:
        raise ConfigError("\n".join(_message(Envelope, detail) for detail in error.errors())) from None


def _message(model: "type[Envelope]", error: "ErrorDetails") -> str:
    from auvid_cli.config.locate import LIMITS
    from auvid_cli.config.units import Unit

    name, limit = str(error["loc"][0]), LIMITS.get(error["type"])
    if limit is None:
        return f"--{name}: {error['msg'].removeprefix('Value error, ')}"
    unit = next(item.unit for item in model.model_fields[name].metadata if isinstance(item, Unit))
    return f"--{name} {error['input']}: {limit.format(**error.get('ctx', {}))} {unit}"


def _origin(text: str) -> tuple[float, float]:
    """Return latitude and longitude, degrees."""
    from auvid_cli.config.units import parse_number

    try:
        latitude, longitude = (parse_number(part) for part in text.split(","))
    except ValueError:
        latitude, longitude = float("nan"), float("nan")
    if not (abs(latitude) < 89.0 and abs(longitude) <= 180.0):
        raise ConfigError(f"--origin {text}: expected latitude and longitude in degrees, such as 41.18,-8.70")
    return latitude, longitude
