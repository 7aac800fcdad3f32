"""Finding what is asked of a log, or naming what comes nearest to it."""

from collections.abc import Collection, Sequence
from difflib import get_close_matches

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import Log, LogColumn


def look_up(log: Log, table: str, names: Sequence[str]) -> tuple[LogColumn, ...]:
    """Find columns of a log's table by name.

    Raises
    ------
    FileError
        If there is no such table, or no such column in it.
    """
    tables = log.tables()
    if table not in tables:
        raise FileError(missing(log, "table", table, tables))
    columns = {column.name: column for column in tables[table]}
    for name in names:
        if name not in columns:
            raise FileError(missing(log, f"column in {table}" if table else "column", name, columns))
    return tuple(columns[name] for name in names)


def missing(log: Log, what: str, name: str, known: Collection[str]) -> str:
    """Say that a name is not there, and which is near."""
    near = get_close_matches(name, known, n=3, cutoff=0.5)
    some = near or list(known)[:5]
    of = "" if len(some) == len(known) else f" ({'nearest' if near else 'first'} of {len(known)})"
    return f"{log.path}: there is no {what} named {name!r}; there is {', '.join(map(repr, some)) or 'none at all'}{of}"
