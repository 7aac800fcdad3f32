"""auvid compare."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli.exit_codes import DONE, VERDICT_FAILED
from auvid_cli.cli.options import QuietOption
from auvid_cli.cli.terminal import Terminal, reporting_errors

if TYPE_CHECKING:
    from auvid_cli.api.comparison import Tolerance


def compare(
    first: Annotated[Path, typer.Argument(metavar="RESULTS", help="Results folder.")],
    second: Annotated[
        Path, typer.Argument(metavar="REFERENCE", help="Results folder to compare with, or a copy of its tables.")
    ],
    relative: Annotated[
        list[str] | None,
        typer.Option(
            "--relative",
            "-r",
            metavar="SHARE|COLUMN=SHARE",
            help="Share that values may differ by, of all columns or of one (inf: not compared); repeatable. Default: "
            "0.01, and none of estimates.",
            show_default=False,
        ),
    ] = None,
    deviations: Annotated[
        float | None,
        typer.Option(
            "--deviations",
            metavar="N",
            min=0.0,
            help="What an estimate may differ by, in its standard deviations. Default: 0.01.",
            show_default=False,
        ),
    ] = None,
    quiet: QuietOption = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print all values, not only those that differ.")] = (
        False
    ),
) -> None:
    """Put the tables of two results side by side; exit code 1 if they differ by more than they may.

    What the second has in coefficients.csv, summary.csv and velocity_error.csv, the first must have, and alike: text to
    the letter, numbers within tolerances. Processor times, and judgements in sentences, are not compared.
    """
    with reporting_errors():
        from auvid_cli.api.comparison import compare_results
        from auvid_cli.report.comparison_screen import print_comparison

        terminal = Terminal(quiet, verbose)
        comparison = compare_results(first, second, _tolerance(relative or [], deviations))
        terminal.say(f"first: {first}; second: {second}")
        print_comparison(terminal.out, comparison, everything=verbose)
        differing = len(comparison.differing())
        terminal.say(f"{differing} of {len(comparison.values)} values differ" if differing else "the results agree")
        raise typer.Exit(VERDICT_FAILED if differing else DONE)


def _tolerance(relative: list[str], deviations: float | None) -> "Tolerance":
    """Return what options say; a later one counts.

    Raises
    ------
    ConfigError
        If one is no share.
    """
    from auvid_cli.api.comparison import DEVIATIONS, Tolerance
    from auvid_cli.errors import ConfigError

    everywhere, by_column = None, {}
    for text in relative:
        column, equals, number = text.rpartition("=")
        try:
            share = float(number)
        except ValueError:
            share = -1.0
        if not share >= 0.0 or (equals and not column):
            raise ConfigError(f"--relative {text}: expected a share such as 0.01, or COLUMN=SHARE such as rmse=0.05")
        if column:
            by_column[column] = share
        else:
            everywhere = share
    return Tolerance(everywhere, by_column, DEVIATIONS if deviations is None else deviations)
