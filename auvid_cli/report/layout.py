"""Contents of the tables of a run, and the files that they are written to."""

import csv
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.data.checks import NamedRows
from auvid_cli.data.files import write_text
from auvid_cli.evaluation.accuracy import CoefficientResult
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.shared_checks import judgement_sentences
from auvid_cli.report.table import (
    DEVIATION_DIGITS,
    UNIDENTIFIED,
    Cell,
    Column,
    PlusMinus,
    Symbol,
    Table,
    Unidentified,
    UnitCell,
    filter_label,
    number,
)
from auvid_cli.report.text_tables import render_latex, render_markdown, write_csv_tables
from auvid_cli.text import sentence

NOTE = (
    "Paper: Sabet et al. (2018). Its vehicle, noise, priors, length of the run and step are not published, so these "
    "values are for orientation."
)
PAPER = "paper"
_ERROR = "steady_state_error_percent"
_VELOCITY = "Mean absolute error"
_BOUND = "Cramér-Rao bound"
_AVERAGE = "average error %"
# A corrected standard deviation is shown from this ratio to the nominal one.
_WIDER = 1.02
_RMSE_OF = (
    "RMSE: over the whole run, from the initial value of zero, in the coefficient's unit. "
    "Rel.: RMSE / |true value| over all coefficients, comparable between vehicles."
)
_ERROR_OF = "Steady-state error: distance of the mean over the last tenth of the run from the true value."
NIS_MEANS = (
    "NIS: squared prediction error / expected variance, mean over the components. 1 is right. Larger: data and model "
    "disagree. Smaller: the stated noise is too large, which is intended for an AHRS."
)
_CORRECTED = (
    "Corrected sd: standard deviation that accounts for residuals correlated in time, if it is more than "
    f"{100.0 * (_WIDER - 1.0):.0f} % larger."
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
    """Return the filters for which the paper has `column`."""
    columns = {name for row in published(table).values() for name in row}
    return [name for name in filters if f"{column}_{name}" in columns]


def lay_out(evaluation: Evaluation) -> list[Table]:
    """Return all printed tables, with the published values next to ours."""
    return [
        *accuracy(evaluation),
        estimates(evaluation, _filters(evaluation)),
        _bounds(evaluation),
        _velocities(evaluation),
        consistency(evaluation),
        *([_sensor_errors(evaluation)] if evaluation.sensor_errors else []),
        *([_faults(evaluation)] if evaluation.faults else []),
        runs(evaluation),
    ]


def _filters(evaluation: Evaluation) -> list[str]:
    return [row.filter for row in evaluation.summary]


def _columns(group: str, filters: list[str]) -> list[Column]:
    return [Column(filter_label(name), group) for name in filters]


def results_by_coefficient(evaluation: Evaluation) -> dict[str, dict[str, CoefficientResult]]:
    """Return the results by coefficient and filter."""
    results: dict[str, dict[str, CoefficientResult]] = {}
    for row in evaluation.coefficients:
        results.setdefault(row.coefficient, {})[row.filter] = row
    return results


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
        _half(evaluation, rmse, "rmse", rmse_averages),
        _half(evaluation, error, "sse_percent", error_averages),
    ]


def _half(
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
    filters = _filters(evaluation)
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

    The last rows are the averages, the number of rows below the paper's values and the CPU time.
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


def marked(row: CoefficientResult, cell: float | PlusMinus | None) -> Cell:
    """Return the cell with a mark if the data do not determine the coefficient."""
    return cell if row.identified or cell is None else Unidentified(cell)


def mark_explained(evaluation: Evaluation) -> list[str]:
    """Return the explanation of the mark if any coefficient is marked."""
    return [] if all(row.identified for row in evaluation.coefficients) else [UNIDENTIFIED]


def estimates(evaluation: Evaluation, filters: Sequence[str], with_deviations: bool = True) -> Table:
    """Return the estimates at the end, for terminal and files, with or without their standard deviations."""
    wider = {row.filter for row in evaluation.coefficients if with_deviations and _is_wider(row)}
    columns = [Column("symbol", numeric=False), Column("unit", numeric=False)]
    for name in filters:
        header = f"{filter_label(name)}{' ± sd' * with_deviations}"
        columns += [Column(header), *[Column("corrected sd")] * (name in wider)]

    def cells(name: str, row: CoefficientResult | None) -> list[Cell]:
        if row is None:
            return [None] * (1 + (name in wider))
        estimate = PlusMinus(row.estimate, row.standard_deviation) if with_deviations else row.estimate
        return [marked(row, estimate), *(_corrected(row) if name in wider else [])]

    rows: list[list[Cell]] = []
    for symbol, by_filter in results_by_coefficient(evaluation).items():
        any_row = next((by_filter[name] for name in filters if name in by_filter), None)
        if any_row is not None:
            results = (cell for name in filters for cell in cells(name, by_filter.get(name)))
            rows.append([Symbol(symbol), UnitCell(any_row.unit), *results])
    notes = (*mark_explained(evaluation), *([_CORRECTED] if wider & {*filters} else []))
    return Table("estimates", "Estimates and their standard deviations at the end", tuple(columns), rows, notes=notes)


def _is_wider(row: CoefficientResult) -> bool:
    """Whether the corrected standard deviation is large enough to be shown."""
    return (row.corrected_standard_deviation or 0.0) > _WIDER * row.standard_deviation


def _corrected(row: CoefficientResult) -> list[Cell]:
    return [number(row.corrected_standard_deviation or 0.0, DEVIATION_DIGITS) if _is_wider(row) else ""]


def _bounds(evaluation: Evaluation) -> Table:
    """Return the bounds: one column at the true values, or one for each filter at its estimate."""
    filters = _filters(evaluation)
    rows: list[list[Cell]] = []
    results_of = results_by_coefficient(evaluation)
    has_noise = any(row.bound_with_process_noise is not None for row in evaluation.coefficients)
    differ = any(len({row.cramer_rao_bound for row in by_filter.values()}) > 1 for by_filter in results_of.values())
    for symbol, by_filter in results_of.items():
        results = [by_filter.get(name) for name in filters]
        any_row = next(iter(by_filter.values()))
        bound = [row and row.cramer_rao_bound for row in (results if differ else [any_row])]
        with_noise = [any_row.bound_with_process_noise] if has_noise else []
        times = (row and row.times_bound for row in results)
        rows.append([Symbol(symbol), UnitCell(any_row.unit), *bound, *with_noise, *times])
    return Table(
        "bounds",
        "Smallest standard deviations that the data allow, and those of the estimates relative to them",
        (
            Column("Coefficient", numeric=False),
            Column("Unit", numeric=False),
            *(_columns(_BOUND, filters) if differ else [Column(_BOUND)]),
            *([Column("With process noise")] if has_noise else []),
            *_columns("Times bound", filters),
        ),
        rows,
        notes=tuple(sentence(remark) for remark in evaluation.remarks),
    )


def _velocities(evaluation: Evaluation) -> Table:
    filters = _filters(evaluation)
    in_paper = published_filters("table_v", "mae", filters)
    paper = published("table_v")
    errors = {(row.component, row.filter): row.mean_absolute_error for row in evaluation.velocity_errors}
    units = {row.component: row.unit for row in evaluation.velocity_errors}
    rows: list[list[Cell]] = [
        [
            Symbol(component),
            UnitCell(unit),
            *(errors.get((component, name)) for name in filters),
            *(paper[component][f"mae_{name}"] for name in in_paper),
        ]
        for component, unit in units.items()
    ]
    return Table(
        "velocities",
        "Velocities of the free-running model against the measured ones (as Table V)",
        (
            *(Column("Component", numeric=False), Column("Unit", numeric=False)),
            *_columns(_VELOCITY, filters),
            *_columns(f"{_VELOCITY}, *paper*", in_paper),
        ),
        rows,
        notes=(NOTE,) if in_paper else (),
    )


def consistency(evaluation: Evaluation) -> Table:
    """Return the mean NIS by sensor and filter."""
    filters = _filters(evaluation)
    nis = {(row.sensor, row.filter): row.mean_nis for row in evaluation.consistency}
    expected = {
        row.sensor: "" if np.isnan(row.expected_low) else f"{row.expected_low:.3f} to {row.expected_high:.3f}"
        for row in evaluation.consistency
    }
    rows: list[list[Cell]] = [
        [sensor, by_chance, *(nis.get((sensor, name)) for name in filters)] for sensor, by_chance in expected.items()
    ]
    return Table(
        "consistency",
        "Consistency: mean normalised innovation squared per component",
        (Column("sensor", numeric=False), Column("normal range (99 %)"), *_columns("Mean NIS", filters)),
        rows,
        notes=(NIS_MEANS, *rejections(evaluation)),
    )


def _faults(evaluation: Evaluation) -> Table:
    rows: list[list[Cell]] = [
        [
            str(fault.fault) if name == JUDGE else f"{filter_label(name)}: {fault.fault}",
            UnitCell(fault.unit),
            PlusMinus(fault.size, fault.standard_deviation),
            fault.z,
            Symbol(fault.coefficient),
            fault.susceptibility,
        ]
        for name, fault in sorted(evaluation.faults, key=lambda row: -abs(row[1].z))
    ]
    return Table(
        "faults",
        "Possible faults and their size",
        (
            *(Column("Fault", numeric=False), Column("Unit", numeric=False), Column("Size ± standard deviation")),
            *(Column("Size / standard deviation"), Column("Moves most", numeric=False), Column("Susceptibility")),
        ),
        rows,
        notes=(
            "Size: estimated from these data, as if this were the only fault. Susceptibility: how far an undetectable "
            "fault (one of its standard deviations) shifts the coefficient, in standard deviations of the coefficient.",
        ),
    )


def rejections(evaluation: Evaluation) -> list[str]:
    """Return a sentence for each filter that rejected measurements or reduced their weight."""
    sentences = []
    for name in _filters(evaluation):
        counts = [
            f"{row.rejected} of {row.sensor}" for row in evaluation.consistency if row.filter == name and row.rejected
        ]
        if counts:
            what = "weighted less than half:" if FilterName(name).in_one_batch else "the gate rejected"
            sentences.append(f"{filter_label(name)}: {what} {', '.join(counts)} (components).")
    return sentences


def _sensor_errors(evaluation: Evaluation) -> Table:
    filters = _filters(evaluation)
    by_state = {(row.state, row.segment, row.filter): row for row in evaluation.sensor_errors}
    in_segments = any(row.segment is not None for row in evaluation.sensor_errors)
    rows: list[list[Cell]] = []
    for (state, segment), any_row in {(row.state, row.segment): row for row in evaluation.sensor_errors}.items():
        results = [by_state.get((state, segment, name)) for name in filters]
        values = [row and PlusMinus(row.estimate, row.standard_deviation) for row in results]
        which = [segment or "all"] if in_segments else []
        rows.append([Symbol(state), *which, UnitCell(any_row.unit), any_row.prior_standard_deviation, *values])
    return Table(
        "sensor-errors",
        "Errors of the sensors",
        (
            Column("State", numeric=False),
            *([Column("Segment")] if in_segments else []),
            *(Column("Unit", numeric=False), Column("Prior standard deviation")),
            *_columns("Estimate ± standard deviation", filters),
        ),
        rows,
        notes=tuple(unobserved(evaluation)),
    )


def unobserved(evaluation: Evaluation) -> list[str]:
    """Return a sentence for each filter with sensor errors that the data do not determine."""
    sentences = []
    for name in _filters(evaluation):
        states = dict.fromkeys(row.state for row in evaluation.sensor_errors if row.filter == name and not row.observed)
        if states:
            sentences.append(
                f"{filter_label(name)}: {', '.join(states)} is not observable in this manoeuvre; do not use the value."
            )
    return sentences


def runs(evaluation: Evaluation) -> Table:
    """Return error, cost and judgement of each filter."""
    headers = _AVERAGE, "CPU time s", "steps", "µs/step"
    columns = Column("filter", numeric=False), *map(Column, headers), Column("judgement", numeric=False)
    rows: list[list[Cell]] = [
        [
            filter_label(row.filter),
            row.average_steady_state_error_percent,
            row.cpu_time_s,
            row.steps,
            row.microseconds_per_step,
            row.grade,
        ]
        for row in evaluation.summary
    ]
    notes = tuple(judgement_sentences(evaluation.judgements(), with_sound=False))
    table = Table("runs", "Error, cost and judgement", columns, rows, notes=notes)
    has_average = any(row.average_steady_state_error_percent is not None for row in evaluation.summary)
    return table if has_average else table.without(_AVERAGE)


def write_tables(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write the CSV, Markdown and LaTeX tables.

    Raises
    ------
    FileError
        If a file cannot be written; an existing file then stays as it was.
    """
    paths = write_csv_tables(evaluation.tables() | table_iv(evaluation), folder)
    markdown, latex = folder / "tables.md", folder / "tables.tex"
    write_text(markdown, render_markdown(lay_out(evaluation)))
    write_text(latex, render_latex(lay_out(evaluation)))
    return [*paths, markdown, latex]
