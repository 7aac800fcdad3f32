"""Published results of Sabet et al. 2018, to stand beside ours."""

import csv
from functools import cache
from importlib.resources import files

NOTE = (
    "Paper: Sabet et al. (2018). Its vehicle, noise, priors, length of the run and step are not published, so these "
    "values are for orientation."
)


@cache
def published(table: str) -> dict[str, dict[str, str]]:
    """Read a published table.

    Parameters
    ----------
    table : str
        "table_iv" (accuracy of the coefficients) or "table_v" (error of the velocities).

    Returns
    -------
    dict of dict
        Numbers by row (coefficient or velocity) and column (for example ``rmse_ekf``), with the digits that
        were printed; empty cells are left out.
    """
    text = files("auvid_cli.report").joinpath("published", f"{table}.csv").read_text(encoding="utf-8")
    return {
        name: {column: cell for column, cell in row.items() if cell and column != "unit"}
        for row in csv.DictReader(text.splitlines())
        for name in [row.pop("coefficient", None) or row.pop("signal")]
    }


def published_filters(table: str, column: str, filters: list[str]) -> list[str]:
    """Return those of `filters` for which the paper has `column`, in the order given."""
    columns = {name for row in published(table).values() for name in row}
    return [name for name in filters if f"{column}_{name}" in columns]
