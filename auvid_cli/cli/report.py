"""auvid report."""

from pathlib import Path

import typer

from auvid_cli.cli.options import QuietOption, ResultsArgument, VerboseOption
from auvid_cli.cli.terminal import Terminal, reporting_errors


def report(
    results: ResultsArgument = Path("results/spiral"), quiet: QuietOption = False, verbose: VerboseOption = False
) -> None:
    """Write tables and figures of a results folder, and print a summary."""
    with reporting_errors():
        from auvid_cli.report.figures.workers import load_ahead

        load_ahead()
        from auvid_cli.cli import pipeline

        terminal = Terminal(quiet, verbose)
        dataset, estimates = pipeline.read_results(results)
        prepared = pipeline.prepare(dataset, terminal)
        bounds_of = pipeline.bounds_of(prepared, terminal)
        with pipeline.drawing(results) as figures:
            for estimate in estimates:
                figures.add_innovations(estimate)
            raise typer.Exit(pipeline.report_to(results, prepared, estimates, bounds_of, terminal, figures))
