"""Standard streams, exit codes and line breaks. Loaded before everything else."""

import os
import sys
import textwrap
from io import TextIOWrapper
from shutil import get_terminal_size
from typing import TextIO

from auvid_cli.text import printable_lines

DONE = 0
VERDICT_FAILED = 1
WRONG_INPUT = 2
INTERRUPTED = 130  # as in shells: 128 + SIGINT


def prepare_streams() -> None:
    """Open closed streams, and escape characters that a terminal cannot show."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        # Otherwise the next opened file gets its number, and the output of libraries is written into that file.
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: PTH123, SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def print_error(message: str) -> None:
    """Print a message on the error stream, if that is open."""
    try:
        print(f"auvid: {printable_lines(message)}", file=sys.stderr, flush=True)
    except OSError:
        discard(sys.stderr)


def print_os_error(error: OSError) -> None:
    """Print an error of the operating system, with the name of the file if it has one."""
    print_error(f"{error.filename or 'output'}: {error.strerror or error}")


def hanging(line: str, indent: int) -> str:
    """Break a line at the width of the terminal, with a hanging indent; without a terminal return it unchanged."""
    if not sys.stdout.isatty():
        return line
    columns = get_terminal_size().columns
    return textwrap.fill(line, columns, subsequent_indent=" " * indent, break_on_hyphens=False, break_long_words=False)


def discard(stream: TextIO) -> None:
    """Drop all further output of a stream that has lost its reader."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def finish(code: int | str | None) -> int | str | None:
    """Flush the streams; return the exit code, 2 if that fails."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:
            discard(stream)
        except OSError as error:
            discard(stream)
            if not code:
                print_os_error(error)
                code = WRONG_INPUT
    return code
