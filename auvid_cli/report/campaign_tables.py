"""Results of a campaign as files and on the screen."""

from collections.abc import Hashable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from auvid_cli.campaign.summary import CampaignSummary
from auvid_cli.data.checks import csv_cell
from auvid_cli.data.files import write_text
from auvid_cli.report.screen import print_files
from auvid_cli.report.screen_table import narrowed
from auvid_cli.report.table import Cell, Column, Table, number, setting_text
from auvid_cli.report.text_tables import render_markdown

_MAX_ROWS = 40  # on the screen; the files have all
_SCREEN_DIGITS = 3
# Columns left out on a narrow terminal, in this order.
_DROPPED_COLUMNS = "by chance", "error / bound", "5 - 95 %", "sd / bound", "in 2 sd %", "NEES"
_WHAT = {"steady_state_error_percent": "steady-state error", "rmse_percent": "RMSE"}


def write_findings(findings: CampaignSummary, folder: Path) -> list[Path]:
    """Write ``filters.csv``, ``coefficients.csv``, ``comparisons.csv`` and ``campaign.md``.

    Raises
    ------
    FileError
        If a file cannot be written; an existing file then stays as it was.
    """
    tables = {
        "filters": findings.filters,
        "coefficients": findings.coefficients,
        "comparisons": findings.comparisons.rename(columns={"conclusion": "verdict"}),
    }
    paths = [folder / f"{name}.csv" for name in tables]
    for path, table in zip(paths, tables.values(), strict=True):
        write_text(path, table.map(csv_cell).rename(columns=csv_cell).to_csv(index=False))
    markdown = folder / "campaign.md"
    write_text(markdown, render_markdown([filters_table(findings), *comparison_table(findings)]))
    return [*paths, markdown]


def print_findings(console: Console, findings: CampaignSummary, files: Sequence[Path]) -> None:
    """Print a row for each combination of settings and filter, who is better in how many, and where the files are."""
    if len(findings.filters) <= _MAX_ROWS:
        table = filters_table(findings)
        if not any(findings.filters["failed"]):
            table = table.without("failed %")
        console.print(narrowed(console, table, _DROPPED_COLUMNS, _SCREEN_DIGITS))
    else:
        console.print(Text(f"{len(findings.filters)} combinations of settings and filter: see the tables"))
    for sentence in comparison_sentences(findings):
        console.print(Text(sentence))
    print_files(console, files)


def comparison_sentences(findings: CampaignSummary) -> list[str]:
    """Return, for each pair of filters and measure, in how many settings each conclusion holds."""
    sentences = []
    if not len(findings.comparisons):
        return sentences
    for (first, second, measure), rows in findings.comparisons.groupby(["first", "second", "measure"], sort=False):
        counts = rows["conclusion"].value_counts()
        conclusions = ", ".join(f"{conclusion} in {count}" for conclusion, count in counts.items())
        sentences.append(f"{first} and {second}, {_WHAT[str(measure)]}: {conclusions}, of {len(rows)}")
    return sentences


def filters_table(findings: CampaignSummary) -> Table:
    """Lay out the statistics of each combination of settings and filter."""
    columns = [Column(_heading(column), numeric=False) for column in [*findings.columns, "filter"]]
    headers = (
        "runs",
        "failed %",
        "diverged %",
        "inconsistent %",
        "sound %",
        "error %",
        "5 - 95 %",
        "in 2 sd %",
        "sd / bound",
        "error / bound",
    )
    columns += [Column(header) for header in (*headers, "NEES", "by chance")]
    rows: list[list[Cell]] = [
        [
            *(setting_text(row[column]) for column in [*findings.columns, "filter"]),
            int(row["runs"]),
            100.0 * row["failed"],
            100.0 * row["diverged"],
            100.0 * row["inconsistent"],
            100.0 * row["sound"],
            row["steady_state_error_percent"],
            _interval(row, "steady_state_error_percent"),
            100.0 * row["within_two_sigma"],
            row["times_bound"],
            row["error_times_bound"],
            row["nees"],
            _interval(row, "nees"),
        ]
        for row in findings.filters.to_dict("records")
    ]
    notes = (
        "Sound: share of the runs whose estimate may be used. Error: mean steady-state error of the coefficients, "
        "median over the runs; 90 % of the runs are within 5 - 95 %. In 2 sd: share of coefficients whose true value "
        "is within two standard deviations (corrected ones of batch estimates); 95.4 if these are right.",
        "sd / bound: median of the stated standard deviations in terms of Cramer-Rao's bound, of the data alone. "
        "Error / bound: root mean square of the errors in terms of it.",
        "NEES: per coefficient, 1 if the covariance is right, and then within the last interval in 95 % of all cases. "
        "Runs that failed or diverged count only as such; those that are inconsistent count.",
    )
    return Table("campaign", "Filters", tuple(columns), rows, notes=notes)


def comparison_table(findings: CampaignSummary) -> list[Table]:
    """Compare the filters in a table; in none if there is but one filter."""
    if not len(findings.comparisons):
        return []
    kept = [*findings.columns, "first", "second"]
    headers = ("measure", "of first %", "of second %", "difference", "95 %", "p, adjusted", "seeds", "conclusion")
    columns = [Column(_heading(name), numeric=False) for name in kept]
    columns += [Column(header, numeric=header not in ("measure", "conclusion")) for header in headers]
    rows: list[list[Cell]] = [
        [
            *(setting_text(row[name]) for name in kept),
            _WHAT[row["measure"]],
            row["median_first"],
            row["median_second"],
            row["difference"],
            _interval(row, "difference"),
            row["p_value_adjusted"],
            int(row["seeds"]),
            row["conclusion"],
        ]
        for row in findings.comparisons.to_dict("records")
    ]
    notes = (
        *comparison_sentences(findings),
        "On the same data, seed by seed: median of the difference, first minus second, with its 95 % interval; "
        "Wilcoxon's p-value, adjusted for the number of comparisons (Benjamini and Hochberg). A tie: the whole "
        "interval lies within 1 % of the error itself.",
    )
    return [Table("comparisons", "Filters against each other", tuple(columns), rows, notes=notes)]


def _heading(column: str) -> str:
    """Shorten a setting to its last two keys."""
    return ".".join(column.split(".")[-2:])


def _interval(row: Mapping[Hashable, Any], name: str) -> str | None:
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    return f"{number(low, 3)} to {number(high, 3)}" if isfinite(low) and isfinite(high) else None
