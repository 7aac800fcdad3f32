"""What `auvid init` does: ask, make the files, write them, and say what the vehicle comes to."""

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path

import typer

from auvid_cli.cli.hanging import hanging
from auvid_cli.cli.terminal import Terminal
from auvid_cli.config.outline import missing_keys, option, units
from auvid_cli.config.quantity import parse_quantity
from auvid_cli.data.files import refuse_filled, write_folder
from auvid_cli.errors import ConfigError

_QUESTIONS = {
    "length": "Length of the hull, e.g. 2 m",
    "diameter": "Diameter of the hull, e.g. 20 cm",
    "mass": "Mass with all water inside, e.g. 60 kg",
    "fin_span": "Span of one fin from root to tip, e.g. 10 cm",
    "fin_area": "Area of one fin, e.g. 80 cm^2",
}


def initialise(folder: Path, given: Mapping[str, str | int], like: str | None, terminal: Terminal) -> None:
    """Write a folder to begin with.

    Parameters
    ----------
    folder : pathlib.Path
        Must be new or empty.
    given : mapping
        Keys of an outline as they were written.
    like : str or None
        Name of the shipped vehicle to start at.
    terminal : Terminal

    Raises
    ------
    ConfigError
        If something is missing and nobody can be asked, or what is given is wrong.
    FileError
        If the folder is not empty or cannot be written.
    """
    refuse_filled(folder)
    if like is not None and (others := [option(key) for key in given if key != "speed"]):
        raise ConfigError(f"--like {like} is a whole vehicle: leave out {', '.join(others)}, or --like")
    options = dict(given) if like is not None else dict(given) | _answers(given)
    with terminal.compiling():
        from auvid_cli.api.starting import first_folder, sanity
    with terminal.stage("make the folder"):
        first = first_folder(folder, options, like)
    write_folder(folder, first.texts)
    rows, notes = sanity(first)
    widths = [max(len(row[column]) for row in rows) for column in (0, 1)]
    for quantity, value, beside in rows:
        terminal.say(hanging(f"  {quantity:{widths[0]}}  {value:{widths[1]}}  {beside}", sum(widths[:2]) + 6))
    terminal.say_all(f"note: {note}" for note in notes)
    if first.assumed:
        terminal.tell(f"assumed: {', '.join(first.assumed)}")
    terminal.tell(f"{folder}: {', '.join(first.texts)}")
    terminal.say(f"next: auvid run {shlex.quote(str(folder))}")


def _answers(given: Mapping[str, str | int]) -> dict[str, str]:
    """Return answers to questions for what is missing, on a terminal.

    Raises
    ------
    ConfigError
        If there is none.
    """
    missing = missing_keys(given)
    if missing and not _is_terminal():
        raise ConfigError(
            f"missing {', '.join(map(option, missing))}; state them, start at a vehicle that ships (--like "
            "remus100), or answer questions on a terminal"
        )
    return {key: _answer(_QUESTIONS[key], units()[key]) for key in missing}


def _is_terminal() -> bool:
    """Say whether somebody sees a question and can answer."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def _answer(question: str, unit: str) -> str:
    def checked(text: str) -> str:
        try:
            is_positive = parse_quantity(text, unit) > 0.0
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None
        if not is_positive:
            raise typer.BadParameter("must be greater than 0")
        return text

    try:
        return typer.prompt(question, value_proc=checked)
    except typer.Abort:
        raise KeyboardInterrupt from None
