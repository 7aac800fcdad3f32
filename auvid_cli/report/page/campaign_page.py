"""The page of a campaign: many runs, filter by filter."""

from collections.abc import Mapping, Sequence

import numpy as np

from auvid_cli.campaign.axes import CellErrors, errors_by_cell
from auvid_cli.campaign.summary import CampaignSummary
from auvid_cli.config.campaign import Campaign
from auvid_cli.report.campaign_tables import comparison_table, filters_table
from auvid_cli.report.page import parts
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
) -> parts.Page:
    """Lay out the statistics of a campaign.

    Parameters
    ----------
    filters : mapping of str
        Filter of each variant, by name of the variant.
    failures : sequence of str
        Why runs failed, each once.
    """
    failed = [parts.Words([f"Failed: {failure}" for failure in failures], listed=True)] if failures else []
    sections = (
        parts.Section("filters", "Filters", [parts.TablePart(filters_table(findings), sortable=True), *failed]),
        parts.Section("spread", "Spread of the errors", _spread(findings, filters)),
        parts.Section(
            "comparisons",
            "Filters against each other",
            [parts.TablePart(table, sortable=True) for table in comparison_table(findings)],
        ),
        campaign_provenance(campaign),
    )
    n_seeds = findings.runs["seed"].nunique()
    size = f"{len(findings.runs)} run{'s' * (len(findings.runs) > 1)}, {n_seeds} seed{'s' * (n_seeds > 1)}"
    return parts.Page(f"Campaign: {campaign.name}", size, sections)


def _spread(findings: CampaignSummary, filters: Mapping[str, str]) -> list[parts.Part]:
    """Draw the error of every run that ended, a row for each combination of settings and filter."""
    cells = errors_by_cell(findings.runs, findings.columns)
    known = np.concatenate([cell.errors for cell in cells])
    known = known[np.isfinite(known) & (known > 0.0)]
    if not known.size:
        return []
    low = float(np.floor(np.log10(known.min())))
    high = max(float(np.ceil(np.log10(min(known.max(), _MAX_ERROR)))), low + 1.0)
    across = parts.Axis(low, high, _LEFT, _WIDTH - 60.0)
    drawn = cells[:_MAX_ROWS]
    bottom = _TOP + _ROW * len(drawn)
    shapes = parts.decades(across, _TOP, bottom)
    for place, cell in enumerate(drawn):
        shapes += _row(_TOP + _ROW * (place + 0.5), cell, across, filters.get(cell.filter, "measured"))
    shapes.append(
        parts.TextLabel(0.5 * (across.begin + across.end), bottom + 36.0, "mean steady-state error (%)", "middle")
    )
    says = "A mark for each completed run, a long stroke at their median; at the right the share of runs that failed."
    if len(cells) > len(drawn):
        says += f" {len(cells) - len(drawn)} more combinations: see the table."
    return [parts.Picture("Errors", says, _WIDTH, bottom + 46.0, shapes)]


def _row(y: float, cell: CellErrors, across: parts.Axis, look: str) -> list[parts.Shape]:
    words = ", ".join([*map(setting_text, cell.key), cell.filter])
    shapes: list[parts.Shape] = [parts.TextLabel(_LEFT - 8.0, y + 4.0, words[-28:], "end")]
    places = np.clip(np.log10(np.maximum(cell.errors, 1e-12)), across.low, across.high)
    shapes += [
        parts.Dot(across.at(float(decade)), y, look, f"{cell.filter}: {error:.3g} %")
        for decade, error in zip(places, cell.errors, strict=True)
    ]
    if places.size:
        x = across.at(float(np.median(places)))
        shapes.append(parts.Rule(x, y - 9.0, x, y + 9.0, "axis"))
    if cell.lost:
        shapes.append(parts.TextLabel(across.end + 8.0, y + 4.0, f"{cell.lost:.0%} lost"))
    return shapes
