"""All that a campaign's results say, as tables."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import pandas as pd

from auvid_cli.campaign.comparison import compare_filters
from auvid_cli.campaign.statistics import by_coefficient, by_filter


class Findings(NamedTuple):
    """Statistics of a campaign.

    Attributes
    ----------
    columns : list of str
        Axes that tell combinations of settings apart; not those that are drawn for each seed.
    runs : DataFrame
        A row for each finished run: axes, filter, seed, status and mean steady-state error.
    filters, coefficients, comparisons : DataFrame
        As of `by_filter`, `by_coefficient` and `compare_filters`.
    """

    columns: list[str]
    runs: pd.DataFrame
    filters: pd.DataFrame
    coefficients: pd.DataFrame
    comparisons: pd.DataFrame


def find(rows: pd.DataFrame, columns: Sequence[str]) -> Findings:
    """Summarise rows as of `auvid_cli.campaign.measures.Measure`, with a column for each axis."""
    runs = rows.loc[rows["kind"] == "run", [*columns, "filter", "seed", "status", "steady_state_error_percent"]]
    return Findings(
        list(columns), runs, by_filter(rows, columns), by_coefficient(rows, columns), compare_filters(rows, columns)
    )


def in_order(rows: pd.DataFrame, runs: Iterable[str]) -> pd.DataFrame:
    """Put rows in the order in which their runs were planned, not in that in which these ended."""
    place = {run: k for k, run in enumerate(runs)}
    return rows.sort_values("run", kind="stable", key=lambda runs: runs.map(place))
