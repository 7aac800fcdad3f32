"""auvid import."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.options import OverwriteOption, QuietOption, VerboseOption
from auvid_cli.cli.terminal import Terminal, reporting_errors

LogsArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="LOG",
        help="Log files or bags, in the order of the map's `logs`, or NAME=FILE. Default: those that it names.",
        show_default=False,
    ),
]
MapOption = Annotated[
    Path | None,
    typer.Option(
        "--map", "-m", metavar="MAP", help="YAML file that says what is what in the logs.", show_default=False
    ),
]
SuggestOption = Annotated[
    bool, typer.Option("--suggest", help="Look at the logs and write a first map, to be checked and filled in.")
]
FileOption = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="Dataset, or with --suggest the map. Default: results/NAME/dataset.h5; a map goes to the screen.",
        show_default=False,
    ),
]


def import_log(
    logs: LogsArgument = None,
    map_file: MapOption = None,
    suggest: SuggestOption = False,
    output: FileOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Convert a vehicle's logs to a dataset, or suggest the map by which to do so."""
    with reporting_errors():
        with _interrupts_waiting():
            from auvid_cli.cli import importing
            from auvid_cli.errors import ConfigError

        terminal = Terminal(quiet, verbose)
        if suggest and map_file is not None:
            raise ConfigError("--suggest writes a map and --map reads one: say one of them")
        if not suggest and map_file is None:
            raise ConfigError("say --map MAP to import logs, or --suggest to have a map suggested from them")
        if map_file is not None:
            importing.import_logs(map_file, logs or [], output, overwrite, terminal)
        elif logs:
            importing.suggest_to([Path(log) for log in logs], output, terminal)
        else:
            raise ConfigError("name the logs that a map is to be suggested from: auvid import --suggest LOG")


@contextmanager
def _interrupts_waiting() -> Iterator[None]:
    """Let an interrupt wait until the block ends: libraries that are being loaded make errors of their own of it."""
    waiting = []
    before = signal.signal(signal.SIGINT, lambda number, frame: waiting.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if waiting:
        raise KeyboardInterrupt
