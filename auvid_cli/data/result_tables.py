"""Tables of results as text, out of the CSV files of a results folder."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

from auvid_cli.errors import FileError
from auvid_cli.printable import one_line

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


def read_result_tables(folder: Path, beside: str) -> ResultTables:
    """Read the tables of results that are in a folder.

    Parameters
    ----------
    folder : pathlib.Path
        A results folder, a folder with the tables themselves, or one with a results folder named `beside`.
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
