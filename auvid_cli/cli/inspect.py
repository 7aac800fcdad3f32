"""auvid inspect."""

from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.options import OutputOption, QuietOption, VerboseOption
from auvid_cli.cli.terminal import DONE, VERDICT_FAILED, Terminal, reporting_errors


def inspect(
    dataset: Annotated[Path, typer.Argument(metavar="DATASET", help="Dataset file (.h5), recorded or simulated.")],
    output: OutputOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Judge recorded data before anybody identifies from them; exit code 1 if a verdict fails.

    Each sensor by itself, all against each other (signs, axes, units), and whether the manoeuvre tells enough. What
    passed is in tables/inspection.csv, and with --verbose on the screen.
    """
    with reporting_errors():
        from auvid_cli.cli import pipeline
        from auvid_cli.data.dataset_file import read_dataset
        from auvid_cli.evaluation.checks import failed
        from auvid_cli.evaluation.inspection.inspect import inspect_dataset
        from auvid_cli.report.csv_tables import write_inspection
        from auvid_cli.report.screen import print_checks

        terminal = Terminal(quiet, verbose)
        folder = output or pipeline.home_of(dataset)
        with terminal.stage("read the dataset"):
            read = read_dataset(dataset)
        with terminal.stage("inspect"):
            inspection = inspect_dataset(read)
        paths = [write_inspection(inspection.checks, folder / "tables")]
        with pipeline.drawing(folder) as figures, terminal.progress("figures") as (progress,):
            figures.add_timeline(inspection)
            paths += figures.finish(progress)
        print_checks(terminal.out, inspection.checks, passed=verbose)
        for path in paths:
            terminal.say(str(path))
        raise typer.Exit(VERDICT_FAILED if failed(inspection.checks) else DONE)
