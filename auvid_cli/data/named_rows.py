"""Rows with named columns: what a CSV file of results holds, also as a table of pandas."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from auvid_cli.data.csv_text import csv_text

if TYPE_CHECKING:
    import pandas as pd


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
