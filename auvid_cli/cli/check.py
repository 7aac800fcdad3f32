"""auvid check."""

from pathlib import Path

import typer

from auvid_cli.cli.exit_codes import DONE, VERDICT_FAILED
from auvid_cli.cli.options import QuietOption, ResultsArgument, VerboseOption
from auvid_cli.cli.terminal import Terminal, reporting_errors


def check(
    results: ResultsArgument = Path("results/spiral"), quiet: QuietOption = False, verbose: VerboseOption = False
) -> None:
    """Judge every estimate of a results folder; exit code 1 if a verdict fails."""
    with reporting_errors():
        from auvid_cli.cli import pipeline

        terminal = Terminal(quiet, verbose)
        with terminal.compiling():
            from auvid_cli.evaluation.bounds import BoundsOf
            from auvid_cli.evaluation.estimate_checks import check_estimate, failed
            from auvid_cli.report.csv_tables import write_checks
            from auvid_cli.report.screen import print_checks
        dataset, estimates = pipeline.read_results(results)
        bounds_of = BoundsOf(dataset)
        with terminal.stage("check"):
            checks = [
                verdict for estimate in estimates for verdict in check_estimate(dataset, estimate, bounds_of(estimate))
            ]
        print_checks(terminal.out, checks)
        terminal.say(str(write_checks(checks, results / "tables")))
        raise typer.Exit(VERDICT_FAILED if failed(checks) else DONE)
