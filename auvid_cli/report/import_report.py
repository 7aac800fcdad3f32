"""What became of a log, for the terminal."""

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from auvid_cli.logs.import_report import Account
from auvid_cli.report.screen_table import screen_table
from auvid_cli.report.table import Cell, Column, Table


def print_import_report(console: Console, accounts: Sequence[Account], remarks: Sequence[str]) -> None:
    """Print rate, span and losses of each sensor and input, and under the table what else was done."""
    headers = "rate Hz", "samples", "from s", "to s", "missing", "duplicates"
    rows: list[list[Cell]] = [
        [
            account.name,
            f"{account.rate:.4g}",
            str(account.samples),
            *(f"{time:.7g}" for time in account.span),
            str(account.missing),
            str(account.duplicates),
        ]
        for account in accounts
    ]
    columns = (Column("", numeric=False), *(Column(header) for header in headers))
    console.print(screen_table(console, Table("import", "Imported records", columns, rows), unbroken=("",)))
    of_remark: dict[str, list[str]] = {}
    for account in accounts:
        for remark in account.remarks:
            of_remark.setdefault(remark, []).append(account.name)
    for remark in (*(f"{', '.join(names)}: {remark}" for remark, names in of_remark.items()), *remarks):
        console.print(Text(remark))
