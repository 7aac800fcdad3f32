"""Lines of text as comments that nothing in them can end, one function for each way to comment."""

import re
from collections.abc import Iterable

from auvid_cli.printable import one_line


def line_comments(mark: str, lines: Iterable[str]) -> str:
    """Write comments that end with their lines: of Python and YAML behind ``#``, of MATLAB behind ``%``."""
    return "".join(f"{mark} {_line(line)}\n" for line in lines)


def xml_comment(lines: Iterable[str]) -> str:
    """Return what may stand between ``<!--`` and ``-->``, where two hyphens may not."""
    return re.sub("-(?=-)", "- ", "\n".join(_line(line) for line in lines))


def _line(text: str) -> str:
    indent = "  " if text.startswith("  ") else ""
    return indent + one_line(text)
