"""Checks, and tables of results: rows with named columns, as CSV text and as tables of pandas."""

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from auvid_cli.errors import FileError
from auvid_cli.text import one_line, printable

if TYPE_CHECKING:
    import pandas as pd

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*(e[+-]?\d+)?|inf|nan)", re.ASCII | re.IGNORECASE)
# A spreadsheet takes for a formula what begins so.
_FORMULA = re.compile("'*[=+@-]")
# Columns by which a row of each table is known.
KEYS: Mapping[str, tuple[str, ...]] = {
    "coefficients": ("filter", "coefficient"),
    "summary": ("filter",),
    "velocity_error": ("filter", "component"),
}
# Bytes; no table of results comes near.
_LARGEST = 20_000_000
# Cells by column, of each row by its key; of each table by its name.
ResultTables: TypeAlias = dict[str, dict[tuple[str, ...], dict[str, str]]]


def csv_text(header: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Write a header and rows as CSV; None and NaN are empty cells, floats keep all digits, for text see `csv_cell`."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(csv_cell, header))
    writer.writerows(map(csv_cell, row) for row in rows)
    return text.getvalue()


def csv_cell(value: Any) -> Any:
    """Put text in a line, and behind an apostrophe if it would be a formula; `csv_value` takes that away."""
    if isinstance(value, float) and isnan(value):
        return None
    if not isinstance(value, str) or _NUMBER.fullmatch(value):
        return value
    return f"'{printable(value)}" if _FORMULA.match(value) else printable(value)


def csv_value(cell: str) -> str:
    """Return the text of a cell that `csv_cell` made."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


class NamedRows(NamedTuple):
    """Rows of one kind.

    Attributes
    ----------
    columns : tuple of str
    rows : sequence of sequences
        A value for each column; None where it is not known.
    """

    columns: tuple[str, ...]
    rows: Sequence[Sequence[object]]

    def to_csv(self) -> str:
        """Return the text of a CSV file, see `csv_text`."""
        return csv_text(self.columns, self.rows)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table; where a flag is neither true nor false it is missing."""
        import pandas as pd

        frame = pd.DataFrame(list(self.rows), columns=list(self.columns))
        flags = [name for name in frame if pd.api.types.infer_dtype(frame[name]) == "boolean"]
        return frame.astype(dict.fromkeys(flags, "boolean"))


def frames(tables: dict[str, NamedRows]) -> "dict[str, pd.DataFrame]":
    """Return each of some tables as one of pandas, by the same names."""
    return {name: table.to_pandas() for name, table in tables.items()}


def read_result_tables(folder: Path, beside: str) -> ResultTables:
    """Read the tables of results that are in a folder.

    Parameters
    ----------
    folder : pathlib.Path
        A results folder, a folder with the tables themselves, or one with a results folder named `comparison`.
    beside : str
        Name of the results folder with which these are to be compared.

    Returns
    -------
    dict
        As many of the tables in `KEYS` as there are, the coefficients at least.

    Raises
    ------
    FileError
        If there are none, or a file is no such table.
    """
    home = _folder_of_tables(folder, beside)
    return {name: _read(home / f"{name}.csv", key) for name, key in KEYS.items() if (home / f"{name}.csv").is_file()}


def _folder_of_tables(folder: Path, beside: str) -> Path:
    for home in (folder / "tables", folder, folder / beside / "tables", folder / beside):
        if (home / "coefficients.csv").is_file():
            return home
    if not folder.is_dir():
        raise FileError(f"{folder}: no such folder; name a results folder, such as results/spiral")
    raise FileError(f"{folder}: no tables (coefficients.csv) are there; `auvid report` makes those of a results folder")


def _read(path: Path, key: tuple[str, ...]) -> dict[tuple[str, ...], dict[str, str]]:
    if path.stat().st_size > _LARGEST:
        raise FileError(f"{path}: is too large for a table of results")
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = csv.reader(file, strict=True)
            header = next(lines, [])
            if missing := [column for column in key if column not in header]:
                raise FileError(f"{path}:1: is no table of results: there is no column {', '.join(missing)}")
            if len(header) != len({*header}):
                raise FileError(f"{path}:1: a column stands there twice")
            for cells in lines:
                if len(cells) != len(header):
                    where = f"{path}:{lines.line_num}"
                    raise FileError(f"{where}: {len(cells)} cells, and the table has {len(header)} columns")
                row = dict(zip(header, cells, strict=True))
                of = tuple(row.pop(column) for column in key)
                if of in rows:
                    raise FileError(f"{path}:{lines.line_num}: a second row of {one_line(' '.join(of))}")
                rows[of] = row
    except UnicodeDecodeError:
        raise FileError(f"{path}: is no text in UTF-8") from None
    except csv.Error as error:
        raise FileError(f"{path}: is no CSV: {error}") from None
    return rows


class Check(NamedTuple):
    """A row of ``checks.csv``.

    Attributes
    ----------
    filter : str
    subject : str
        A sensor, an input, or "coefficients".
    check : str
        What is looked at.
    statistic, threshold : str
        What came out, and what it may be.
    passed : bool or None
        None where it did not pass but is only worth knowing.
    advice : str
        What to do; empty where it passed.
    """

    filter: str
    subject: str
    check: str
    statistic: str
    threshold: str
    passed: bool | None
    advice: str

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
        """Make a verdict that gives advice only where it is needed."""
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
        """Judge named numbers, none of which may be beyond a limit; those that are stand there, the farthest first."""
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
        """Make a verdict that passes if no name is on a list."""
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
    """Verdicts in the order in which they are reached."""

    def failed(self) -> list[Check]:
        """Return those that did not pass."""
        return [check for check in self if check.passed is False]

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each verdict and the fields of `Check` as columns.

        ``passed`` is missing of what is only worth knowing.
        """
        return self.rows().to_pandas()

    def rows(self) -> NamedRows:
        """Return the rows of ``checks.csv``."""
        return NamedRows(Check._fields, self)
