"""auvid report."""

from pathlib import Path

import typer

from auvid_cli.cli.options import FigureFormatOption, OpenOption, QuietOption, ResultsArgument, VerboseOption
from auvid_cli.cli.terminal import Terminal, reporting_errors


def report(
    results: ResultsArgument = Path("results/spiral"),
    figure_format: FigureFormatOption = None,
    show: OpenOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Write the page (report.html), tables and figures of a results folder, and print a summary."""
    with reporting_errors() as command:
        from auvid_cli.report.figures.workers import load_ahead

        load_ahead()
        from auvid_cli.cli import pipeline
        from auvid_cli.data.replacement import refuse_other_page
        from auvid_cli.data.results import read_results
        from auvid_cli.data.results_folder import locked, page_in
        from auvid_cli.report.figures.draw import drawing

        terminal = Terminal(quiet, verbose)
        if results.is_dir():
            command.enter_context(locked(results))
        refuse_other_page(page_in(results))
        dataset, estimates = read_results(results)
        with terminal.compiling():
            from auvid_cli.api import core
            from auvid_cli.api.evaluation import Evaluator
            from auvid_cli.api.preparation import prepare

            core.load_sensors()
        evaluator = Evaluator(prepare(dataset))
        with drawing(results, figure_format) as figures:
            raise typer.Exit(pipeline.report_to(results, evaluator, estimates, terminal, figures, show))
