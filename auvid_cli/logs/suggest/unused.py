"""Columns that a suggested map leaves out."""

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping

from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.suggest.commented_yaml import Comment
from auvid_cli.logs.suggest.inputs import FoundInputs
from auvid_cli.logs.suggest.names import is_filter_output, is_set_point
from auvid_cli.logs.suggest.rows import time_of
from auvid_cli.logs.suggest.sensors import FoundSensor, flag_of

_LINE = 110


def unused_lines(
    logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], inputs: FoundInputs | None
) -> Iterator[Comment]:
    """Name every column that is no sensor, flag, input or time; what is a set-point or a filter's by its name."""
    used = {
        (part.log, part.match.table, column.name)
        for sensor in sensors.values()
        for part in sensor.parts
        for column in part.match.columns.values()
    }
    used |= {
        (part.log, part.match.table, flag_of(sensors, logs[part.log], part))
        for sensor in sensors.values()
        for part in sensor.parts
    }
    if inputs is not None:
        used |= {(signal.log, signal.table, signal.column.name) for signal in inputs.signals.values()}
    for log in logs:
        for table, columns in logs[log].tables().items():
            time, _ = time_of(logs[log], table)
            times = time["column"] if isinstance(time, Mapping) else time
            left = _runs(
                f"{column.name}{_by_its_name(column.name)}"
                for column in columns
                if (log, table, column.name) not in used and column.name != times
            )
            if left:
                made = ", what a navigation filter made" if is_filter_output(table) else ""
                made = ", set-points" if is_set_point(table, "") else made
                where = " ".join(part for part in (log if len(logs) > 1 else "", table) if part)
                yield from _wrapped(f"not used{f' of {where}' if where else ''}{made}: {', '.join(left)}")


def _by_its_name(column: str) -> str:
    if is_set_point("", column):
        return " (a set-point?)"
    return " (a navigation filter's?)" if is_filter_output("", column) else ""


def _runs(names: Iterable[str]) -> list[str]:
    """Put elements of a list together, name[0] and what follows it."""
    runs: list[str] = []
    stems: list[str] = []
    for name in names:
        element = re.fullmatch(r"(?P<stem>.*)\[(?P<index>\d+)\]", name)
        if element is not None and stems and stems[-1] == element["stem"]:
            runs[-1] = f"{runs[-1].split(' to ')[0]} to [{element['index']}]"
        else:
            runs.append(name)
            stems.append(element["stem"] if element is not None else "")
    return runs


def _wrapped(text: str) -> Iterator[Comment]:
    for line in textwrap.wrap(text, _LINE, break_long_words=False, break_on_hyphens=False, subsequent_indent="  "):
        yield Comment(line)
