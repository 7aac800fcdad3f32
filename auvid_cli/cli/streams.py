"""Standard streams, exit codes, and lines broken under a column. Loaded before everything else."""

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
INTERRUPTED = 130  # as shells report a command that was interrupted


def prepare_streams() -> None:
    """Open closed streams, and write characters that a terminal lacks as escapes."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        # Otherwise the next file to be opened takes its number, and gets the output of libraries and other processes.
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: PTH123, SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def print_error(message: str) -> None:
    """Print a message on the error stream; if that is closed, only the exit code is left."""
    try:
        print(f"auvid: {printable_lines(message)}", file=sys.stderr, flush=True)
    except OSError:
        discard(sys.stderr)


def print_os_error(error: OSError) -> None:
    """Print an error of the operating system, with the file or else the output that it concerns."""
    print_error(f"{error.filename or 'output'}: {error.strerror or error}")


def hanging(line: str, indent: int) -> str:
    """Break a line on a narrow terminal, and indent what follows; elsewhere return it as it is."""
    if not sys.stdout.isatty():
        return line
    columns = get_terminal_size().columns
    return textwrap.fill(line, columns, subsequent_indent=" " * indent, break_on_hyphens=False, break_long_words=False)


def discard(stream: TextIO) -> None:
    """Drop all output of a stream that has lost its reader, present and future."""
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
