"""Entries of a suggested map that say where columns stand."""

from collections.abc import Iterator, Mapping

import numpy as np

from auvid_cli.config.log_columns import unit_factor
from auvid_cli.logs.clock import FARTHEST
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, Log
from auvid_cli.logs.suggest.commented_yaml import Flow, Phrase, YamlEntry
from auvid_cli.logs.suggest.names import find_time


def row_entries(logs: Mapping[str, Log], name: str, table: str, delay: float = 0.0) -> Iterator[YamlEntry]:
    """Say where columns stand, as far as it must be said, and by how much, s, their times are late."""
    if len(logs) > 1:
        yield YamlEntry("log", name)
    if table:
        yield YamlEntry("table", table)
    time, comment = time_of(logs[name], table)
    if delay and time is not None:
        time = dict(time) if isinstance(time, Mapping) else {"column": time}
        time["offset"] = Phrase(f"{-delay:.2f} s")
        comment = f"check: {abs(delay):.2f} s {'later' if delay > 0.0 else 'earlier'} than the others, by their changes"
    yield YamlEntry("time", time, comment)


def time_of(log: Log, table: str) -> tuple[Flow, str]:
    """Say where a table's times stand, and comment on it; nowhere if no column looks like times."""
    columns = log.tables()[table]
    time = find_time(columns)
    if time is None:
        some = ", ".join(column.name for column in columns[:8])
        return None, f"required: the column with the times; there is {some}"
    if time.name == HEADER_STAMP and not np.unique(log.read(table, [HEADER_STAMP])[HEADER_STAMP]).size > 1:
        return LOG_TIME, "check: the header stamps never change"
    if time.name in (HEADER_STAMP, LOG_TIME):
        return time.name, "check: the clock of the others too?"
    if time.is_text or (time.unit and _is_time(time.unit)):
        return {"column": time.name}, "check: as text, mm:ss.s, HH:MM:SS or dates" if time.is_text else ""
    numbers = np.asarray(log.read(table, [time.name])[time.name], np.float64)
    steps = np.diff(numbers[np.abs(numbers) < FARTHEST])
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    unit = "s" if step < 50.0 else "ms" if step < 5e3 else "us" if step < 5e6 else "ns"
    said = f"the log says {time.unit!r}; " if time.unit else ""
    return {"column": time.name, "unit": unit}, f"check: {said}its median step is {step:.4g}"


def _is_time(unit: str) -> bool:
    """Say whether the unit that a log states is one of time: that of a Slocum glider is called timestamp."""
    try:
        unit_factor(unit, "s")
    except ValueError:
        return False
    return True
