"""Lines of a suggested map that say where columns stand."""

import re
from collections.abc import Iterator, Mapping

import numpy as np

from auvid_cli.logs.clock import FARTHEST
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, Log
from auvid_cli.logs.suggest.names import find_time
from auvid_cli.printable import printable

_WORDS_OF_YAML = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")
_PLAIN = re.compile(r"[A-Za-z_/][\w./-]*", re.ASCII)


def quoted(name: str) -> str:
    """Quote a name as YAML needs it."""
    if _PLAIN.fullmatch(name) and name.lower() not in _WORDS_OF_YAML:
        return name
    if not name.isprintable():
        escaped = name.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{printable(escaped)}"'
    return "'" + name.replace("'", "''") + "'"


def row_lines(logs: Mapping[str, Log], name: str, table: str, indent: str) -> Iterator[str]:
    """Say where columns stand, as far as it must be said."""
    if len(logs) > 1:
        yield f"{indent}log: {name}"
    if table:
        yield f"{indent}table: {quoted(table)}"
    time, comment = time_of(logs[name], table)
    yield f"{indent}time: {time}{f' # {comment}' if comment else ''}"


def time_of(log: Log, table: str) -> tuple[str, str]:
    """Say where a table's times stand, and comment on it; nowhere if no column looks like times."""
    columns = log.tables()[table]
    time = find_time(columns)
    if time is None:
        some = ", ".join(column.name for column in columns[:8])
        return "null", f"required: the column with the times; there is {some}"
    if time.name == HEADER_STAMP and not np.unique(log.read(table, [HEADER_STAMP])[HEADER_STAMP]).size > 1:
        return f"'{LOG_TIME}'", "check: the header stamps never change"
    if time.name in (HEADER_STAMP, LOG_TIME):
        return f"'{time.name}'", "check: the clock of the others too?"
    column = f"column: {quoted(time.name)}"
    if time.is_text or time.unit:
        return f"{{{column}}}", "check: as text, mm:ss.s, HH:MM:SS or dates" if time.is_text else ""
    numbers = np.asarray(log.read(table, [time.name])[time.name], np.float64)
    steps = np.diff(numbers[np.abs(numbers) < FARTHEST])
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    unit = "s" if step < 50.0 else "ms" if step < 5e3 else "us" if step < 5e6 else "ns"
    return f"{{{column}, unit: {unit}}}", f"check: its median step is {step:.4g}"
