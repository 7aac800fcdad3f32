"""Pages of a run, of an inspection, of a validation and of identifiability."""

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from auvid_cli.config.enums import JUDGE
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.accuracy import shares_of_prior
from auvid_cli.evaluation.estimate_checks import JUDGED
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.evaluation.judgement import Judgement
from auvid_cli.evaluation.results import CLASSES, CoefficientBound, Identifiability
from auvid_cli.inspection.inspection import Inspection
from auvid_cli.report.layout import NIS_MEANS, lay_out
from auvid_cli.report.page.coefficients import coefficient_list, convergence, estimate_plots, forest
from auvid_cli.report.page.curves import (
    HOW_TO_LOOK,
    course_parts,
    innovation_parts,
    input_plots,
    path_parts,
    sensor_plots,
)
from auvid_cli.report.page.parts import (
    Axis,
    Box,
    Card,
    Cards,
    Page,
    Part,
    Picture,
    Plot,
    PlotLine,
    Plots,
    Rule,
    Section,
    TablePart,
    TextLabel,
    Words,
    decades,
)
from auvid_cli.report.page.render import symbol_parts
from auvid_cli.report.page.sections import (
    correlation_of,
    correlation_parts,
    provenance_section,
    table_of_rows,
    what_ran,
)
from auvid_cli.report.plot_data import Scale, scale_of
from auvid_cli.report.screen import assessment_sentences, bounds_table, holding_sentence
from auvid_cli.report.shared_checks import Advice, advices, counts_in_words, shared_checks, whose
from auvid_cli.report.table import ERROR_DIGITS, Cell, Column, Table, by_kind, filter_label, number
from auvid_cli.text import sentence
from auvid_cli.validation.results import AHEAD, Prediction, Validation
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH

INSEPARABLE = "Coefficients that cannot be separated"
_VERDICTS = {True: "pass", False: "FAIL", None: "note"}
# Advice next to the cards; the list of checks has all of it.
_MAX_ADVICES = 6
# The table of bounds is in the list of coefficients.
_IN_THE_LIST = ("estimates", "bounds")
# Errors of what is compared, by field, with label and look; the model's own is a line of its filter.
_OTHERS = {
    "prior_rmse": ("prior", "prior"),
    "vehicle_file_rmse": ("vehicle file", "file"),
    "constant_velocity_rmse": ("motion unchanged", "still"),
    "expected_rmse": ("explained by the stated uncertainty", "expected"),
    "noise": ("noise of the sensor", "measured"),
}
# Looks of the classes, from sure to unknown.
_LOOKS = dict(zip((label for _, label in CLASSES), ("sure", "known", "rough", "lost"), strict=True))
# Percent: a bar without bound, or beyond it, is so long, and says what it is.
_MAX_PERCENT = 1e4
_ROW = 20.0
_LEFT = 64.0
_WIDTH = 460.0
_TOP = 24.0


def judgement_parts(evaluation: Evaluation, checks: Sequence[Check]) -> list[Part]:
    """Return a card with judgement and main numbers for each filter, and the advice of the checks.

    A verdict is one sentence with what to do.
    """
    judgements = evaluation.judgements()
    shared = shared_checks(check for check in checks if check.check != JUDGED)
    cards = []
    for row in evaluation.summary:
        numbers: dict[str, str | None] = {}
        if row.average_steady_state_error_percent is not None:
            error = number(row.average_steady_state_error_percent, ERROR_DIGITS + 1)
            numbers["average error"] = error and f"{error} %"
        for each in evaluation.consistency:
            if each.filter == row.filter:
                numbers[f"NIS of {each.sensor}"] = number(each.mean_nis, ERROR_DIGITS)
        numbers["processor time"] = f"{row.cpu_time_s:.2g} s"
        own = [each.check.passed for each in shared if row.filter in each.filters]
        shown = {name: text for name, text in numbers.items() if text}
        cards.append(judgement_card(row.filter, judgements[row.filter], shown, own.count(False), own.count(None)))
    names = [row.filter for row in evaluation.summary]
    sentences = [_in_words(advice, names) for advice in advices(shared)]
    if len(sentences) > _MAX_ADVICES:
        sentences[_MAX_ADVICES:] = [f"{len(sentences) - _MAX_ADVICES} more are in the list of checks below."]
    says: list[Part] = [Words(sentences, listed=True)] if sentences else []
    return [Cards(cards), *says, Words([NIS_MEANS])]


def judgement_card(
    filter_name: str, judgement: Judgement, numbers: dict[str, str], failed: int = 0, noted: int = 0
) -> Card:
    """Return the verdict on one filter, given how many checks failed or are worth knowing."""
    label = filter_label(filter_name)
    if judgement.advice:
        says = sentence(judgement.advice)
    elif failed:
        says = f"Judged sound, but {failed} check{'s' * (failed > 1)} failed: follow the advice below first."
    elif noted:
        says = f"Use the estimate, and read the {noted} note{'s' * (noted > 1)} of its checks below."
    else:
        says = "Use the estimate."
    return Card(label, filter_name, str(judgement.grade), says, numbers)


def _in_words(advice: Advice, names: Sequence[str]) -> str:
    """Return a failed or noted check, its estimators and the advice in one sentence."""
    found = f": {advice.shared[0].check.statistic}" if len(advice.shared) == 1 else ""
    verb = "Failed" if advice.failed else "Note"
    of = whose(advice.filters, names)
    return f"{verb} for {'all filters' if of == 'all' else of}: {advice.what}{found}. {advice.text}"


def check_parts(checks: Iterable[Check]) -> list[Part]:
    """Return the checks as tables: those that did not pass with their advice, and those that passed."""
    ordered = list(checks)
    if not ordered:
        return []
    names = list(dict.fromkeys(check.filter for check in ordered))
    filters = any(names)
    headers = ("verdict", *(["estimator"] if filters else []), "of", "check", "found", "allowed", "what to do")

    def row(check: Check, of: Sequence[str]) -> list[Cell]:
        return [
            _VERDICTS[check.passed],
            *([whose(of, names)] if filters else []),
            *(check.subject, check.check, check.statistic, check.threshold, check.advice),
        ]

    shared = [row(each.check, each.filters) for each in shared_checks(ordered)]
    passed = [row(check, [check.filter])[:-1] for check in ordered if check.passed]
    columns = tuple(Column(header, numeric=False) for header in headers)
    parts: list[Part] = [Words([f"{counted}." for counted in counts_in_words(ordered)])]
    if shared:
        notes = (
            ("Column found: value of the smoother, if it is in the row.",) if JUDGE in names and len(names) > 1 else ()
        )
        parts.append(
            TablePart(Table("noteworthy", "Failed or worth knowing", columns, shared, notes=notes), sortable=True)
        )
    if passed:
        table = Table("passed", f"Passed: {len(passed)}", columns[:-1], passed)
        parts.append(TablePart(table, sortable=True, folded=True))
    return parts


def run_page(dataset: Dataset, estimates: Sequence[Estimate], evaluation: Evaluation, checks: Sequence[Check]) -> Page:
    """Lay out all that is known of a run and its estimates.

    Parameters
    ----------
    estimates : sequence of Estimate
        The first is shown where only one estimate is shown at a time.
    """
    true = dataset.truth.coefficients if dataset.truth is not None else {}
    shares = {estimate.filter: shares_of_prior(estimate) for estimate in estimates}
    tables = [table for table in lay_out(evaluation) if table.key not in _IN_THE_LIST]
    listed: list[Part] = []
    if evaluation.coefficients:
        listed = [*forest(evaluation), TablePart(coefficient_list(evaluation, shares), sortable=True)]
    remarks = [Words(evaluation.remarks, listed=True)] if evaluation.remarks else []
    sections = (
        Section("verdict", "Verdict", [*judgement_parts(evaluation, checks), *remarks]),
        Section("coefficients", "Coefficients", listed),
        Section("convergence", "Convergence", _convergence(estimates, true)),
        Section("correlation", INSEPARABLE, _run_correlation(estimates)),
        Section("innovations", "Innovations", innovation_parts(estimates)),
        Section("course", "Inputs, sensors, residuals", course_parts(dataset, evaluation.free_runs)),
        Section("path", "Path", path_parts(dataset.truth, estimates)),
        Section("tables", "Tables", [TablePart(table) for table in tables]),
        Section("checks", "Checks", check_parts(checks)),
        provenance_section(dataset),
    )
    return Page(dataset.experiment.name, _subtitle(dataset), sections)


def _convergence(estimates: Sequence[Estimate], true: dict[str, float]) -> list[Part]:
    over_time, distances = estimate_plots(estimates, true), convergence(estimates, true)
    reference = "true" if true else "final"
    parts: list[Part] = []
    if over_time.plots:
        line = "; the line is the true value" if true else ""
        parts += [Words([f"Estimate of each coefficient over time{line}. A batch estimate is constant."]), over_time]
    if distances.plots:
        parts += [Words([f"Distance of each estimate from the {reference} value, in per cent of it."]), distances]
    return parts


def _run_correlation(estimates: Sequence[Estimate]) -> list[Part]:
    """Return the correlations of the estimate by which others are judged, or else of the first."""
    reference = next((e for e in estimates if e.in_one_batch and e.completed), None)
    first = next((e for e in estimates if e.completed), None)
    chosen = reference or first
    return [] if chosen is None else correlation_of(chosen)


def _subtitle(dataset: Dataset) -> str:
    origin = "simulated, truth known" if dataset.truth is not None else "recorded, truth not known"
    return f"{dataset.experiment.vehicle.name}, {what_ran(dataset)}, sensors {', '.join(dataset.sensors)}; {origin}"


def inspection_page(dataset: Dataset, inspection: Inspection) -> Page:
    """Lay out the verdicts on data, and the data themselves, shaded where something is the matter."""
    begin, end = inspection.span
    sections = (
        Section("verdict", "Verdict", [_inspection_verdict(inspection)]),
        Section("checks", "Checks", check_parts(inspection.checks)),
        Section("course", "Recorded data", _recorded(dataset, inspection)),
        provenance_section(dataset),
    )
    subtitle = f"{dataset.experiment.vehicle.name}, {begin:.6g} to {end:.6g} s, sensors {', '.join(dataset.sensors)}"
    return Page(f"Inspection: {dataset.experiment.name}", subtitle, sections)


def _inspection_verdict(inspection: Inspection) -> Cards:
    failed = inspection.checks.failed()
    noted = sum(check.passed is None for check in inspection.checks)
    says = "No check fails: these data can be used"
    says += f", and read the {noted} note{'s' * (noted > 1)} below." if noted else "."
    if failed:
        names = ", ".join(f"{check.check} of {check.subject}" for check in failed)
        says = f"Fix these first, or leave out bad times with --use BEGIN:END: {names}."
    counts = {"failed": str(len(failed)), "worth knowing": str(noted), "checks": str(len(inspection.checks))}
    return Cards([Card("These data", "input", "fails" if failed else "passes", says, counts)])


def _recorded(dataset: Dataset, inspection: Inspection) -> list[Part]:
    marks: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for mark in inspection.marks:
        marks[mark.sensor].append((mark.start, mark.end))
    words = f"{HOW_TO_LOOK} Shaded: spikes, jumps, stuck values, gaps and clocks that jump."
    plots = [*input_plots(dataset.inputs), *sensor_plots(dataset.sensors, {}, marks)]
    return [Words([words]), Plots(plots, linked="time", wide=True)]


def validation_page(validation: Validation) -> Page:
    """Lay out the predictions of a model next to those of the prior, and next to its own uncertainty."""
    tables = validation.tables()
    listed = {"validation": "Predictions", "manoeuvres": "Numbers of manoeuvres"}
    grids = [
        TablePart(table_of_rows(key, title, tables[key]), sortable=True)
        for key, title in listed.items()
        if tables[key].rows
    ]
    shown = validation.shown
    remarks = [Words(validation.remarks, listed=True)] if validation.remarks else []
    sections = (
        Section("verdict", "Verdict", [_validation_verdict(validation), *remarks]),
        Section("checks", "Checks", check_parts(validation.checks)),
        Section("horizons", "Errors by horizon", _horizons(validation)),
        Section("course", "Inputs, sensors, residuals", course_parts(shown, {validation.filter: validation.run})),
        Section("tables", "Tables", grids),
        provenance_section(shown),
    )
    title = f"Validation: {filter_label(validation.filter)} on {shown.experiment.name}"
    subtitle = f"{shown.experiment.vehicle.name}, {what_ran(shown)}, data that the estimate has not seen"
    return Page(title, subtitle, sections)


def _validation_verdict(validation: Validation) -> Cards:
    failed = validation.checks.failed()
    says = "The model predicts these data as well as it says."
    if failed:
        says = " ".join(check.advice for check in failed)
    counts = {"checks": str(len(validation.checks)), "failed": str(len(failed))}
    return Cards(
        [
            Card("Predictions", validation.filter, "fails" if failed else "passes", says, counts),
            judgement_card(validation.filter, validation.judgement, {}),
        ]
    )


def _horizons(validation: Validation) -> list[Part]:
    """Plot the error of each signal over the horizon, on logarithmic scales."""
    plots = []
    for quantity in MOTION_AND_DEPTH:
        rows = [row for row in validation.predictions if row.kind == AHEAD and row.signal == quantity.symbol]
        if rows:
            plots.append(_horizon(validation.filter, quantity.symbol, rows, scale_of(quantity)))
    words = (
        "Root mean square error of predictions from many starts, over the time that they look ahead, for the model and "
        "for what was known before. Errors below the noise of the sensor mean that its stated noise is too large, "
        "which is intended for an AHRS."
    )
    return [Words([words]), Plots(plots)] if plots else []


def _horizon(filter_name: str, symbol: str, rows: Sequence[Prediction], scale: Scale) -> Plot:
    horizons = np.array([row.horizon_s for row in rows])

    def line(field: str, label: str, look: str) -> PlotLine:
        values = [getattr(row, field) for row in rows]
        errors = np.array([np.nan if value is None else scale.factor * value for value in values])
        return PlotLine(label, look, horizons, np.where(errors > 0.0, errors, np.nan))

    lines = [line(field, label, look) for field, (label, look) in _OTHERS.items()]
    # The model's own is drawn above the others.
    lines.append(line("rmse", filter_label(filter_name), filter_name))
    known = [one for one in lines if np.isfinite(one.values).any()]
    last = ", ".join(f"{one.label} {number(one.values[-1], 3)}" for one in known if np.isfinite(one.values[-1]))
    says = f"Errors of {symbol} after {horizons[-1]:g} s, {scale.unit}: {last}."
    return Plot(symbol, says, scale.unit, known, "horizon (s)", True, True)


def identifiability_page(dataset: Dataset, identifiability: Identifiability, where: str) -> Page:
    """Return the page of the bounds: by coefficient, over time, and inseparable coefficients.

    Parameters
    ----------
    where : str
        Name of the coefficients at which the bounds hold.
    """
    symbols = [bound.coefficient for bound in identifiability.bounds]
    sections = (
        Section("verdict", "Verdict", [_verdict(identifiability), *_words(identifiability)]),
        Section("bounds", "Bounds", [*_bars(identifiability), TablePart(bounds_table(identifiability), sortable=True)]),
        Section("duration", "Bounds over the duration", _growth(identifiability)),
        Section(
            "correlation",
            "Coefficients that cannot be separated",
            _identifiability_correlation(symbols, identifiability),
        ),
        provenance_section(dataset),
    )
    return Page(
        f"Identifiability: {dataset.experiment.name}", f"{dataset.experiment.vehicle.name}, at {where}", sections
    )


def _verdict(identifiability: Identifiability) -> Cards:
    """Count the coefficients by class, with advice on those that are not identified."""
    classes = [bound.label for bound in identifiability.bounds]
    lost = [bound.coefficient for bound in identifiability.bounds if bound.label == CLASSES[-1][1]]
    says = (
        f"These data do not determine {', '.join(lost)}: fix these at known values, or use another manoeuvre."
        if lost
        else "These data determine every coefficient to 20 % or better."
    )
    grade = "fails" if len(lost) == len(classes) else "doubtful" if lost else "passes"
    counts = {label: str(classes.count(label)) for _, label in CLASSES if label in classes}
    return Cards([Card("These data", "input", grade, says, counts)])


def _words(identifiability: Identifiability) -> list[Part]:
    holding = [] if identifiability.holding is None else [holding_sentence(identifiability.holding)]
    return [Words([*assessment_sentences(identifiability), *holding], listed=True)]


def _identifiability_correlation(symbols: list[str], identifiability: Identifiability) -> list[Part]:
    if not np.isfinite(identifiability.correlation).any():
        return []
    return correlation_parts("Correlations of the errors at the bound", symbols, identifiability.correlation)


def _bars(identifiability: Identifiability) -> list[Picture]:
    """Draw bounds in percent of the value, by class, on a logarithmic scale; many in two pictures of the same scale."""
    percents = [min(bound.percent, _MAX_PERCENT) for bound in identifiability.bounds]
    low = np.floor(np.log10(max(min(percents), 1e-4)))
    high = np.ceil(np.log10(max(max(percents), 2.0 * CLASSES[-2][0])))
    across = Axis(float(low), float(high), _LEFT, _WIDTH - 56.0)
    of = {bound.coefficient: bound for bound in identifiability.bounds}
    kinds = by_kind([*of])
    return [
        _bars_of(f"Bounds{kind and f', {kind}'}", [of[name] for name in names], across) for kind, names in kinds.items()
    ]


def _bars_of(title: str, bounds: Sequence[CoefficientBound], across: Axis) -> Picture:
    bottom = _TOP + _ROW * len(bounds)
    shapes = decades(across, _TOP, bottom)
    for place, bound in enumerate(bounds):
        percent = min(bound.percent, _MAX_PERCENT)
        y = _TOP + _ROW * place
        letter, below = symbol_parts(bound.coefficient)
        end = across.at(float(np.log10(max(percent, 1e-4))))
        shapes.append(TextLabel(_LEFT - 8.0, y + 14.0, letter, "end", below))
        shapes.append(Box(_LEFT, y + 4.0, max(end - _LEFT, 1.0), _ROW - 8.0, _LOOKS[bound.label]))
        shapes.append(TextLabel(end + 4.0, y + 14.0, f"{number(bound.percent, 2) or 'none'}"))
    for limit, _ in CLASSES[:-1]:
        x = across.at(float(np.log10(limit)))
        shapes.append(Rule(x, _TOP, x, bottom, "axis"))
        shapes.append(TextLabel(x, _TOP - 8.0, f"{limit:g} %", "middle"))
    shapes.append(TextLabel(0.5 * (_LEFT + _WIDTH), bottom + 36.0, "bound, % of the value", "middle"))
    worst = max(bounds, key=lambda bound: bound.percent)
    says = f"Least standard deviation that the data allow, in percent of the value. Worst: {worst.coefficient}."
    legend = [(look, label) for label, look in _LOOKS.items() if any(b.label == label for b in bounds)]
    return Picture(title, says, _WIDTH, bottom + 46.0, shapes, legend)


def _growth(identifiability: Identifiability) -> list[Part]:
    """Plot how the bounds fall with the duration."""
    times = np.array([time for time, _ in identifiability.growth])
    percents = np.array([percent for _, percent in identifiability.growth])
    percents = np.where((percents > 0.0) & (percents < _MAX_PERCENT), percents, np.nan)
    lines = [
        PlotLine(bound.coefficient, _LOOKS[bound.label], times, percents[:, k])
        for k, bound in enumerate(identifiability.bounds)
    ]
    if not np.isfinite(percents).any():
        return []
    says = f"Bounds of all coefficients after {times[0]:.3g} to {times[-1]:.3g} s of these data."
    return [Plots([Plot("bounds", says, "% of the value", lines, "duration (s)", True, True)], wide=True)]
