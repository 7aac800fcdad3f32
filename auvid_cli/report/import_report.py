"""What became of a log, for the terminal."""

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from auvid_cli.logs.import_report import ImportSummary
from auvid_cli.report.screen_table import screen_table
from auvid_cli.report.table import Cell, Column, Table


def print_import_report(console: Console, summaries: Sequence[ImportSummary], remarks: Sequence[str]) -> None:
    """Print rate, span and losses of each sensor and input, and under the table what else was done."""
    headers = "rate Hz", "samples", "from s", "to s", "missing", "duplicates"
    rows: list[list[Cell]] = [
        [
            summary.name,
            f"{summary.rate:.4g}",
            str(summary.samples),
            *(f"{time:.7g}" for time in summary.span),
            str(summary.missing),
            str(summary.duplicates),
        ]
        for summary in summaries
    ]
    columns = (Column("", numeric=False), *(Column(header) for header in headers))
    console.print(screen_table(console, Table("import", "Imported records", columns, rows), unbroken=("",)))
    of_remark: dict[str, list[str]] = {}
    for summary in summaries:
        for remark in summary.remarks:
            of_remark.setdefault(remark, []).append(summary.name)
    for remark in (*(f"{', '.join(names)}: {remark}" for remark, names in of_remark.items()), *remarks):
        console.print(Text(remark))
