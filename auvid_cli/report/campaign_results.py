"""Results of a campaign as files, on the screen and as a page."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.text import Text

from auvid_cli.campaign.measures import CellErrors, errors_by_cell
from auvid_cli.campaign.summary import CampaignSummary
from auvid_cli.config.campaign import Campaign
from auvid_cli.data.checks import csv_cell
from auvid_cli.data.files import write_text
from auvid_cli.report.page import parts
from auvid_cli.report.page.sections import campaign_provenance
from auvid_cli.report.plot_data import MAX_ERROR
from auvid_cli.report.screen import print_files
from auvid_cli.report.table import Cell, Column, Table, number, setting_text, tabulated, text_column
from auvid_cli.report.text_tables import narrowed, print_texts, render_markdown

_MAX_ROWS = 40  # on the screen; the files have all
_SCREEN_DIGITS = 3
# Columns left out on a narrow terminal, in this order.
_DROPPED_COLUMNS = "by chance", "error / bound", "5 - 95 %", "sd / bound", "in 2 sd %", "NEES", "runs"
# Meaning of each heading that needs one.
_MEANINGS = {
    "inconsistent %": "Inconsistent: share of the runs with prediction errors much larger than the filter expects.",
    "sound %": "Sound: share of the runs whose estimate may be used.",
    "error %": "Error: mean steady-state error of the coefficients, median over the runs that did not fail or diverge.",
    "5 - 95 %": "5 - 95 %: nine of ten runs have an error within it.",
    "in 2 sd %": "In 2 sd: share of coefficients whose true value is within two standard deviations (corrected ones of "
    "batch estimates); 95.4 if these are right.",
    "sd / bound": "sd / bound: median ratio of the standard deviation, from the data alone, to the Cramer-Rao bound.",
    "error / bound": "Error / bound: root mean square of the errors divided by the bound.",
    "NEES": "NEES: squared error / covariance for each coefficient; 1 if the covariance is right.",
    "by chance": "By chance: range of NEES in 95 % of the cases in which the covariance is right.",
}
_WHAT = {"steady_state_error_percent": "steady-state error", "rmse_percent": "RMSE"}
_Record = Mapping[Hashable, Any]
_ROW = 22.0
_LEFT = 170.0
_WIDTH = 560.0
_TOP = 12.0
_MAX_DRAWN = 24  # combinations that are drawn


def write_summary(summary: CampaignSummary, folder: Path) -> list[Path]:
    """Write ``runs.csv``, ``filters.csv``, ``coefficients.csv``, ``comparisons.csv`` and ``campaign.md``.

    Raises
    ------
    FileError
        If a file cannot be written; an existing file then stays as it was.
    """
    tables = {
        "runs": summary.runs,
        "filters": summary.filters,
        "coefficients": summary.coefficients,
        "comparisons": summary.comparisons.rename(columns={"conclusion": "verdict"}),
    }
    paths = [folder / f"{name}.csv" for name in tables]
    for path, table in zip(paths, tables.values(), strict=True):
        write_text(path, table.map(csv_cell).rename(columns=csv_cell).to_csv(index=False))
    markdown = folder / "campaign.md"
    write_text(markdown, render_markdown([filters_table(summary), *comparison_table(summary)]))
    return [*paths, markdown]


def print_summary(console: Console, summary: CampaignSummary, files: Sequence[Path]) -> None:
    """Print a row for each combination of settings and filter, who is better in how many, and where the files are."""
    if len(summary.filters) <= _MAX_ROWS:
        table = filters_table(summary)
        if not any(summary.filters["failed"]):
            table = table.without("failed %")
        screen = narrowed(console, table, _DROPPED_COLUMNS, _SCREEN_DIGITS)
        console.print(screen)
        shown = {str(column.header) for column in screen.columns}
        print_texts(console, (text for header, text in _MEANINGS.items() if header in shown))
    else:
        console.print(Text(f"{len(summary.filters)} combinations of settings and filter: see the tables"))
    print_texts(console, comparison_sentences(summary))
    print_files(console, files)


def comparison_sentences(summary: CampaignSummary) -> list[str]:
    """Return, for each pair of filters and measure, in how many settings each conclusion holds."""
    sentences = []
    if not len(summary.comparisons):
        return sentences
    for (first, second, measure), rows in summary.comparisons.groupby(["first", "second", "measure"], sort=False):
        counts = rows["conclusion"].value_counts()
        conclusions = ", ".join(f"{conclusion} in {count}" for conclusion, count in counts.items())
        if len(rows) == 1:
            conclusions = str(counts.index[0])
        else:
            conclusions += f" (of {len(rows)} settings)"
        sentences.append(f"{first} and {second}, {_WHAT[str(measure)]}: {conclusions}")
    return sentences


def filters_table(summary: CampaignSummary) -> Table:
    """Lay out the statistics of each combination of settings and filter."""
    cells = _settings([*summary.columns, "filter"]) | {
        Column("runs"): lambda row: int(row["runs"]),
        Column("failed %"): lambda row: 100.0 * row["failed"],
        Column("diverged %"): lambda row: 100.0 * row["diverged"],
        Column("inconsistent %"): lambda row: 100.0 * row["inconsistent"],
        Column("sound %"): lambda row: 100.0 * row["sound"],
        Column("error %"): lambda row: row["steady_state_error_percent"],
        Column("5 - 95 %"): lambda row: _interval(row, "steady_state_error_percent"),
        Column("in 2 sd %"): lambda row: 100.0 * row["within_two_sigma"],
        Column("sd / bound"): lambda row: row["times_bound"],
        Column("error / bound"): lambda row: row["error_times_bound"],
        Column("NEES"): lambda row: row["nees"],
        Column("by chance"): lambda row: _interval(row, "nees"),
    }
    notes = tuple(text for header, text in _MEANINGS.items() if Column(header) in cells)
    return tabulated("campaign", "Filters", summary.filters.to_dict("records"), cells, notes)


def comparison_table(summary: CampaignSummary) -> list[Table]:
    """Compare the filters in a table; in none if there is but one filter."""
    if not len(summary.comparisons):
        return []
    cells = _settings([*summary.columns, "first", "second"]) | {
        text_column("measure"): lambda row: _WHAT[row["measure"]],
        Column("of first %"): lambda row: row["median_first"],
        Column("of second %"): lambda row: row["median_second"],
        Column("difference"): lambda row: row["difference"],
        Column("95 %"): lambda row: _interval(row, "difference"),
        Column("p, adjusted"): lambda row: row["p_value_adjusted"],
        Column("seeds"): lambda row: int(row["seeds"]),
        text_column("conclusion"): lambda row: row["conclusion"],
    }
    notes = (
        *comparison_sentences(summary),
        "On the same data, seed by seed: median of the difference, first minus second, with its 95 % interval; "
        "Wilcoxon's p-value, adjusted for the number of comparisons (Benjamini and Hochberg). A tie: the whole "
        "interval lies within 1 % of the error itself.",
    )
    return [
        tabulated("comparisons", "Filters against each other", summary.comparisons.to_dict("records"), cells, notes)
    ]


def _settings(columns: Sequence[str]) -> dict[Column, Callable[[_Record], Cell]]:
    """Return columns of settings; their headings are the last two keys."""
    return {
        text_column(".".join(column.split(".")[-2:])): lambda row, column=column: setting_text(row[column])
        for column in columns
    }


def _interval(row: _Record, name: str) -> str | None:
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    return f"{number(low, 3)} to {number(high, 3)}" if isfinite(low) and isfinite(high) else None


def campaign_page(
    campaign: Campaign, summary: CampaignSummary, filters: Mapping[str, str], failures: Sequence[str]
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
        parts.Section("filters", "Filters", [parts.TablePart(filters_table(summary), sortable=True), *failed]),
        parts.Section("spread", "Spread of the errors", _spread(summary, filters)),
        parts.Section(
            "comparisons",
            "Filters against each other",
            [parts.TablePart(table, sortable=True) for table in comparison_table(summary)],
        ),
        campaign_provenance(campaign),
    )
    n_seeds = summary.runs["seed"].nunique()
    size = f"{len(summary.runs)} run{'s' * (len(summary.runs) > 1)}, {n_seeds} seed{'s' * (n_seeds > 1)}"
    return parts.Page(f"Campaign: {campaign.name}", size, sections)


def _spread(summary: CampaignSummary, filters: Mapping[str, str]) -> list[parts.Part]:
    """Draw the error of every run that ended, a row for each combination of settings and filter."""
    cells = errors_by_cell(summary.runs, summary.columns)
    known = np.concatenate([cell.errors for cell in cells])
    known = known[np.isfinite(known) & (known > 0.0)]
    if not known.size:
        return []
    low = float(np.floor(np.log10(known.min())))
    high = max(float(np.ceil(np.log10(min(known.max(), MAX_ERROR)))), low + 1.0)
    across = parts.Axis(low, high, _LEFT, _WIDTH - 80.0)
    drawn = cells[:_MAX_DRAWN]
    bottom = _TOP + _ROW * len(drawn)
    shapes = parts.decades(across, _TOP, bottom)
    for place, cell in enumerate(drawn):
        shapes += _row(_TOP + _ROW * (place + 0.5), cell, across, filters.get(cell.filter, "measured"))
    shapes.append(
        parts.TextLabel(0.5 * (across.begin + across.end), bottom + 36.0, "mean steady-state error (%)", "middle")
    )
    says = "A mark for each completed run, a long stroke at their median; right: the share that diverged or failed."
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
