"""How runs ended, by their status; light, for those who draw it."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def ended(rows: "pd.DataFrame") -> "pd.Series":
    """Say whether a row is of a run that came to the end of its data."""
    return rows["status"].str.startswith(("completed", "inconsistent"))


def failed(rows: "pd.DataFrame") -> "pd.Series":
    """Say whether a row is of a run that could not be done at all."""
    return rows["status"].str.startswith("failed")


def diverged(rows: "pd.DataFrame") -> "pd.Series":
    """Say whether a row is of a run whose filter did not come to the end of its data."""
    return ~ended(rows) & ~failed(rows)
