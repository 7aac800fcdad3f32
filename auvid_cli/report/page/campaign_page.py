"""The page of a campaign: many runs, filter by filter."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from auvid_cli.campaign.axes import ended
from auvid_cli.campaign.summary import CampaignSummary
from auvid_cli.config.campaign import Campaign
from auvid_cli.report.campaign_tables import comparison_table, filters_table
from auvid_cli.report.page.parts import (
    Axis,
    Dot,
    Page,
    Part,
    Picture,
    Rule,
    Section,
    Shape,
    TablePart,
    TextLabel,
    Words,
    decades,
)
from auvid_cli.report.page.sections import campaign_provenance
from auvid_cli.report.table import setting_text

_ROW = 22.0
_LEFT = 170.0
_WIDTH = 560.0
_TOP = 12.0
_MAX_ROWS = 24  # combinations that are drawn
_MAX_ERROR = 1e3  # %, larger errors are drawn at the edge


def campaign_page(
    campaign: Campaign, findings: CampaignSummary, filters: Mapping[str, str], failures: Sequence[str]
) -> Page:
    """Lay out the statistics of a campaign.

    Parameters
    ----------
    filters : mapping of str
        Filter of each variant, by name of the variant.
    failures : sequence of str
        Why runs failed, each once.
    """
    failed = [Words([f"Failed: {failure}" for failure in failures], listed=True)] if failures else []
    sections = (
        Section("filters", "Filters", [TablePart(filters_table(findings), sortable=True), *failed]),
        Section("spread", "Spread of the errors", _spread(findings, filters)),
        Section(
            "comparisons",
            "Filters against each other",
            [TablePart(table, sortable=True) for table in comparison_table(findings)],
        ),
        campaign_provenance(campaign),
    )
    n_seeds = findings.runs["seed"].nunique()
    size = f"{len(findings.runs)} run{'s' * (len(findings.runs) > 1)}, {n_seeds} seed{'s' * (n_seeds > 1)}"
    return Page(f"Campaign: {campaign.name}", size, sections)


def _spread(findings: CampaignSummary, filters: Mapping[str, str]) -> list[Part]:
    """Draw the error of every run that ended, a row for each combination of settings and filter."""
    keys = [*findings.columns, "filter"]
    cells = [(key, runs) for key, runs in findings.runs.groupby(keys, sort=False)]
    errors = findings.runs["steady_state_error_percent"].to_numpy(np.float64)
    known = errors[np.isfinite(errors) & (errors > 0.0)]
    if not known.size:
        return []
    low = float(np.floor(np.log10(known.min())))
    high = max(float(np.ceil(np.log10(min(known.max(), _MAX_ERROR)))), low + 1.0)
    across = Axis(low, high, _LEFT, _WIDTH - 60.0)
    drawn = cells[:_MAX_ROWS]
    bottom = _TOP + _ROW * len(drawn)
    shapes = decades(across, _TOP, bottom)
    for place, (key, runs) in enumerate(drawn):
        values = key if isinstance(key, tuple) else (key,)
        shapes += _row(_TOP + _ROW * (place + 0.5), [setting_text(value) for value in values], runs, across, filters)
    shapes.append(TextLabel(0.5 * (across.begin + across.end), bottom + 36.0, "mean steady-state error (%)", "middle"))
    says = "A mark for each completed run, a long stroke at their median; at the right the share of runs that failed."
    if len(cells) > len(drawn):
        says += f" {len(cells) - len(drawn)} more combinations: see the table."
    return [Picture("Errors", says, _WIDTH, bottom + 46.0, shapes)]


def _row(y: float, words: list[str], runs: pd.DataFrame, across: Axis, filters: Mapping[str, str]) -> list[Shape]:
    name = words[-1]
    look = filters.get(name, "measured")
    shapes: list[Shape] = [TextLabel(_LEFT - 8.0, y + 4.0, ", ".join(words)[-28:], "end")]
    errors = runs["steady_state_error_percent"].dropna().to_numpy(np.float64)
    decades = np.clip(np.log10(np.maximum(errors, 1e-12)), across.low, across.high)
    shapes += [
        Dot(across.at(float(decade)), y, look, f"{name}: {error:.3g} %")
        for decade, error in zip(decades, errors, strict=True)
    ]
    if decades.size:
        x = across.at(float(np.median(decades)))
        shapes.append(Rule(x, y - 9.0, x, y + 9.0, "axis"))
    lost = 1.0 - float(ended(runs).mean())
    if lost:
        shapes.append(TextLabel(across.end + 8.0, y + 4.0, f"{lost:.0%} lost"))
    return shapes
