"""Checks, and tables of results: rows with named columns as CSV and pandas tables, and their comparison."""

import csv
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import StringIO
from math import inf, isfinite, isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from auvid_cli.errors import FileError
from auvid_cli.regular_files import check_regular_file
from auvid_cli.text import one_line, printable

if TYPE_CHECKING:
    import pandas as pd


_NUMBER = re.compile(r"[+-]?(\d+\.?\d*(e[+-]?\d+)?|inf|nan)", re.ASCII | re.IGNORECASE)
# Beginning of a formula in a spreadsheet.
_FORMULA = re.compile("'*[=+@-]")
# Columns that identify the rows of each table.
KEYS: Mapping[str, tuple[str, ...]] = {
    "coefficients": ("filter", "coefficient"),
    "summary": ("filter",),
    "velocity_error": ("filter", "component"),
}
_MAX_SIZE = 20_000_000  # bytes
# Rows by their keys, with cells by column.
ResultTable: TypeAlias = dict[tuple[str, ...], dict[str, str]]
# Tables by name.
ResultTables: TypeAlias = dict[str, ResultTable]


def csv_text(header: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Return CSV text; None and NaN are empty cells, floats keep all digits, see `csv_cell` for text."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(csv_cell, header))
    writer.writerows(map(csv_cell, row) for row in rows)
    return text.getvalue()


def csv_cell(value: Any) -> Any:
    """Return a printable cell; text that looks like a formula gets an apostrophe, which `csv_value` removes."""
    if isinstance(value, float) and isnan(value):
        return None
    if not isinstance(value, str) or _NUMBER.fullmatch(value):
        return value
    return f"'{printable(value)}" if _FORMULA.match(value) else printable(value)


def csv_value(cell: str) -> str:
    """Return the text of a cell of `csv_cell`."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


class NamedRows(NamedTuple):
    """Rows with a value for each column, None if unknown."""

    columns: tuple[str, ...]
    rows: Sequence[Sequence[object]]

    def to_csv(self) -> str:
        """Return CSV text, see `csv_text`."""
        return csv_text(self.columns, self.rows)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a pandas table; None is a missing value in columns of flags."""
        import pandas as pd

        frame = pd.DataFrame(list(self.rows), columns=list(self.columns))
        flags = [name for name in frame if pd.api.types.infer_dtype(frame[name]) == "boolean"]
        return frame.astype(dict.fromkeys(flags, "boolean"))


def frames(tables: dict[str, NamedRows]) -> "dict[str, pd.DataFrame]":
    """Return a pandas table for each table, by name."""
    return {name: table.to_pandas() for name, table in tables.items()}


def read_result_tables(folder: Path, results_name: str) -> ResultTables:
    """Read the tables of `KEYS` that are in a folder, at least the coefficients.

    Parameters
    ----------
    folder : pathlib.Path
        Results folder, folder of the tables, or folder with a results folder named `results_name`.
    results_name : str
        Name of the other results folder of the comparison.

    Raises
    ------
    FileError
        If there are no tables, or a file is not valid.
    """
    home = _folder_of_tables(folder, results_name)
    files = {name: home / f"{name}.csv" for name in KEYS}
    return {name: _read(path, KEYS[name]) for name, path in files.items() if os.path.lexists(path)}


def _folder_of_tables(folder: Path, results_name: str) -> Path:
    for home in (folder / "tables", folder, folder / results_name / "tables", folder / results_name):
        if os.path.lexists(home / "coefficients.csv"):
            return home
    if not folder.is_dir():
        raise FileError(f"{folder}: no such folder; name a results folder, such as results/spiral")
    raise FileError(f"{folder}: no tables (coefficients.csv); `auvid report` writes the tables of a results folder")


def _read(path: Path, key: tuple[str, ...]) -> ResultTable:
    try:
        check_regular_file(path)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from None
    if path.stat().st_size > _MAX_SIZE:
        raise FileError(f"{path}: is too large for a table of results")
    rows: ResultTable = {}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = csv.reader(file, strict=True)
            header = next(lines, [])
            if missing := [column for column in key if column not in header]:
                raise FileError(f"{path}:1: not a table of results; column {', '.join(missing)} is missing")
            if len(header) != len({*header}):
                raise FileError(f"{path}:1: a column name occurs twice")
            for cells in lines:
                where = f"{path}:{lines.line_num}"
                if len(cells) != len(header):
                    raise FileError(f"{where}: {len(cells)} cells; expected {len(header)}, one for each column")
                row = dict(zip(header, cells, strict=True))
                row_key = tuple(row.pop(column) for column in key)
                if row_key in rows:
                    raise FileError(f"{where}: a second row of {one_line(' '.join(row_key))}")
                rows[row_key] = row
    except UnicodeDecodeError:
        raise FileError(f"{path}: not UTF-8 text") from None
    except csv.Error as error:
        raise FileError(f"{path}: not a CSV file: {error}") from None
    return rows


class Check(NamedTuple):
    """A row of ``checks.csv``."""

    filter: str
    subject: str  # sensor, input, or "coefficients"
    check: str  # name of the statistic
    statistic: str  # value of the statistic
    threshold: str  # limit of the statistic
    passed: bool | None  # None for a note
    advice: str  # empty if passed

    @classmethod
    def of(
        cls,
        filter_name: str,
        subject: str,
        check: str,
        *,
        statistic: str,
        threshold: str,
        passed: bool | None,
        advice: str,
    ) -> "Check":
        """Return a check, with advice only if it did not pass."""
        return cls(filter_name, subject, check, statistic, threshold, passed, "" if passed else advice)

    @classmethod
    def of_values(
        cls,
        filter_name: str,
        subject: str,
        check: str,
        values: Mapping[str, float],
        *,
        limit: float,
        unit: str = "",
        meaning: str,
        advice: str,
        fails: bool = True,
        is_least: bool = False,
    ) -> "Check":
        """Return the check that no value is beyond a limit; its statistic lists values beyond it, worst first."""
        sign = -1.0 if is_least else 1.0
        ordered = sorted(values, key=lambda name: -sign * values[name])
        beyond = [name for name in ordered if not sign * values[name] <= sign * limit]
        statistic = ", ".join(f"{name} {values[name]:.3g} {unit}".rstrip() for name in beyond or ordered[:1])
        threshold = " ".join(filter(None, (">=" if is_least else "<=", f"{limit:.3g}", unit, meaning)))
        passed = True if not beyond else False if fails else None
        return cls.of(
            filter_name, subject, check, statistic=statistic, threshold=threshold, passed=passed, advice=advice
        )

    @classmethod
    def of_names(
        cls, filter_name: str, check: str, names: Sequence[str], *, threshold: str, advice: str, fails: bool = True
    ) -> "Check":
        """Return the check that a list of names is empty."""
        passed = True if not names else False if fails else None
        return cls.of(
            filter_name,
            "coefficients",
            check,
            statistic=", ".join(names) or "none",
            threshold=threshold,
            passed=passed,
            advice=advice,
        )


class Checks(list[Check]):
    """Checks in order."""

    def failed(self) -> list[Check]:
        """Return the failed checks."""
        return [check for check in self if check.passed is False]

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each check and the fields of `Check` as columns; ``passed`` may be missing."""
        return self.rows().to_pandas()

    def rows(self) -> NamedRows:
        """Return the rows of ``checks.csv``."""
        return NamedRows(Check._fields, self)


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
