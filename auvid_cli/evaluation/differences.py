"""Comparison of two results, value by value, within tolerances."""

from collections.abc import Iterator, Mapping
from math import inf, isfinite, nan
from typing import NamedTuple

from auvid_cli.data.checks import ResultTables

# Tolerances for the rounding of other processors and libraries, which a filter amplifies.
RELATIVE = 0.01  # share of a value
DEVIATIONS = 0.01  # standard deviations of an estimate
# Columns whose tolerance follows from the standard deviation, and columns that are not compared.
_BY_DEVIATION = ("estimate", "steady_state_error_percent")
_LEFT_OUT = ("cpu_time_s", "microseconds_per_step", "reason", "remedy", "contributors")


class Tolerance(NamedTuple):
    """Largest differences between two results that count as equal."""

    # As a share of the larger of two values, for all columns except processor times and sentences. None: 0.01, and 0
    # for an estimate and its error in percent, for which `deviations` is the tolerance.
    everywhere: float | None = None
    by_column: Mapping[str, float] = {}  # share for single columns, by name; infinite if not compared
    deviations: float = DEVIATIONS  # tolerance of an estimate, in standard deviations of the second result

    def share(self, column: str) -> float:
        """Return the largest difference in a column, as a share of the larger of the two values."""
        if column in self.by_column:
            return self.by_column[column]
        if column in _LEFT_OUT:
            return inf
        if self.everywhere is not None:
            return self.everywhere
        return 0.0 if column in _BY_DEVIATION else RELATIVE


class ComparedValue(NamedTuple):
    """A value in both results."""

    table: str
    row: str  # filter and, if there is one, coefficient or component
    column: str  # empty if the whole row is missing
    first: str  # cell of the first result; empty if missing
    second: str  # cell of the second result; "a row" if the first has no such row
    difference: float  # first minus second; NaN if one is not a number
    allowed: float  # tolerance of the difference; NaN if one is not a number
    agrees: bool

    @property
    def severity(self) -> float:
        """Return the difference divided by the tolerance; 0 if the values agree, infinite without a tolerance."""
        if self.agrees:
            return 0.0
        return abs(self.difference) / self.allowed if self.allowed > 0.0 else inf


class Comparison(NamedTuple):
    """All compared values."""

    values: list[ComparedValue]
    only_first: list[str]  # filters, rows and columns that only the first result has; they do not count as differences

    def differing(self) -> list[ComparedValue]:
        """Return the values that do not agree, the worst first."""
        return sorted((value for value in self.values if not value.agrees), key=lambda value: -value.severity)


def compare_tables(first: ResultTables, second: ResultTables, tolerance: Tolerance) -> Comparison:
    """Compare two results; every value of the second must be in the first and agree.

    Parameters
    ----------
    first, second : ResultTables
        The second is the reference.
    """
    values = [
        value
        for table, rows in second.items()
        for key, row in rows.items()
        for value in _compared_rows(table, " ".join(key), first.get(table, {}).get(key), row, tolerance)
    ]
    return Comparison(values, [*_only_first(first, second)])


def _only_first(first: ResultTables, second: ResultTables) -> Iterator[str]:
    filters = {key[0] for rows in second.values() for key in rows}
    more = _keys(first) - _keys(second)
    yield from sorted({" ".join(key) if key[0] in filters else key[0] for key in more})
    for table, rows in first.items():
        for row in [*rows.values()][:1]:
            known = next(iter(second.get(table, {}).values()), row)
            yield from (f"{table}.{column}" for column in row if column not in known)


def _keys(tables: ResultTables) -> set[tuple[str, ...]]:
    return {key for rows in tables.values() for key in rows}


def _compared_rows(
    table: str, of: str, first: Mapping[str, str] | None, second: Mapping[str, str], tolerance: Tolerance
) -> Iterator[ComparedValue]:
    if first is None:
        yield ComparedValue(table, of, "", "", "a row", nan, nan, agrees=False)
        return
    deviation, true = _number(second.get("standard_deviation", "")), _number(second.get("true", ""))
    scales = {"estimate": deviation, "steady_state_error_percent": 100.0 * deviation / abs(true) if true else nan}
    for column, cell in second.items():
        share = tolerance.share(column)
        if share < inf:
            slack = tolerance.deviations * scales.get(column, nan)
            yield _compared(table, of, column, first.get(column, ""), cell, share, slack if isfinite(slack) else 0.0)


def _compared(table: str, row: str, column: str, first: str, second: str, share: float, slack: float) -> ComparedValue:
    a, b = _number(first), _number(second)
    if not (isfinite(a) and isfinite(b)):
        return ComparedValue(table, row, column, first, second, nan, nan, first == second)
    allowed = max(share * max(abs(a), abs(b)), slack)
    return ComparedValue(table, row, column, first, second, a - b, allowed, abs(a - b) <= allowed)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return nan
