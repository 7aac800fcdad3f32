"""Lines of two or three columns, whose last one is broken under its own beginning where a terminal is narrow."""

import sys
import textwrap
from shutil import get_terminal_size


def hanging(line: str, indent: int) -> str:
    """Break a line under a column, on a terminal; elsewhere one line stays one."""
    if not sys.stdout.isatty():
        return line
    columns = get_terminal_size().columns
    return textwrap.fill(line, columns, subsequent_indent=" " * indent, break_on_hyphens=False, break_long_words=False)
