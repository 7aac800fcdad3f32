"""What became of a log, for the terminal."""

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from auvid_cli.logs.import_report import Account
from auvid_cli.report.screen_table import screen_table


def print_import_report(console: Console, accounts: Sequence[Account], remarks: Sequence[str]) -> None:
    """Print rate, span and losses of each sensor and input, and under the table what else was done."""
    table = screen_table()
    table.add_column("", no_wrap=True)
    for header in ("rate Hz", "samples", "from s", "to s", "missing", "duplicates"):
        table.add_column(header, justify="right")
    for own in accounts:
        span = (f"{time:.7g}" for time in own.span)
        cells = (f"{own.rate:.4g}", str(own.samples), *span, str(own.missing), str(own.duplicates))
        table.add_row(Text(own.name), *(Text(cell) for cell in cells))
    console.print(table)
    of_remark: dict[str, list[str]] = {}
    for own in accounts:
        for remark in own.remarks:
            of_remark.setdefault(remark, []).append(own.name)
    for remark in (*(f"{', '.join(names)}: {remark}" for remark, names in of_remark.items()), *remarks):
        console.print(Text(remark))
