"""The page of a model on data that it has not seen."""

from collections.abc import Sequence

import numpy as np

from auvid_cli.report.notation import filter_label
from auvid_cli.report.page.course import course_parts
from auvid_cli.report.page.parts import Card, Cards, Page, Part, Plot, PlotLine, Plots, Section, TablePart, Words
from auvid_cli.report.page.provenance import provenance_section, what_ran
from auvid_cli.report.page.rows import table_of_rows
from auvid_cli.report.page.verdicts import check_parts, judgement_card
from auvid_cli.report.scales import Scale, scale_of
from auvid_cli.report.table import number
from auvid_cli.validation.results import AHEAD, Prediction, Validation
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH

# Errors of what is compared, by field, with label and look; the model's own is a line of its filter.
_OTHERS = {
    "prior_rmse": ("prior", "prior"),
    "vehicle_file_rmse": ("vehicle file", "file"),
    "constant_velocity_rmse": ("motion unchanged", "still"),
    "expected_rmse": ("explained by the stated uncertainty", "expected"),
    "noise": ("noise of the sensor", "measured"),
}


def validation_page(validation: Validation) -> Page:
    """Lay out how well a model predicts, beside what knows less, and beside what it says of itself."""
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
        Section("verdict", "Verdict", [_verdict(validation), *remarks]),
        Section("checks", "Checks", check_parts(validation.checks)),
        Section("horizons", "Errors by horizon", _horizons(validation)),
        Section("course", "Inputs, sensors, residuals", course_parts(shown, {validation.filter: validation.run})),
        Section("tables", "Tables", grids),
        provenance_section(shown),
    )
    title = f"Validation: {filter_label(validation.filter)} on {shown.experiment.name}"
    subtitle = f"{shown.experiment.vehicle.name}, {what_ran(shown)}, data that the estimate has not seen"
    return Page(title, subtitle, sections)


def _verdict(validation: Validation) -> Cards:
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
        "Root mean square error of predictions from many starts, over how far they look ahead: of the model, and of "
        "what there was before. Errors below the noise of the sensor say that more noise is stated than there is, as "
        "it is on purpose of an AHRS."
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
