"""auvid init and list: a first folder, and the files that ship with auvid."""

import shlex
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from auvid_cli.cli import hanging
from auvid_cli.cli.options import Command, QuietOption, command, optional
from auvid_cli.cli.terminal import Terminal
from auvid_cli.config.enums import FilterName, shipped_files
from auvid_cli.data.files import refuse_filled
from auvid_cli.errors import ConfigError


@dataclass(frozen=True)
class OutlineOptions:
    """Outline of a vehicle: texts with units."""

    length: Annotated[str | None, optional("LENGTH", "Length of the hull, e.g. 2 m.")] = None
    diameter: Annotated[str | None, optional("LENGTH", "Diameter of the hull, e.g. 20 cm.")] = None
    mass: Annotated[str | None, optional("MASS", "Mass with all water inside, e.g. 60 kg.")] = None
    fin_span: Annotated[str | None, optional("LENGTH", "Span of one fin from root to tip, e.g. 10 cm.")] = None
    fin_area: Annotated[str | None, optional("AREA", "Area of one fin, e.g. 80 cm^2.")] = None
    fin_position: Annotated[
        str | None, optional("LENGTH", "Distance of the fin hinges from the nose. Default: 94 % of the length.")
    ] = None
    fins: Annotated[int | None, optional("NUMBER", "Number of fins. Default: 4.")] = None
    tail: Annotated[str | None, optional("+|x", "Arrangement of the fins. Default: +.")] = None
    nose: Annotated[str | None, optional("LENGTH", "Length of the nose. Default: about a diameter.")] = None
    tail_length: Annotated[str | None, optional("LENGTH", "Length of the tail cone. Default: about 2.5 diameters.")] = (
        None
    )
    speed: Annotated[str | None, optional("SPEED", "Cruise speed. Default: 1.5 m/s.")] = None
    density: Annotated[str | None, optional("DENSITY", "Density of the water. Default: 1025 kg/m^3.")] = None


@command
def init(
    *,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="New folder.", show_default=False)],
    outline: OutlineOptions,
    like: Annotated[str | None, optional("NAME", "Start with a shipped vehicle instead, e.g. remus100.")] = None,
    quiet: QuietOption = False,
) -> None:
    """Make a first folder: a vehicle from a few dimensions, sensors, an experiment, a log map and a README.

    Length, diameter, mass, fin span and fin area are required, unless --like names a vehicle. On a terminal, auvid asks
    for missing values. A number without a unit is in SI units.
    """
    from auvid_cli.config.outline import option

    terminal = Terminal(quiet, verbose=False)
    refuse_filled(folder)
    options = {key: value for key, value in asdict(outline).items() if value is not None}
    if like is None:
        options |= _answers(options)
    elif others := [option(key) for key in options if key != "speed"]:
        raise ConfigError(f"--like {like}: cannot be combined with {', '.join(others)}; leave out one or the other")
    with terminal.compiling():
        from auvid_cli.api.simulation import new_folder, sanity

    with terminal.stage("make the folder"):
        first = new_folder(folder, options, like)
    rows, notes = sanity(first)
    widths = [max(len(row[column]) for row in rows) for column in (0, 1)]
    for quantity, value, usual in rows:
        terminal.print(hanging(f"  {quantity:{widths[0]}}  {value:{widths[1]}}  {usual}", sum(widths) + 6))
    terminal.print_lines(f"note: {note}" for note in notes)
    if first.assumed:
        terminal.print_wrapped(f"assumed: {', '.join(first.assumed)}")
    terminal.print_wrapped(f"{folder}: {', '.join(first.texts)}")
    terminal.print(f"next: auvid run {shlex.quote(str(folder))}")


def _answers(given: Mapping[str, str | int]) -> dict[str, str]:
    """Ask for missing keys and return the answers; without a terminal raise a ConfigError."""
    from auvid_cli.config.outline import missing_keys, option, units

    missing = missing_keys(given)
    if missing and not is_interactive():
        raise ConfigError(
            f"missing {', '.join(map(option, missing))}; add them, start with a shipped vehicle (--like remus100), "
            "or run this in a terminal, which asks for them"
        )
    hints = get_type_hints(OutlineOptions, include_extras=True)
    helps = {key: hints[key].__metadata__[0].help for key in missing}
    return {key: _answer(text.removesuffix("."), units()[key]) for key, text in helps.items()}


def is_interactive() -> bool:
    """Whether a user can see a question and answer it."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def _answer(question: str, unit: str) -> str:
    from auvid_cli.config.units import parse_quantity

    def checked(text: str) -> str:
        try:
            is_positive = parse_quantity(text, unit) > 0.0
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None
        if not is_positive:
            raise typer.BadParameter("must be larger than 0")
        return text

    try:
        return typer.prompt(question, value_proc=checked)
    except typer.Abort:
        raise KeyboardInterrupt from None


class OutlineCommand(Command):
    """Command whose quantities may be two words: ``--length 2 m``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Join numbers with their units, then parse."""
        from auvid_cli.config.outline import option, units

        return super().parse_args(ctx, joined(args, {option(key): unit for key, unit in units().items()}))


def joined(words: Iterable[str], units: Mapping[str, str]) -> list[str]:
    """Join a number and its unit after an option that takes such a quantity.

    Parameters
    ----------
    units : mapping
        SI unit of each option that takes a quantity.
    """
    from auvid_cli.config.units import NUMBER

    result: list[str] = []
    for word in words:
        unit = units.get(result[-2]) if len(result) > 1 else None
        if unit is not None and NUMBER.fullmatch(result[-1]) and _is_quantity(f"{result[-1]} {word}", unit):
            result[-1] += f" {word}"
        else:
            result.append(word)
    return result


def _is_quantity(text: str, unit: str) -> bool:
    from auvid_cli.config.units import parse_quantity

    try:
        parse_quantity(text, unit)
    except ValueError:
        return False
    return True


class Listed(StrEnum):
    """Kinds of shipped files, in the order in which they are listed."""

    EXPERIMENTS = "experiments"
    VEHICLES = "vehicles"
    SENSORS = "sensors"
    MANOEUVRES = "manoeuvres"
    CAMPAIGNS = "campaigns"
    FILTERS = "filters"


USES = {
    Listed.EXPERIMENTS: "auvid run NAME",
    Listed.VEHICLES: "vehicle: NAME in an experiment, or --set vehicle=NAME",
    Listed.SENSORS: "sensors: NAME, or --set sensors=NAME",
    Listed.MANOEUVRES: "manoeuvre: NAME, or --set manoeuvre=NAME",
    Listed.CAMPAIGNS: "auvid campaign NAME",
    Listed.FILTERS: "--filter NAME, or identification.filters",
}


@command
def list_shipped(
    *,
    kinds: Annotated[
        list[Listed] | None,
        typer.Argument(metavar="KIND", help=f"{', '.join(Listed)}. Default: all.", show_default=False),
    ] = None,
) -> None:
    """List the shipped experiments, vehicles, sensors, manoeuvres and campaigns, and the filters."""
    for kind in kinds or Listed:
        rows = (
            [(name.value, name.description) for name in FilterName]
            if kind is Listed.FILTERS
            else shipped_files(kind.value)
        )
        width = max(len(name) for name, _ in rows)
        print(f"{kind.value} ({USES[kind]})")
        for name, description in rows:
            print(hanging(f"  {name:{width}}  {description}", width + 4))
