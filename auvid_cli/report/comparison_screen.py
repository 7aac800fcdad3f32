"""Two results beside each other, for the terminal."""

from collections import Counter
from math import isnan

from rich.console import Console
from rich.text import Text

from auvid_cli.evaluation.differences import ComparedValue, Comparison
from auvid_cli.report.screen_table import MISSING, narrowed, printed
from auvid_cli.report.table import Cell, Column, Table

# More differences than this are for those who ask for all.
_MOST = 20
_DIGITS, _DIFFERENCE_DIGITS = 6, 2
# Heading of the column that tells what differs among all.
_MARK = ""
# What gives way where the terminal is narrow, first to last.
_LEAST = "table", "may be"


def print_comparison(console: Console, comparison: Comparison, everything: bool) -> None:
    """Print the values that differ, the worst first, and how many agree.

    Parameters
    ----------
    console : rich.console.Console
    comparison : Comparison
    everything : bool
        Whether all values are printed, in their order, not only those that differ.
    """
    differing = comparison.differing()
    shown = comparison.values if everything else differing[:_MOST]
    if shown:
        table = _beside_each_other(shown)
        console.print(narrowed(console, table if everything else table.without(_MARK), _LEAST))
    if len(differing) > _MOST and not everything:
        console.print(Text(f"and {len(differing) - _MOST} more that differ; --verbose prints all values"))
    for table in dict.fromkeys(value.table for value in comparison.values):
        of_table = [value for value in comparison.values if value.table == table]
        counts = Counter(value.column or "whole rows" for value in of_table if not value.agrees)
        others = ", ".join(f"{column} {count}" for column, count in counts.most_common())
        agreeing = f"{table}.csv: {len(of_table) - counts.total()} of {len(of_table)} values agree"
        console.print(Text(f"{agreeing}; others: {others}" if others else agreeing))
    if comparison.only_first:
        console.print(Text(f"only the first has {', '.join(comparison.only_first)}"))


def _beside_each_other(values: list[ComparedValue]) -> Table:
    columns = (
        *(Column(header, numeric=False) for header in (_MARK, "table", "of", "value")),
        *(Column(header) for header in ("first", "second", "difference", "may be")),
    )
    rows: list[list[Cell]] = [
        [
            "" if value.agrees else "DIFFERS",
            value.table,
            value.row,
            value.column,
            _cell(value.first),
            _cell(value.second),
            MISSING if isnan(value.difference) else printed(value.difference, _DIFFERENCE_DIGITS),
            MISSING if isnan(value.allowed) else printed(value.allowed, _DIFFERENCE_DIGITS),
        ]
        for value in values
    ]
    return Table("comparison", "Two results", columns, rows)


def _cell(text: str) -> str:
    try:
        return printed(float(text), _DIGITS)
    except ValueError:
        return text or MISSING
