"""The standard streams: there whatever the shell closed, taking any text, and heard out before a command ends."""

import os
import sys
from io import TextIOWrapper
from typing import TextIO

from auvid_cli.cli.exit_codes import WRONG_INPUT
from auvid_cli.printable import printable_lines


def prepare_streams() -> None:
    """Open what is closed, and let what a terminal has no sign for be written as its code."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        # The next file to be opened would take its number, and with it what libraries and other processes say.
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: PTH123, SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def complain(message: str) -> None:
    """Say what is wrong, on the error stream; if that takes nothing, the exit code must do."""
    try:
        print(f"auvid: {printable_lines(message)}", file=sys.stderr, flush=True)
    except OSError:
        discard(sys.stderr)


def complain_of(error: OSError) -> None:
    """Say what the system refused: a file, or else the output."""
    complain(f"{error.filename or 'output'}: {error.strerror or error}")


def discard(stream: TextIO) -> None:
    """Let what is and will be written to a stream go nowhere: nobody takes it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def finish(code: int | str | None) -> int | str | None:
    """Write out what still waits; the exit code of the command, given what it would be without."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:
            discard(stream)
        except OSError as error:
            discard(stream)
            if not code:
                complain_of(error)
                code = WRONG_INPUT
    return code
