"""Tables on the terminal: checks, judgements, identifiability and validation."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table as ScreenTable
from rich.text import Text

from auvid_cli.config.enums import JUDGE
from auvid_cli.data.checks import Check
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.accuracy import one_speed_remarks
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.evaluation.judgement import Judgement
from auvid_cli.evaluation.results import CLASSES, CoefficientBound, FixSuggestion, Identifiability
from auvid_cli.report.layout import (
    NIS_MEANS,
    consistency,
    estimates,
    evaluation_of,
    rejections,
    runs,
    sensor_errors,
    unobserved,
)
from auvid_cli.report.sentences import (
    SharedCheck,
    advices,
    counts_in_words,
    judgement_sentences,
    score_sentences,
    shared_checks,
    whose,
)
from auvid_cli.report.table import (
    ERROR_DIGITS,
    Cell,
    Column,
    Symbol,
    Table,
    UnitCell,
    filter_label,
    tabulated,
    text_column,
)
from auvid_cli.report.table_iv import PAPER, accuracy, mark_explained
from auvid_cli.report.text_tables import encodable, fits, narrowed, print_texts, printed, screen_table
from auvid_cli.text import degrees_for, sentence
from auvid_cli.validation.results import AHEAD, FREE_RUN, ManoeuvreNumber, Prediction, Validation

_NOTES = (
    "Bound: smallest standard deviation that an estimate from these data can have (Cramer-Rao), with sensor noise "
    "only; with noise %: with process noise as well. The class is that of the larger bound. Mostly from: the sensor "
    "with the largest share of the information.",
)
# Columns left out on a narrow terminal, in this order.
_DROPPED_OF_BOUNDS = "goes with", "unit", "value", "bound", "mostly from"
# Choices of columns to leave out on a narrow terminal, in this order.
_CAUSES = "mostly from"
_SECOND_CAUSE = "second cause"
_DROPPED_OF_ESTIMATES: tuple[tuple[str, ...], ...] = (
    (),
    (_SECOND_CAUSE,),
    (_SECOND_CAUSE, "± data"),
    (_CAUSES,),
    (_CAUSES, "± data"),
    (_CAUSES, "± data", "unit"),
)
_VERDICTS = {True: "pass", False: "FAIL", None: "note"}
_STYLES = {"FAIL": "bold red", "note": "yellow"}
_VALIDATION_DIGITS = 3
# Columns left out on a narrow terminal, in this order.
_DROPPED_OF_MODELS = "vehicle file", "prior", "unchanged"
_ERRORS = (
    "Free run: the model is driven by the inputs alone. Noise: stated noise of the sensor. RMSE: error of the model. "
    "Unchanged: error if the motion stayed as at the start. Prior: error with the coefficients of the prior. Vehicle "
    "file: error of the vehicle as stated, without estimated trims and thrust."
)
_BAND = (
    "Band: two standard deviations. They allow for errors of the coefficients, the initial motion and the "
    "measurements, and for known defects of the model."
)


def assessment_sentences(identifiability: Identifiability) -> list[str]:
    """Return sentences on missing data, inseparable coefficients, unobservable states and bounds over time."""
    sentences = [sentence(identifiability.remark)] if identifiability.remark else []
    sentences += [
        f"{', '.join(group.members)} cannot be separated: {group.combination} is known to {group.percent:.2g} %, "
        f"the worst of them alone to {group.worst_percent:.2g} %"
        for group in identifiability.groups
    ]
    for symbol, error in identifiability.sensor_errors.items():
        unobserved = "" if error.observed else ": not observable in this manoeuvre"
        sentences.append(f"{symbol}: bound {printed(error.bound, 2)}, prior {printed(error.prior, 2)}{unobserved}")
    half = min(identifiability.growth, key=lambda entry: abs(entry[0] - 0.5 * identifiability.growth[-1][0]))
    whole = identifiability.growth[-1]
    medians = [f"{np.median(percent):.2g} % after {time:.4g} s" for time, percent in dict([half, whole]).items()]
    return [*sentences, f"median bound {', '.join(medians)}"]


def holding_sentence(holding: FixSuggestion) -> str:
    """Return which coefficients to fix, and the setting that does so."""
    missing = f" (add {', '.join(holding.unstated)} to it first)" if holding.unstated else ""
    only = f"These data contain only {', '.join(holding.motions)}. " if len(holding.motions) < 6 else ""
    return (
        f"{only}Hold {', '.join(holding.held)} at the values of the vehicle file{missing}; then the rest is known to "
        f"{holding.worst_percent:.2g} % or better:\n"
        f"  --set 'identification.coefficients=[{', '.join(holding.kept)}]'"
    )


def bounds_table(identifiability: Identifiability) -> Table:
    """Return the bounds by class, with the sensor that contributes most."""
    ranks = {label: rank for rank, (_, label) in enumerate(CLASSES)}
    bounds = sorted(identifiability.bounds, key=lambda bound: ranks[bound.label])
    cells: dict[Column, Callable[[CoefficientBound], Cell]] = {
        text_column("symbol"): lambda bound: Symbol(bound.coefficient),
        text_column("unit"): lambda bound: UnitCell(bound.unit),
        Column("value"): lambda bound: bound.value,
        Column("bound"): lambda bound: printed(bound.cramer_rao_bound, 2),
        Column("bound %"): lambda bound: printed(bound.percent, 2),
        Column("with noise %"): lambda bound: printed(bound.percent_with_noise, 2),
        text_column("class"): lambda bound: bound.label,
        text_column("mostly from"): lambda bound: f"{bound.best_sensor} {bound.best_share:.0%}",
        text_column("goes with"): lambda bound: bound.group,
    }
    table = tabulated("bounds", "Smallest standard deviations that the data allow", bounds, cells, _NOTES)
    return table if identifiability.groups else table.without("goes with")


def print_summary(console: Console, evaluation: Evaluation) -> None:
    """Print coefficients, averages, cost, judgement and consistency of all filters.

    Parameters
    ----------
    console : rich.console.Console
        On a narrow console, units, true values and the paper's columns are left out and named below the table.
    """
    if console.quiet:
        # Choosing the columns that fit takes a tenth of a second.
        return
    filters = [row.filter for row in evaluation.summary]
    notes = dict.fromkeys(mark_explained(evaluation))
    if evaluation.coefficients:
        for table in accuracy(evaluation):
            console.print(Text(table.title))
            console.print(narrowed(console, table, ("unit", "true", PAPER), ERROR_DIGITS + 1))
            notes |= dict.fromkeys(table.notes)
        for screen in _estimate_tables(console, evaluation, filters):
            console.print(screen)
        notes |= dict.fromkeys(estimates(evaluation, filters).notes)
    if evaluation.sensor_errors:
        table = sensor_errors(evaluation)
        console.print(Text(encodable(console, table.title)))
        console.print(narrowed(console, table, ("prior sd", *map(filter_label, filters[:-1]), "unit")))
    console.print(screen_table(console, runs(evaluation), unbroken=("filter", "judgement")))
    print_texts(console, judgement_sentences(evaluation.judgements(), with_sound=False))
    console.print(screen_table(console, consistency(evaluation), ERROR_DIGITS + 1, unbroken=("sensor",)))
    console.print(Text(NIS_MEANS))
    explained = [encodable(console, text) for text in notes]
    print_texts(console, [*explained, *evaluation.remarks, *unobserved(evaluation), *rejections(evaluation)])


def print_estimate(console: Console, estimate: Estimate, judgement: Judgement) -> None:
    """Print the coefficients of one estimate with their standard deviations, without the truth."""
    if console.quiet or not estimate.completed:
        return
    evaluation = evaluation_of(estimate, judgement)
    for screen in _estimate_tables(console, evaluation, [estimate.filter]):
        console.print(screen)
    for text in (*estimates(evaluation, [estimate.filter]).notes, *one_speed_remarks(estimate)):
        console.print(Text(encodable(console, text)))


def print_files(console: Console, files: Sequence[Path]) -> None:
    """Print the folders of the files with the number of files."""
    for folder, count in Counter(path.parent for path in files).items():
        line = f"{count} {'file' if count == 1 else 'files'} in {folder}"
        console.print(Text(line), soft_wrap=True)


def print_checks(console: Console, checks: Sequence[Check], passed: bool) -> None:
    """Print the number of checks, and the checks that did not pass, with advice; estimates share rows.

    Parameters
    ----------
    passed : bool
        Whether to print all checks, estimate by estimate.
    """
    names = list(dict.fromkeys(check.filter for check in checks))
    shared = shared_checks(checks)
    print_texts(console, counts_in_words(checks))
    if passed:
        for name in names:
            console.print(Text(f"{whose([name])}:"))
            own = [SharedCheck(check, (name,)) for check in checks if check.filter == name]
            console.print(screen_table(console, _checks(own, [name]), styles=_STYLES))
    elif shared:
        console.print(screen_table(console, _checks(shared, names), styles=_STYLES))
        if len(names) > 1:
            shown = whose([JUDGE if JUDGE in names else names[0]])
            console.print(
                Text(f"Column found: value of the {shown} if its check is in the row. --verbose prints all estimators.")
            )
            console.print()
    for advice in advices(shared):
        only = f", {whose(advice.filters)}" if len(advice.filters) < len(names) else ""
        console.print(Text(f"{advice.what}{only}: {advice.text}"))
        console.print()


def _checks(shared: Sequence[SharedCheck], names: Sequence[str]) -> Table:
    cells: dict[Column, Callable[[SharedCheck], Cell]] = {
        text_column(""): lambda row: _VERDICTS[row.check.passed],
        text_column("estimator"): lambda row: whose(row.filters, names),
        text_column("subject"): lambda row: row.check.subject,
        text_column("check"): lambda row: row.check.check,
        text_column("found"): lambda row: row.check.statistic,
        text_column("expected"): lambda row: row.check.threshold,
    }
    table = tabulated("checks", "Checks", shared, cells)
    return table if any(len(each.filters) < len(names) for each in shared) else table.without("estimator")


def print_identifiability(console: Console, identifiability: Identifiability) -> None:
    """Print bounds by class and over time, inseparable coefficients and unobservable errors."""
    table = bounds_table(identifiability)
    console.print(narrowed(console, table, _DROPPED_OF_BOUNDS))
    print_texts(console, [*(encodable(console, note) for note in table.notes), *assessment_sentences(identifiability)])
    if identifiability.holding is not None:
        console.print(Text(holding_sentence(identifiability.holding)), soft_wrap=True)


def _estimate_tables(console: Console, evaluation: Evaluation, filters: list[str]) -> list[ScreenTable]:
    """Return the widest table that fits, or else one table for each filter; total standard deviations are kept."""
    full = estimates(evaluation, filters)
    shorter = estimates(_with_first_cause(evaluation), filters)
    headers = {column.header for column in full.columns}
    known = headers | ({_SECOND_CAUSE} if _CAUSES in headers else set())
    dropped = dict.fromkeys(tuple(name for name in names if name in known) for names in _DROPPED_OF_ESTIMATES)
    choices = [
        screen_table(
            console,
            (shorter if _SECOND_CAUSE in left_out else full).without(*left_out),
            unbroken=("symbol", "unit"),
            left_out=left_out,
        )
        for left_out in dropped
    ]
    chosen = next((choice for choice in choices if fits(console, choice)), choices[-1] if len(filters) == 1 else None)
    if chosen is not None:
        return [chosen]
    return [choice for name in filters for choice in _estimate_tables(console, evaluation, [name])]


def _with_first_cause(evaluation: Evaluation) -> Evaluation:
    """Return the results with only the largest cause of each total standard deviation."""
    rows = [row._replace(contributors=row.contributors.partition("; ")[0]) for row in evaluation.coefficients]
    return evaluation._replace(coefficients=rows)


def print_validation(console: Console, validation: Validation, passed: bool) -> None:
    """Print the errors next to those of the vehicle file, judgement, free run, fits, manoeuvres and checks.

    Parameters
    ----------
    passed : bool
        Whether checks that passed are printed as well.
    """
    print_texts(console, score_sentences(validation.scores))
    if validation.judgement.is_against:
        print_texts(console, judgement_sentences({validation.filter: validation.judgement}, with_sound=False))
    ahead = [row for row in validation.predictions if row.kind == AHEAD]
    free = [row for row in validation.predictions if row.kind == FREE_RUN]
    console.print(narrowed(console, _free_run(free), _DROPPED_OF_MODELS, _VALIDATION_DIGITS))
    if free:
        console.print(Text(_ERRORS))
        console.print()
    if ahead:
        console.print(screen_table(console, _fits_ahead(ahead), _VALIDATION_DIGITS))
        if any(row.share_within_band is not None for row in ahead):
            console.print(Text(_BAND))
    print_texts(console, [*_manoeuvres(validation.manoeuvres), *map(sentence, validation.remarks)])
    print_checks(console, validation.checks, passed)
    console.print(Text(f"The model of the {filter_label(validation.filter)} {validation.conclusion()}"))


def _free_run(rows: Sequence[Prediction]) -> Table:
    cells: dict[Column, Callable[[Prediction], Cell]] = {
        text_column("free run"): lambda row: row.signal,
        text_column("unit"): lambda row: degrees_for(row.unit)[1],
        Column("noise"): lambda row: _in_degrees(row.noise, row.unit),
        Column("fit %"): lambda row: row.fit_percent,
        Column("RMSE"): lambda row: _in_degrees(row.rmse, row.unit),
        Column("unchanged"): lambda row: _in_degrees(row.constant_velocity_rmse, row.unit),
        Column("prior"): lambda row: _in_degrees(row.prior_rmse, row.unit),
        Column("vehicle file"): lambda row: _in_degrees(row.vehicle_file_rmse, row.unit),
    }
    return tabulated("free-run", "Errors of the free run", rows, cells)


def _fits_ahead(rows: Sequence[Prediction]) -> Table:
    """Return the fit by signal and horizon, and the share of errors within the stated uncertainty."""
    horizons = list(dict.fromkeys(row.horizon_s for row in rows))
    columns = Column("fit % ahead", numeric=False), *(Column(f"{horizon:g} s") for horizon in horizons)
    fits = {(row.signal, row.horizon_s): row.fit_percent for row in rows}
    signals = dict.fromkeys(row.signal for row in rows)
    body: list[list[Cell]] = [[signal, *(fits.get((signal, horizon)) for horizon in horizons)] for signal in signals]
    within: list[Cell] = ["% within band"]
    for horizon in horizons:
        # Mean over all signals.
        shares = [r.share_within_band for r in rows if r.horizon_s == horizon and r.share_within_band is not None]
        within.append(100.0 * sum(shares) / len(shares) if shares else None)
    return Table("fits-ahead", "Fits ahead", columns, [*body, within])


def _manoeuvres(numbers: Sequence[ManoeuvreNumber]) -> list[str]:
    """Return a line for each kind of number, with the mean of those that repeat, as in a zigzag."""
    kinds: dict[tuple[str, str], list[ManoeuvreNumber]] = {}
    for number in numbers:
        kinds.setdefault((number.manoeuvre, number.number.rstrip(" 0123456789")), []).append(number)
    lines = []
    for (manoeuvre, kind), alike in kinds.items():
        unit = alike[0].unit
        predictions = [number.predicted for number in alike if number.predicted is not None]
        measured = _in_degrees(float(np.mean([number.measured for number in alike])), unit)
        predicted = _in_degrees(float(np.mean(predictions)), unit) if len(predictions) == len(alike) else None
        count = f" (mean of {len(alike)})" if len(alike) > 1 else ""
        what = f"{manoeuvre}, {kind}{count}" + ("" if unit == "1" else f" in {degrees_for(unit)[1]}")
        lines.append(f"{what}: measured {printed(measured)}, predicted {printed(predicted)}")
    return lines


def _in_degrees(value: float | None, unit: str) -> float | None:
    return None if value is None else degrees_for(unit)[0] * value
