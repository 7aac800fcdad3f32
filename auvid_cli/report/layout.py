"""An evaluation laid out as the paper's Tables IV and V, and what else one wants to read."""

from collections.abc import Sequence

import numpy as np

from auvid_cli.config.filter_name import JUDGE, FilterName
from auvid_cli.evaluation.accuracy import CoefficientResult
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.judgements import judgement_sentences
from auvid_cli.report.notation import filter_label
from auvid_cli.report.paper import NOTE, published, published_filters
from auvid_cli.report.sentence import sentence
from auvid_cli.report.table import (
    DEVIATION_DIGITS,
    ERROR_DIGITS,
    UNIDENTIFIED,
    Cell,
    Column,
    PlusMinus,
    Symbol,
    Table,
    Unidentified,
    UnitCell,
    number,
)

_RMSE = "RMSE"
_ERROR = "Steady-state error (%)"
_VELOCITY = "Mean absolute error"
_BOUND = "Cramér-Rao bound"
_AVERAGE = "average error %"
# A corrected standard deviation is told where it is more than so many times the nominal one.
_WIDER = 1.02
_ERROR_OF = (
    "Error %: how far the mean over the last tenth of the run lies from the true value; an estimate beside it is that "
    "at the end."
)
NIS_MEANS = (
    "NIS: squares of the innovations by their stated variance, mean of a component. 1: noise is as stated. More: data "
    "and model disagree. Less: more noise is stated than there is, as it is on purpose of an AHRS."
)
_CORRECTED = (
    "Corrected sd: standard deviation with allowance for residuals that are correlated in time, where that makes it "
    f"more than {100.0 * (_WIDER - 1.0):.0f} % larger."
)


def lay_out(evaluation: Evaluation, with_paper: bool) -> list[Table]:
    """Lay out all printed tables.

    Parameters
    ----------
    evaluation : Evaluation
    with_paper : bool
        Whether the published columns stand beside ours.
    """
    has_truth = any(row.true is not None for row in evaluation.coefficients)
    accuracy = [_accuracy(evaluation, with_paper)] if has_truth else []
    return [
        *accuracy,
        estimates(evaluation, _filters(evaluation), with_truth=False),
        _bounds(evaluation),
        _velocities(evaluation, with_paper),
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
    """Return results by coefficient and filter, in the order in which they come."""
    results: dict[str, dict[str, CoefficientResult]] = {}
    for row in evaluation.coefficients:
        results.setdefault(row.coefficient, {})[row.filter] = row
    return results


def _accuracy(evaluation: Evaluation, with_paper: bool) -> Table:
    filters = _filters(evaluation)
    in_paper = published_filters("table_iv", "rmse", filters) if with_paper else []
    keys = [f"{quantity}_{name}" for quantity in ("rmse", "sse_percent") for name in in_paper]
    paper = published("table_iv")

    def theirs(row: str) -> list[Cell]:
        return [paper.get(row, {}).get(key, "") for key in keys]

    rows: list[list[Cell]] = []
    for symbol, by_filter in results_by_coefficient(evaluation).items():
        results = [by_filter.get(name) for name in filters]
        any_row = next(iter(by_filter.values()))
        rmse = [row and marked(row, row.rmse) for row in results]
        error = [row and marked(row, row.steady_state_error_percent) for row in results]
        rows.append([Symbol(symbol), UnitCell(any_row.unit), any_row.true, *rmse, *error, *theirs(symbol)])
    nothing = [""] * len(filters)
    average = [row.average_steady_state_error_percent for row in evaluation.summary]
    cpu_time = [row.cpu_time_s for row in evaluation.summary]
    return Table(
        "accuracy",
        "Accuracy of the coefficients (as Table IV)",
        (
            *(Column("Coefficient", numeric=False), Column("Unit", numeric=False), Column("True")),
            *_columns(_RMSE, filters),
            *_columns(_ERROR, filters),
            *_columns(f"{_RMSE}, *paper*", in_paper),
            *_columns(f"{_ERROR}, *paper*", in_paper),
        ),
        rows,
        [
            ["Average", "", "", *nothing, *average, *theirs("average")],
            ["CPU time", "s", "", *cpu_time, *nothing, *theirs("cpu_time_s")],
        ],
        (*([NOTE] if in_paper else []), _ERROR_OF, *mark_explained(evaluation)),
    )


def marked(row: CoefficientResult, cell: float | PlusMinus | None) -> Cell:
    """Mark what the data do not determine."""
    return cell if row.identified or cell is None else Unidentified(cell)


def mark_explained(evaluation: Evaluation) -> list[str]:
    """Return the sentence that explains the mark, if anything is marked."""
    return [] if all(row.identified for row in evaluation.coefficients) else [UNIDENTIFIED]


def estimates(evaluation: Evaluation, filters: Sequence[str], with_truth: bool, with_deviations: bool = True) -> Table:
    """Lay out what filters found, as for the terminal so for files.

    Parameters
    ----------
    evaluation : Evaluation
    filters : sequence of str
    with_truth : bool
        Whether the true values, where they are known, and the errors stand beside it.
    with_deviations : bool
        Whether the standard deviations do.
    """
    has_truth = with_truth and any(row.true is not None for row in evaluation.coefficients)
    wider = {row.filter for row in evaluation.coefficients if with_deviations and _is_wider(row)}
    columns = [Column("symbol", numeric=False), Column("unit", numeric=False), *[Column("true")] * has_truth]
    for name in filters:
        columns.append(Column(f"{filter_label(name)}{' ± sd' if with_deviations else ''}"))
        columns += [Column("corrected sd")] * (name in wider) + [Column("error %")] * has_truth

    def cells(name: str, row: CoefficientResult | None) -> list[Cell]:
        if row is None:
            return [None] * (1 + (name in wider) + has_truth)
        estimate = PlusMinus(row.estimate, row.standard_deviation) if with_deviations else row.estimate
        corrected = _corrected(row) if name in wider else []
        error = row.steady_state_error_percent
        return [
            marked(row, estimate),
            *corrected,
            *[None if error is None else number(error, ERROR_DIGITS)] * has_truth,
        ]

    rows: list[list[Cell]] = []
    for symbol, by_filter in results_by_coefficient(evaluation).items():
        any_row = next((by_filter[name] for name in filters if name in by_filter), None)
        if any_row is not None:
            results = (cell for name in filters for cell in cells(name, by_filter.get(name)))
            rows.append([Symbol(symbol), UnitCell(any_row.unit), *[any_row.true] * has_truth, *results])
    notes = (
        *([_ERROR_OF] if has_truth else []),
        *mark_explained(evaluation),
        *([_CORRECTED] if wider & {*filters} else []),
    )
    return Table("estimates", "Estimates and their standard deviations at the end", tuple(columns), rows, notes=notes)


def _is_wider(row: CoefficientResult) -> bool:
    """Say whether its standard deviation is corrected by so much that it is worth telling."""
    return (row.corrected_standard_deviation or 0.0) > _WIDER * row.standard_deviation


def _corrected(row: CoefficientResult) -> list[Cell]:
    return [number(row.corrected_standard_deviation or 0.0, DEVIATION_DIGITS) if _is_wider(row) else ""]


def _bounds(evaluation: Evaluation) -> Table:
    """Lay out bounds: at the truth there is one; at each filter's own estimate it is another for each."""
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
        "Least standard deviations that the data allow, and how many times as large those of the estimates are",
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


def _velocities(evaluation: Evaluation, with_paper: bool) -> Table:
    filters = _filters(evaluation)
    in_paper = published_filters("table_v", "mae", filters) if with_paper else []
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
    """Lay out the mean NIS by sensor and filter, as for the terminal so for files."""
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
        (Column("NIS of", numeric=False), Column("99 % of chance"), *_columns("Mean NIS", filters)),
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
        "What may be wrong, by what it would leave in the innovations of the smoother",
        (
            *(Column("Fault", numeric=False), Column("Unit", numeric=False), Column("Size ± standard deviation")),
            *(Column("Size / standard deviation"), Column("Moves most", numeric=False), Column("Susceptibility")),
        ),
        rows,
        notes=(
            "The size is what these data say of each fault if nothing else was wrong. Susceptibility: by how many of "
            "its standard deviations a fault of one of its own, which these data cannot show, moves that coefficient.",
        ),
    )


def rejections(evaluation: Evaluation) -> list[str]:
    """Return a sentence for each filter whose gate rejected measurements, and each fit that weighed some down."""
    sentences = []
    for name in _filters(evaluation):
        counts = [
            f"{row.rejected} of {row.sensor}" for row in evaluation.consistency if row.filter == name and row.rejected
        ]
        if counts:
            what = "counted less than half" if FilterName(name).in_one_batch else "the gate rejected"
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
    """Return a sentence for each filter that was asked for a sensor error which the data do not determine."""
    sentences = []
    for name in _filters(evaluation):
        states = dict.fromkeys(row.state for row in evaluation.sensor_errors if row.filter == name and not row.observed)
        if states:
            sentences.append(
                f"{filter_label(name)}: {', '.join(states)} cannot be observed on this manoeuvre; do not use the value."
            )
    return sentences


def runs(evaluation: Evaluation) -> Table:
    """Lay out error, cost and judgement of each filter, as for the terminal so for files."""
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
