"""What a run found, for the terminal."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from auvid_cli.evaluation.accuracy import CoefficientResult
from auvid_cli.evaluation.assessment import CLASSES, Identifiability
from auvid_cli.evaluation.check import Check
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.layout import mark_explained, rejections, unobserved
from auvid_cli.report.notation import filter_label, unit_text
from auvid_cli.report.screen_table import first_that_fits, fits, screen_table
from auvid_cli.report.sentence import sentence
from auvid_cli.report.table import DEVIATION_DIGITS, number

_MISSING = "-"
_ERROR_DIGITS = 2


def print_summary(console: Console, evaluation: Evaluation) -> None:
    """Print coefficients, averages, consistency, cost and status of every filter.

    Parameters
    ----------
    console : rich.console.Console
        Where it is narrow, units and then standard deviations are left out, the latter only with a truth.
    evaluation : Evaluation
    """
    filters = [row.filter for row in evaluation.summary]
    if evaluation.coefficients:
        for table in _tables_that_fit(console, evaluation, filters):
            console.print(table)
    console.print(_runs(console, evaluation))
    for row in evaluation.summary:
        if row.status != "completed":
            console.print(Text(f"{filter_label(row.filter)} {row.status}"))
    marked = [_printable(console, text, text.replace("†", "?")) for text in mark_explained(evaluation)]
    for text in [*marked, *evaluation.remarks, *unobserved(evaluation), *rejections(evaluation)]:
        console.print(Text(text))


def print_files(console: Console, files: Sequence[Path]) -> None:
    """Print in which folders files are, and how many."""
    for folder, count in Counter(path.parent for path in files).items():
        line = f"{count} {'file' if count == 1 else 'files'} in {folder}"
        console.print(Text(line), soft_wrap=True)


def print_checks(console: Console, checks: Sequence[Check], passed: bool = True) -> None:
    """Print verdicts, those that did not pass with what to do about them; `passed` says whether also the others."""
    for name in dict.fromkeys(check.filter for check in checks):
        of_filter = [check for check in checks if check.filter == name]
        whose = filter_label(name) if name else "data"
        console.print(Text(f"{whose}: {sum(check.passed is True for check in of_filter)} of {len(of_filter)} passed"))
        table = screen_table()
        for header in ("", "of", "check", "found", "may be"):
            table.add_column(header, overflow="fold")
        for check in of_filter if passed else [check for check in of_filter if not check.passed]:
            verdict = {True: "pass", False: "FAIL", None: "note"}[check.passed]
            style = {True: "", False: "bold red", None: "yellow"}[check.passed]
            cells = check.subject, check.check, check.statistic, check.threshold
            table.add_row(Text(verdict, style=style), *(Text(cell) for cell in cells))
        if table.rows:
            console.print(table)
        for check in of_filter:
            if not check.passed:
                console.print(Text(f"{check.check} of {check.subject}: {check.advice}"))
                console.print()


def print_identifiability(console: Console, identifiability: Identifiability) -> None:
    """Print bounds by verdict, who contributes, what goes together, how bounds fall, and unseen sensor errors."""
    console.print(first_that_fits(console, _ever_fewer_bounds(console, identifiability)))
    if identifiability.remark:
        console.print(Text(sentence(identifiability.remark)))
    for group in identifiability.groups:
        console.print(
            Text(
                f"{', '.join(group.members)} go together: {group.combination} is known to {group.percent:.2g} %, "
                f"the worst of them alone to {group.worst_percent:.2g} %"
            )
        )
    for symbol, error in identifiability.sensor_errors.items():
        unseen = "" if error.observed else ": cannot be observed on this manoeuvre"
        console.print(Text(f"{symbol}: bound {printed(error.bound, 2)}, prior {printed(error.prior, 2)}{unseen}"))
    half = min(identifiability.growth, key=lambda entry: abs(entry[0] - 0.5 * identifiability.growth[-1][0]))
    whole = identifiability.growth[-1]
    medians = [f"{np.median(percent):.2g} % after {time:.4g} s" for time, percent in dict([half, whole]).items()]
    console.print(Text(f"median bound {', '.join(medians)}"))


def _ever_fewer_bounds(console: Console, identifiability: Identifiability) -> Iterator[Table]:
    """Tabulate bounds with ever fewer columns; symbol, bound in percent and verdict always."""
    ranks = {label: rank for rank, (_, label) in enumerate(CLASSES)}
    bounds = sorted(identifiability.bounds, key=lambda bound: ranks[bound.verdict])
    columns = {
        "symbol": [bound.coefficient for bound in bounds],
        "unit": [_printable(console, unit_text(bound.unit), bound.unit) for bound in bounds],
        "value": [printed(bound.value) for bound in bounds],
        "bound": [printed(bound.cramer_rao_bound, 2) for bound in bounds],
        "bound %": [printed(bound.percent, 2) for bound in bounds],
        "verdict": [bound.verdict for bound in bounds],
        "mostly from": [f"{bound.best_sensor} {bound.best_share:.0%}" for bound in bounds],
        "goes with": [bound.group for bound in bounds],
    }
    if not identifiability.groups:
        del columns["goes with"]
    for dropped in ("", "goes with", "unit", "value", "bound", "mostly from"):
        columns.pop(dropped, None)
        table = screen_table()
        for header in columns:
            table.add_column(header, justify="right" if header in ("value", "bound", "bound %") else "left")
        for row in zip(*columns.values(), strict=True):
            table.add_row(*(Text(cell) for cell in row))
        yield table


def _tables_that_fit(console: Console, evaluation: Evaluation, filters: list[str]) -> list[Table]:
    """Make one table with as much in it as there is room for, or else one for each filter."""
    has_truth = any(row.true is not None for row in evaluation.coefficients)
    shown = product((True, False) if has_truth else (True,), (True, False))
    table = first_that_fits(console, (_coefficients(console, evaluation, filters, *which) for which in shown))
    if len(filters) == 1 or fits(console, table):
        return [table]
    return [table for name in filters for table in _tables_that_fit(console, evaluation, [name])]


def _coefficients(console: Console, evaluation: Evaluation, filters: list[str], deviations: bool, units: bool) -> Table:
    table = screen_table()
    plus_minus = _printable(console, "±", "+-")
    has_truth = any(row.true is not None for row in evaluation.coefficients)
    table.add_column("symbol", no_wrap=True)
    if units:
        table.add_column("unit", no_wrap=True)
    if has_truth:
        table.add_column("true", justify="right", no_wrap=True)
    for name in filters:
        table.add_column(f"{filter_label(name)}{f' {plus_minus} sd' if deviations else ''}", justify="right")
        if has_truth:
            table.add_column("error %", justify="right", no_wrap=True)

    def cells(row: CoefficientResult | None) -> list[str]:
        if row is None:
            return [_MISSING, _MISSING] if has_truth else [_MISSING]
        estimate = printed(row.estimate)
        if deviations:
            estimate += f" {plus_minus} {printed(row.standard_deviation, DEVIATION_DIGITS)}"
        estimate += "" if row.identified else _printable(console, "†", "?")
        return [estimate, printed(row.steady_state_error_percent, _ERROR_DIGITS)] if has_truth else [estimate]

    rows = {(row.coefficient, row.filter): row for row in evaluation.coefficients}
    for symbol in dict.fromkeys(row.coefficient for row in evaluation.coefficients):
        results = [rows.get((symbol, name)) for name in filters]
        any_row = next((row for row in results if row is not None), None)
        if any_row is None:
            continue
        unit = _printable(console, unit_text(any_row.unit), any_row.unit)
        line = [symbol, *([unit] if units else []), *([printed(any_row.true)] if has_truth else [])]
        table.add_row(*(Text(cell) for cell in [*line, *(cell for row in results for cell in cells(row))]))
    return table


def _runs(console: Console, evaluation: Evaluation) -> Table:
    """Tabulate the filters, a line for each."""
    table = screen_table()
    microseconds = _printable(console, "µs/step", "us/step")
    table.add_column("filter", no_wrap=True)
    has_average = any(row.average_steady_state_error_percent is not None for row in evaluation.summary)
    average = ["average error %"] if has_average else []
    for header in (*average, "mean NIS", "CPU time s", "steps", microseconds):
        table.add_column(header, justify="right")
    table.add_column("status", no_wrap=True)
    for row in evaluation.summary:
        numbers = [
            *([printed(row.average_steady_state_error_percent)] if has_average else []),
            printed(row.mean_nis),
            printed(row.cpu_time_s),
            printed(row.steps),
            printed(row.microseconds_per_step),
        ]
        table.add_row(*(Text(cell) for cell in [filter_label(row.filter), *numbers, row.status.split()[0].rstrip(":")]))
    return table


def printed(value: float | None, digits: int = 4) -> str:
    """Write a number for the terminal, a dash where there is none."""
    return _MISSING if value is None else number(value, digits) or _MISSING


def _printable(console: Console, text: str, plain: str) -> str:
    """Return the text, or plain letters where the terminal's encoding lacks its signs."""
    try:
        text.encode(console.encoding)
    except UnicodeEncodeError:
        return plain
    return text
