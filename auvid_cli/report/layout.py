"""All tables of a run, and the files that they are written to."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import FaultTest
from auvid_cli.data.files import write_text
from auvid_cli.evaluation.accuracy import CoefficientResult, coefficient_results
from auvid_cli.evaluation.evaluate import Evaluation, FilterSummary
from auvid_cli.evaluation.judgement import Judgement
from auvid_cli.report.sentences import judgement_sentences
from auvid_cli.report.table import (
    DEVIATION_DIGITS,
    Cell,
    Column,
    PlusMinus,
    Symbol,
    Table,
    UnitCell,
    filter_label,
    number,
    tabulated,
    text_column,
)
from auvid_cli.report.table_iv import (
    NOTE,
    accuracy,
    filters_of,
    mark_explained,
    marked,
    published,
    published_filters,
    results_by_coefficient,
    table_iv,
)
from auvid_cli.report.text_tables import render_latex, render_markdown, write_csv_tables
from auvid_cli.text import sentence

_VELOCITY = "Mean absolute error"
_BOUND = "Cramér-Rao bound"
_AVERAGE = "average error %"
NIS_MEANS = (
    "NIS: squared prediction error / expected variance, mean over the components. 1 is right. Larger: data and model "
    "disagree. Smaller: the stated noise is too large; for an AHRS this is intended."
)
_TOTAL = (
    "± total: standard deviation that also allows for errors of known quantities (identification.tolerances), such as "
    "inertia and thrust. ± data: from noise alone; for smoother and output error (OE), noise may be correlated in time."
)
_FROM = (
    "Mostly from: the largest causes of ± total, each in percent of the value: noise, a known quantity, or a term that "
    "the model does not have, such as Y_|v|r."
)


def lay_out(evaluation: Evaluation) -> list[Table]:
    """Return all printed tables, with the published values next to ours."""
    return [
        *accuracy(evaluation),
        estimates(evaluation, filters_of(evaluation)),
        _bounds(evaluation),
        _velocities(evaluation),
        consistency(evaluation),
        *([sensor_errors(evaluation)] if evaluation.sensor_errors else []),
        *([_faults(evaluation)] if evaluation.faults else []),
        runs(evaluation),
    ]


def _columns(group: str, filters: list[str]) -> list[Column]:
    return [Column(filter_label(name), group) for name in filters]


def evaluation_of(estimate: Estimate, judgement: Judgement) -> Evaluation:
    """Return the coefficients of one estimate without the truth, as tables take them."""
    return Evaluation(coefficient_results(estimate, None, {}, judgement), [], [], [], [], [], {}, [])


def estimate_table(estimate: Estimate, judgement: Judgement) -> Table:
    """Return the coefficients of one estimate with standard deviations, without the truth."""
    return estimates(evaluation_of(estimate, judgement), [estimate.filter])


def estimates(evaluation: Evaluation, filters: Sequence[str]) -> Table:
    """Return the estimates at the end with their standard deviations, for terminal and files.

    A total standard deviation has that of the data next to it, and for one filter the known quantities that it is
    mostly due to.
    """
    own = [row for row in evaluation.coefficients if row.filter in filters]
    has_total = {row.filter for row in own if row.total_standard_deviation is not None}
    has_cause = len(filters) == 1 and any(row.contributors for row in own)
    columns = [text_column("symbol"), text_column("unit")]
    for name in filters:
        kind = " ± total" if name in has_total else " ± sd"
        columns += [Column(f"{filter_label(name)}{kind}"), *[Column("± data")] * (name in has_total)]
    columns += [text_column("mostly from")] * has_cause

    def cells(name: str, row: CoefficientResult | None) -> list[Cell]:
        if row is None:
            return [None] * (1 + (name in has_total))
        estimate = PlusMinus(row.estimate, shown_deviation(row))
        return [marked(row, estimate), *[number(data_deviation(row), DEVIATION_DIGITS)] * (name in has_total)]

    rows: list[list[Cell]] = []
    for symbol, by_filter in results_by_coefficient(evaluation).items():
        any_row = next((by_filter[name] for name in filters if name in by_filter), None)
        if any_row is not None:
            results = [cell for name in filters for cell in cells(name, by_filter.get(name))]
            causes: list[Cell] = [any_row.contributors.replace("; ", ", ")] * has_cause
            rows.append([Symbol(symbol), UnitCell(any_row.unit), *results, *causes])
    notes = (*mark_explained(evaluation), *([_TOTAL] if has_total else []), *([_FROM] if has_cause else []))
    return Table("estimates", "Estimates and their standard deviations at the end", tuple(columns), rows, notes=notes)


def data_deviation(row: CoefficientResult) -> float:
    """Return the standard deviation by the data, corrected for autocorrelated residuals if this is known."""
    corrected = row.corrected_standard_deviation
    return row.standard_deviation if corrected is None else corrected


def shown_deviation(row: CoefficientResult) -> float:
    """Return the total standard deviation if it is known, or else that by the data."""
    total = row.total_standard_deviation
    return data_deviation(row) if total is None else total


def _bounds(evaluation: Evaluation) -> Table:
    """Return the bounds: one column at the true values, or one for each filter at its estimate."""
    filters = filters_of(evaluation)
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
            text_column("Coefficient"),
            text_column("Unit"),
            *(_columns(_BOUND, filters) if differ else [Column(_BOUND)]),
            *([Column("With process noise")] if has_noise else []),
            *_columns("Times bound", filters),
        ),
        rows,
        notes=tuple(sentence(remark) for remark in evaluation.remarks),
    )


def _velocities(evaluation: Evaluation) -> Table:
    filters = filters_of(evaluation)
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
            *(text_column("Component"), text_column("Unit")),
            *_columns(_VELOCITY, filters),
            *_columns(f"{_VELOCITY}, *paper*", in_paper),
        ),
        rows,
        notes=(NOTE,) if in_paper else (),
    )


def consistency(evaluation: Evaluation) -> Table:
    """Return the mean NIS by sensor and filter."""
    filters = filters_of(evaluation)
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
        "Mean NIS: prediction error squared / expected variance",
        (text_column("sensor"), Column("normal range (99 %)"), *_columns("Mean NIS", filters)),
        rows,
        notes=(NIS_MEANS, *rejections(evaluation)),
    )


def _faults(evaluation: Evaluation) -> Table:
    cells: dict[Column, Callable[[tuple[str, FaultTest]], Cell]] = {
        text_column("Fault"): lambda row: f"{'' if row[0] == JUDGE else f'{filter_label(row[0])}: '}{row[1].fault}",
        text_column("Unit"): lambda row: UnitCell(row[1].unit),
        Column("Size ± standard deviation"): lambda row: PlusMinus(row[1].size, row[1].standard_deviation),
        Column("Size / standard deviation"): lambda row: row[1].z,
        text_column("Moves most"): lambda row: Symbol(row[1].coefficient),
        Column("Susceptibility"): lambda row: row[1].susceptibility,
    }
    notes = (
        "Size: estimated from these data, as if this were the only fault. Susceptibility: how far an undetectable "
        "fault (one of its standard deviations) shifts the coefficient, in standard deviations of the coefficient.",
    )
    rows = sorted(evaluation.faults, key=lambda row: -abs(row[1].z))
    return tabulated("faults", "Possible faults and their size", rows, cells, notes)


def rejections(evaluation: Evaluation) -> list[str]:
    """Return a sentence for each filter that rejected measurements or reduced their weight."""
    sentences = []
    for name in filters_of(evaluation):
        counts = [
            f"{row.rejected} of {row.sensor}" for row in evaluation.consistency if row.filter == name and row.rejected
        ]
        if counts:
            what = "weighted less than half:" if FilterName(name).in_one_batch else "the gate rejected"
            sentences.append(f"{filter_label(name)}: {what} {', '.join(counts)} (components).")
    return sentences


def sensor_errors(evaluation: Evaluation) -> Table:
    """Return the estimated errors of sensors and inputs by filter."""
    filters = filters_of(evaluation)
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
        "Errors of sensors and inputs: estimate ± standard deviation",
        (
            text_column("error"),
            *([Column("segment")] if in_segments else []),
            *(text_column("unit"), Column("prior sd")),
            *_columns("Estimate ± standard deviation", filters),
        ),
        rows,
        notes=tuple(unobserved(evaluation)),
    )


def unobserved(evaluation: Evaluation) -> list[str]:
    """Return a sentence for each filter with sensor errors that the data do not determine."""
    sentences = []
    for name in filters_of(evaluation):
        states = dict.fromkeys(row.state for row in evaluation.sensor_errors if row.filter == name and not row.observed)
        if states:
            sentences.append(
                f"{filter_label(name)}: {', '.join(states)} is not observable in this manoeuvre; do not use the value."
            )
    return sentences


def runs(evaluation: Evaluation) -> Table:
    """Return error, cost and judgement of each filter."""
    cells: dict[Column, Callable[[FilterSummary], Cell]] = {
        text_column("filter"): lambda row: filter_label(row.filter),
        Column(_AVERAGE): lambda row: row.average_steady_state_error_percent,
        Column("CPU time s"): lambda row: row.cpu_time_s,
        Column("steps"): lambda row: row.steps,
        Column("µs/step"): lambda row: row.microseconds_per_step,
        text_column("judgement"): lambda row: str(row.judgement.grade),
    }
    notes = tuple(judgement_sentences(evaluation.judgements(), with_sound=False))
    table = tabulated("runs", "Error, cost and judgement", evaluation.summary, cells, notes)
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
