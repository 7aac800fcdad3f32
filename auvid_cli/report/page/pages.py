"""Pages of a run, of an inspection, of a fit, of a validation and of identifiability."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.accuracy import shares_of_prior
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.evaluation.results import CLASSES, CoefficientBound, Identifiability
from auvid_cli.fitting.results import Fit
from auvid_cli.inspection.inspection import Inspection
from auvid_cli.report.layout import estimate_table, lay_out
from auvid_cli.report.page import curves, parts, sections
from auvid_cli.report.page.coefficients import coefficient_list, convergence, estimate_plots, forest
from auvid_cli.report.page.render import symbol_parts
from auvid_cli.report.plot_data import HorizonPlot, bounds_plot, horizon_plots
from auvid_cli.report.screen import assessment_sentences, bounds_table, holding_sentence
from auvid_cli.report.sentences import (
    fit_sentences,
    measure_next_time,
    score_sentences,
    steps_tables,
    unexplained_sentences,
)
from auvid_cli.report.table import by_kind, filter_label, number
from auvid_cli.validation.results import Validation

INSEPARABLE = "Coefficients that cannot be separated"
# The table of bounds is in the list of coefficients.
_IN_THE_LIST = ("estimates", "bounds")
# Label and look of the errors that the model's own errors are compared with, by field.
_OTHERS = {
    "prior_rmse": ("prior", "prior"),
    "vehicle_file_rmse": ("vehicle file", "file"),
    "constant_velocity_rmse": ("motion unchanged", "still"),
    "expected_rmse": ("explained by the stated uncertainty", "expected"),
    "noise": ("noise of the sensor", "measured"),
}
# Looks of the classes, from sure to unknown.
_LOOKS = dict(zip((label for _, label in CLASSES), ("sure", "known", "rough", "lost"), strict=True))
_ROW = 20.0
_LEFT = 64.0
_WIDTH = 460.0
_TOP = 24.0


def run_page(
    dataset: Dataset, estimates: Sequence[Estimate], evaluation: Evaluation, checks: Sequence[Check]
) -> parts.Page:
    """Lay out all that is known of a run and its estimates.

    Parameters
    ----------
    estimates : sequence of Estimate
        The first is shown where only one estimate is shown at a time.
    """
    true = dataset.truth.coefficients if dataset.truth is not None else {}
    shares = {estimate.filter: shares_of_prior(estimate) for estimate in estimates}
    tables = [table for table in lay_out(evaluation) if table.key not in _IN_THE_LIST]
    listed: list[parts.Part] = []
    if evaluation.coefficients:
        listed = [*forest(evaluation), parts.TablePart(coefficient_list(evaluation, shares), sortable=True)]
    remarks = [parts.Words(evaluation.remarks, listed=True)] if evaluation.remarks else []
    content = (
        parts.Section("verdict", "Verdict", [*sections.judgement_parts(evaluation, checks), *remarks]),
        parts.Section("coefficients", "Coefficients", listed),
        parts.Section("convergence", "Convergence", _convergence(estimates, true)),
        parts.Section("correlation", INSEPARABLE, _run_correlation(estimates)),
        parts.Section("innovations", "Innovations", curves.innovation_parts(estimates)),
        parts.Section("course", "Inputs, sensors, residuals", curves.course_parts(dataset, evaluation.free_runs)),
        parts.Section("path", "Path", curves.path_parts(dataset.truth, estimates)),
        parts.Section("tables", "Tables", [parts.TablePart(table) for table in tables]),
        parts.Section("checks", "Checks", sections.check_parts(checks)),
        sections.provenance_section(dataset),
    )
    origin = "simulated, truth known" if dataset.truth is not None else "recorded, truth not known"
    vehicle = dataset.experiment.vehicle.name
    use = estimates[0].experiment.identification.use if estimates else None
    subtitle = f"{vehicle}, {sections.what_ran(dataset, use)}, sensors {', '.join(dataset.sensors)}; {origin}"
    return parts.Page(dataset.experiment.name, subtitle, content)


def _convergence(estimates: Sequence[Estimate], true: dict[str, float]) -> list[parts.Part]:
    over_time, distances = estimate_plots(estimates, true), convergence(estimates, true)
    reference = "true" if true else "final"
    content: list[parts.Part] = []
    if over_time.plots:
        line = "; the line is the true value" if true else ""
        content += [
            parts.Words([f"Estimate of each coefficient over time{line}. A batch estimate is constant."]),
            over_time,
        ]
    if distances.plots:
        content += [
            parts.Words([f"Distance of each estimate from the {reference} value, in percent of it."]),
            distances,
        ]
    return content


def _run_correlation(estimates: Sequence[Estimate]) -> list[parts.Part]:
    """Return the correlations of the estimate by which others are judged, or else of the first."""
    completed = sorted((e for e in estimates if e.completed), key=lambda estimate: not estimate.in_one_batch)
    return sections.correlation_of(completed[0]) if completed else []


def inspection_page(dataset: Dataset, inspection: Inspection) -> parts.Page:
    """Lay out the verdicts on data, and the data with their faults shaded."""
    begin, end = inspection.span
    content = (
        parts.Section("verdict", "Verdict", [_inspection_verdict(inspection)]),
        parts.Section("checks", "Checks", sections.check_parts(inspection.checks)),
        parts.Section("course", "Recorded data", _recorded(dataset, inspection)),
        sections.provenance_section(dataset),
    )
    subtitle = f"{dataset.experiment.vehicle.name}, {begin:.6g} to {end:.6g} s, sensors {', '.join(dataset.sensors)}"
    return parts.Page(f"Inspection: {dataset.experiment.name}", subtitle, content)


def _inspection_verdict(inspection: Inspection) -> parts.Cards:
    failed = inspection.checks.failed()
    noted = sum(check.passed is None for check in inspection.checks)
    says = "No check fails: these data can be used"
    says += f", and read the {noted} note{'s' * (noted > 1)} below." if noted else "."
    if failed:
        names = ", ".join(f"{check.check} of {check.subject}" for check in failed)
        says = f"Fix these first, or leave out bad times with --use BEGIN:END: {names}."
    counts = {"failed": str(len(failed)), "worth knowing": str(noted), "checks": str(len(inspection.checks))}
    return parts.Cards([parts.Card("These data", "input", "fails" if failed else "passes", says, counts)])


def _recorded(dataset: Dataset, inspection: Inspection) -> list[parts.Part]:
    marks: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for mark in inspection.marks:
        marks[mark.sensor].append((mark.start, mark.end))
    words = f"{curves.HOW_TO_LOOK} Shaded: spikes, jumps, stuck values, gaps and clocks that jump."
    plots = [*curves.input_plots(dataset.inputs), *curves.sensor_plots(dataset.sensors, {}, marks)]
    return [parts.Words([words]), parts.Plots(plots, linked="time", wide=True)]


def fit_page(dataset: Dataset, fit: Fit) -> parts.Page:
    """Lay out a found model: its judgement, the steps that led to it, and what it leaves unexplained."""
    words = (
        "Each look starts from one model. Its tests rank the candidates for an addition. The best candidates are "
        "fitted. The one with the largest gain is kept if the gain is clearly more than chance. The gain is the "
        "increase of the log-likelihood with the coefficients integrated out. For each added number without a prior, "
        "half the logarithm of the number of measurements is subtracted, because more numbers always fit better."
    )
    steps = [parts.TablePart(table, folded=k > 0) for k, table in enumerate(steps_tables(fit))]
    remains = [*unexplained_sentences(fit), *measure_next_time(fit)]
    coefficients = list[parts.Section]()
    if fit.estimate.completed:
        table = estimate_table(fit.estimate, fit.judgement)
        coefficients.append(parts.Section("coefficients", "Coefficients", [parts.TablePart(table)]))
    content = [
        parts.Section("verdict", "Verdict", [parts.Words(fit_sentences(fit), listed=True)]),
        *coefficients,
        parts.Section("steps", "How this model was found", [parts.Words([words]), *steps]),
        parts.Section("model", "Settings of the model", [parts.Listing("fit.yaml", fit.settings())]),
        sections.provenance_section(dataset),
    ]
    if remains:
        title = "Remaining errors, and advice for the next run"
        content.insert(-2, parts.Section("remains", title, [parts.Words(remains, listed=True)]))
    vehicle = dataset.experiment.vehicle.name
    subtitle = f"{vehicle}, {sections.what_ran(dataset)}, sensors {', '.join(dataset.sensors)}"
    return parts.Page(f"Fit: {dataset.experiment.name}", subtitle, tuple(content))


def validation_page(validation: Validation) -> parts.Page:
    """Lay out the predictions of a model next to those of the prior, and next to its own uncertainty."""
    tables = validation.tables()
    listed = {"validation": "Predictions", "manoeuvres": "Numbers of manoeuvres"}
    grids = [
        parts.TablePart(sections.table_of_rows(key, title, tables[key]), sortable=True)
        for key, title in listed.items()
        if tables[key].rows
    ]
    shown = validation.shown
    remarks = [parts.Words(validation.remarks, listed=True)] if validation.remarks else []
    content = (
        parts.Section("verdict", "Verdict", [_validation_verdict(validation), *remarks]),
        parts.Section("checks", "Checks", sections.check_parts(validation.checks)),
        parts.Section("horizons", "Errors by horizon", _horizons(validation)),
        parts.Section(
            "course", "Inputs, sensors, residuals", curves.course_parts(shown, {validation.filter: validation.run})
        ),
        parts.Section("tables", "Tables", grids),
        sections.provenance_section(shown),
    )
    title = f"Validation: {filter_label(validation.filter)} on {shown.experiment.name}"
    subtitle = f"{shown.experiment.vehicle.name}, {sections.what_ran(shown)}, data that the estimate has not seen"
    return parts.Page(title, subtitle, content)


def _validation_verdict(validation: Validation) -> parts.Cards:
    failed = validation.checks.failed()
    lines = [*score_sentences(validation.scores), f"The model {validation.conclusion()}"]
    says = " ".join([*lines, *dict.fromkeys(check.advice for check in failed)])
    counts = {"checks": str(len(validation.checks)), "failed": str(len(failed))}
    return parts.Cards(
        [
            parts.Card("Predictions", validation.filter, "fails" if failed else "passes", says, counts),
            sections.judgement_card(validation.filter, validation.judgement, {}),
        ]
    )


def _horizons(validation: Validation) -> list[parts.Part]:
    """Plot the error of each signal over the horizon, on logarithmic scales."""
    plots = [_horizon(validation.filter, plot) for plot in horizon_plots(validation.predictions) if plot.horizons.size]
    words = (
        "Root mean square error of predictions from many starts, by the time that they look ahead: of the model, and "
        "of what was known before. Errors below the noise of the sensor mean that its stated noise is too large, "
        "which is intended for an AHRS."
    )
    return [parts.Words([words]), parts.Plots(plots)] if plots else []


def _horizon(filter_name: str, plot: HorizonPlot) -> parts.Plot:
    # The model's own is drawn above the others.
    looks = _OTHERS | {"rmse": (filter_label(filter_name), filter_name)}
    errors = {field: np.where(plot.errors[field] > 0.0, plot.errors[field], np.nan) for field in looks}
    known = [
        parts.PlotLine(*looks[field], plot.horizons, values)
        for field, values in errors.items()
        if np.isfinite(values).any()
    ]
    last = ", ".join(f"{one.label} {number(one.values[-1], 3)}" for one in known if np.isfinite(one.values[-1]))
    says = f"Errors of {plot.quantity.symbol} after {plot.horizons[-1]:g} s, {plot.scale.unit}: {last}."
    return parts.Plot(plot.quantity.symbol, says, plot.scale.unit, known, "horizon (s)", True, True)


def identifiability_page(dataset: Dataset, identifiability: Identifiability, where: str) -> parts.Page:
    """Return the page of the bounds: by coefficient, over time, and inseparable coefficients.

    Parameters
    ----------
    where : str
        Name of the coefficients at which the bounds hold.
    """
    symbols = [bound.coefficient for bound in identifiability.bounds]
    holding = [] if identifiability.holding is None else [holding_sentence(identifiability.holding)]
    words = parts.Words([*assessment_sentences(identifiability), *holding], listed=True)
    correlation = []
    if np.isfinite(identifiability.correlation).any():
        title = "Correlations of the errors at the bound"
        correlation = sections.correlation_parts(title, symbols, identifiability.correlation)
    content = (
        parts.Section("verdict", "Verdict", [_verdict(identifiability), words]),
        parts.Section(
            "bounds", "Bounds", [*_bars(identifiability), parts.TablePart(bounds_table(identifiability), sortable=True)]
        ),
        parts.Section("duration", "Bounds over the duration", _growth(identifiability)),
        parts.Section("correlation", INSEPARABLE, correlation),
        sections.provenance_section(dataset),
    )
    subtitle = f"{dataset.experiment.vehicle.name}, at {where}"
    return parts.Page(f"Identifiability: {dataset.experiment.name}", subtitle, content)


def _verdict(identifiability: Identifiability) -> parts.Cards:
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
    return parts.Cards([parts.Card("These data", "input", grade, says, counts)])


def _bars(identifiability: Identifiability) -> list[parts.Picture]:
    """Draw bounds in percent of the value, by class, on a logarithmic scale; many in two pictures of the same scale."""
    percents = bounds_plot(identifiability).percents
    low = np.floor(np.log10(percents.min()))
    high = np.ceil(np.log10(max(percents.max(), 2.0 * CLASSES[-2][0])))
    across = parts.Axis(float(low), float(high), _LEFT, _WIDTH - 56.0)
    of = {bound.coefficient: (bound, percent) for bound, percent in zip(identifiability.bounds, percents, strict=True)}
    kinds = by_kind([*of])
    return [
        _bars_of(f"Bounds{kind and f', {kind}'}", [of[name] for name in names], across) for kind, names in kinds.items()
    ]


def _bars_of(title: str, bounds: Sequence[tuple[CoefficientBound, float]], across: parts.Axis) -> parts.Picture:
    bottom = _TOP + _ROW * len(bounds)
    shapes = parts.decades(across, _TOP, bottom)
    for place, (bound, percent) in enumerate(bounds):
        y = _TOP + _ROW * place
        letter, below = symbol_parts(bound.coefficient)
        end = across.at(float(np.log10(percent)))
        shapes.append(parts.TextLabel(_LEFT - 8.0, y + 14.0, letter, "end", below))
        shapes.append(parts.Box(_LEFT, y + 4.0, max(end - _LEFT, 1.0), _ROW - 8.0, _LOOKS[bound.label]))
        shapes.append(parts.TextLabel(end + 4.0, y + 14.0, f"{number(bound.percent, 2) or 'none'}"))
    for limit, _ in CLASSES[:-1]:
        x = across.at(float(np.log10(limit)))
        shapes.append(parts.Rule(x, _TOP, x, bottom, "axis"))
        shapes.append(parts.TextLabel(x, _TOP - 8.0, f"{limit:g} %", "middle"))
    shapes.append(parts.TextLabel(0.5 * (_LEFT + _WIDTH), bottom + 36.0, "bound, % of the value", "middle"))
    worst = max((bound for bound, _ in bounds), key=lambda bound: bound.percent)
    says = f"Least standard deviation that the data allow, in percent of the value. Worst: {worst.coefficient}."
    legend = [(look, label) for label, look in _LOOKS.items() if any(bound.label == label for bound, _ in bounds)]
    return parts.Picture(title, says, _WIDTH, bottom + 46.0, shapes, legend)


def _growth(identifiability: Identifiability) -> list[parts.Part]:
    """Plot how the bounds fall with the duration."""
    _, times, growth = bounds_plot(identifiability)
    if not np.isfinite(growth).any():
        return []
    lines = [
        parts.PlotLine(bound.coefficient, _LOOKS[bound.label], times, percents)
        for bound, percents in zip(identifiability.bounds, growth.T, strict=True)
    ]
    says = f"Bounds of all coefficients after {times[0]:.3g} to {times[-1]:.3g} s of these data."
    return [parts.Plots([parts.Plot("bounds", says, "% of the value", lines, "duration (s)", True, True)], wide=True)]
