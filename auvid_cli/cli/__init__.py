"""The command line: parse, call `api`, print. A command imports what it needs when it runs, so that help is fast.

Here: standard streams, exit codes and line breaks, which are loaded before everything else.
"""

import os
import sys
import textwrap
from io import BufferedWriter, FileIO, TextIOWrapper
from shutil import get_terminal_size
from typing import TYPE_CHECKING, TextIO

from auvid_cli.text import printable_lines

if TYPE_CHECKING:
    from typing_extensions import Buffer

DONE = 0
VERDICT_FAILED = 1
WRONG_INPUT = 2
INTERRUPTED = 130  # as in shells: 128 + SIGINT


class _Output(FileIO):
    """A stream that drops its output after its reader has ended, as in `auvid run | head -1`."""

    def write(self, content: "Buffer", /) -> int:
        """Write bytes, and return their number."""
        try:
            return super().write(content)
        except BrokenPipeError:
            return memoryview(content).nbytes


def prepare_streams() -> None:
    """Open closed streams, escape characters that a terminal cannot show, and ignore the end of the reader."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:
            # Otherwise the next opened file gets the number of the stream, and libraries write their output into it.
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8", errors="backslashreplace"))  # noqa: PTH123, SIM115
        elif mode == "w" and isinstance(stream, TextIOWrapper):
            output = TextIOWrapper(
                BufferedWriter(_Output(stream.fileno(), "w", closefd=False)),
                stream.encoding,
                "backslashreplace",
                line_buffering=stream.line_buffering,
                write_through=stream.write_through,
            )
            setattr(sys, name, output)


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
    """Drop all further output of a stream that cannot be written."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def finish(code: int | str | None) -> int | str | None:
    """Flush the streams; return the exit code, 2 if that fails."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            discard(stream)
            if not code:
                print_os_error(error)
                code = WRONG_INPUT
    return code
