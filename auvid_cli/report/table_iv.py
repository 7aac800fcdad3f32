"""Accuracy of the coefficients next to the published values (Table IV), and parts that all tables of a run share."""

import csv
from collections.abc import Sequence
from functools import cache
from importlib.resources import files

from auvid_cli.data.checks import NamedRows
from auvid_cli.evaluation.accuracy import CoefficientResult
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.table import (
    UNIDENTIFIED,
    Cell,
    Column,
    PlusMinus,
    Symbol,
    Table,
    Unidentified,
    UnitCell,
    filter_label,
)

NOTE = (
    "Paper: Sabet et al. (2018). Its vehicle, noise, priors, length of the run and step are not published, so these "
    "values are for orientation."
)
PAPER = "paper"
_ERROR = "steady_state_error_percent"
_RMSE_OF = (
    "RMSE: over the whole run, from the initial value of zero, in the coefficient's unit. "
    "Rel.: RMSE / |true value| over all coefficients, comparable between vehicles."
)
_ERROR_OF = "Steady-state error: distance of the mean over the last tenth of the run from the true value."


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
    """Return the filters for which the paper has `column`."""
    columns = {name for row in published(table).values() for name in row}
    return [name for name in filters if f"{column}_{name}" in columns]


def filters_of(evaluation: Evaluation) -> list[str]:
    """Return the filters of an evaluation."""
    return [row.filter for row in evaluation.summary]


def results_by_coefficient(evaluation: Evaluation) -> dict[str, dict[str, CoefficientResult]]:
    """Return the results by coefficient and filter."""
    results: dict[str, dict[str, CoefficientResult]] = {}
    for row in evaluation.coefficients:
        results.setdefault(row.coefficient, {})[row.filter] = row
    return results


def marked(row: CoefficientResult, cell: float | PlusMinus | None) -> Cell:
    """Return the cell with a mark if the data do not determine the coefficient."""
    return cell if row.identified or cell is None else Unidentified(cell)


def mark_explained(evaluation: Evaluation) -> list[str]:
    """Return the explanation of the mark if any coefficient is marked."""
    return [] if all(row.identified for row in evaluation.coefficients) else [UNIDENTIFIED]


def accuracy(evaluation: Evaluation) -> list[Table]:
    """Return the two halves of the paper's Table IV, RMSE and steady-state error; no table without a truth."""
    if all(row.true is None for row in evaluation.coefficients):
        return []
    rmse = Table("rmse", "RMSE of the coefficients (Table IV)", (), [], notes=(_RMSE_OF,))
    rmse_averages = (
        ("rel. mean", "", "mean_relative_rmse", ""),
        ("rel. median", "", "median_relative_rmse", ""),
        ("CPU time", "s", "cpu_time_s", "cpu_time_s"),
    )
    error = Table(_ERROR, "Steady-state error of the coefficients, % (Table IV)", (), [], notes=(_ERROR_OF,))
    error_averages = (("average", "", "average_steady_state_error_percent", "average"),)
    return [
        _accuracy_table(evaluation, rmse, "rmse", rmse_averages),
        _accuracy_table(evaluation, error, "sse_percent", error_averages),
    ]


def _accuracy_table(
    evaluation: Evaluation, table: Table, published_key: str, averages: Sequence[tuple[str, str, str, str]]
) -> Table:
    """Return one half of Table IV.

    Parameters
    ----------
    table : Table
        Key, which is the field of `CoefficientResult`, title and note.
    published_key : str
        Prefix of the published columns.
    averages : sequence of (heading, unit, field of `FilterSummary`, published row)
        Rows below the coefficients.
    """
    filters = filters_of(evaluation)
    in_paper = published_filters("table_iv", published_key, filters)
    counted = {name: [0, 0] for name in in_paper}

    def published_value(row: str, name: str) -> str:
        return published("table_iv").get(row, {}).get(f"{published_key}_{name}", "")

    def side_by_side(values: Sequence[Cell], row: str) -> list[Cell]:
        pairs = zip(filters, values, strict=True)
        return [cell for name, value in pairs for cell in (value, *[published_value(row, name)] * (name in in_paper))]

    rows: list[list[Cell]] = []
    for symbol, by_filter in results_by_coefficient(evaluation).items():
        any_row = next(iter(by_filter.values()))
        results = [by_filter.get(name) for name in filters]
        cells = [None if row is None else marked(row, getattr(row, table.key)) for row in results]
        rows.append([Symbol(symbol), UnitCell(any_row.unit), any_row.true, *side_by_side(cells, symbol)])
        for name, row in by_filter.items():
            ours, theirs = getattr(row, table.key), published_value(symbol, name)
            if ours is not None and theirs:
                counted[name][0] += ours < float(theirs)
                counted[name][1] += 1
    totals: list[list[Cell]] = [
        [heading, unit, "", *side_by_side([getattr(row, field) for row in evaluation.summary], published_row)]
        for heading, unit, field, published_row in averages
    ]
    if in_paper:
        counts = ["{} of {}".format(*counted[name]) if name in counted else "" for name in filters]
        totals.append(["below paper", "", "", *side_by_side(counts, "")])
    headings = [Column(header) for name in filters for header in (filter_label(name), *[PAPER] * (name in in_paper))]
    return table._replace(
        columns=(Column("coefficient", numeric=False), Column("unit", numeric=False), Column("true"), *headings),
        rows=rows,
        totals=totals,
        notes=(*table.notes, *([NOTE] if in_paper else []), *mark_explained(evaluation)),
    )


def table_iv(evaluation: Evaluation) -> dict[str, NamedRows]:
    """Return Table IV as the rows of ``table_iv.csv``, both halves side by side; empty without a truth.

    The last rows are the averages, the number of coefficients with a smaller error than in the paper, and the CPU time.
    """
    halves = accuracy(evaluation)
    if not halves:
        return {}
    headings = ["coefficient", "unit", "true"]
    for table in halves:
        name = ""
        for column in table.columns[3:]:
            name = f"{name}_paper" if column.header == PAPER else f"{table.key}_{column.header.lower()}"
            headings.append(name)
    rmse, errors = halves
    n_rmse, n_errors = (len(table.columns) - 3 for table in halves)
    rows = [
        *([*left, *right[3:]] for left, right in zip(rmse.rows, errors.rows, strict=True)),
        *([*row, *[None] * n_errors] for row in rmse.totals),
        *([*row[:3], *[None] * n_rmse, *row[3:]] for row in errors.totals),
    ]
    return {"table_iv": NamedRows(tuple(headings), [[_plain(cell) for cell in row] for row in rows])}


def _plain(cell: Cell) -> str | float | None:
    """Return the value of a cell for a CSV file, without marks and standard deviations."""
    match cell:
        case Unidentified(inner):
            return _plain(inner)
        case PlusMinus(value, _):
            return value
        case Symbol(name) | UnitCell(name):
            return name
    return cell if isinstance(cell, float) else cell or None
