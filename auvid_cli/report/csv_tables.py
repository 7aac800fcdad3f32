"""The tables as CSV: one file for each kind of row, with the row's own fields as columns."""

from collections.abc import Mapping
from pathlib import Path

from auvid_cli.data.files import write_text
from auvid_cli.data.named_rows import NamedRows


def write_csv_tables(tables: Mapping[str, NamedRows], folder: Path) -> list[Path]:
    """Write each table as ``NAME.csv``.

    Parameters
    ----------
    tables : mapping of NamedRows
        By name.
    folder : pathlib.Path
        Made if it is missing.

    Returns
    -------
    list of pathlib.Path

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    paths = []
    for name, table in tables.items():
        path = folder / f"{name}.csv"
        write_text(path, table.to_csv())
        paths.append(path)
    return paths
