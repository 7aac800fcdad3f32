"""auvid check."""

from pathlib import Path

import typer

from auvid_cli.cli.exit_codes import DONE, VERDICT_FAILED
from auvid_cli.cli.options import QuietOption, ResultsArgument, VerboseVerdictsOption
from auvid_cli.cli.terminal import Terminal, reporting_errors


def check(
    results: ResultsArgument = Path("results/spiral"),
    quiet: QuietOption = False,
    verbose: VerboseVerdictsOption = False,
) -> None:
    """Judge every estimate of a results folder; exit code 1 if a verdict fails.

    Prints what did not pass, each with what to do about it: FAIL is against the estimate, note is worth knowing. The
    results folder gets all verdicts (tables/checks.csv).
    """
    with reporting_errors():
        from auvid_cli.data.results import read_results

        terminal = Terminal(quiet, verbose)
        with terminal.compiling():
            from auvid_cli.api import checks, core
            from auvid_cli.report.csv_tables import write_csv_tables
            from auvid_cli.report.screen import print_checks

            core.load_sensors()
        dataset, estimates = read_results(results)
        with terminal.stage("check"):
            verdicts = checks.check(dataset, *estimates)
        print_checks(terminal.out, verdicts, passed=verbose)
        (path,) = write_csv_tables({"checks": verdicts.rows()}, results / "tables")
        terminal.say(str(path))
        raise typer.Exit(VERDICT_FAILED if verdicts.failed() else DONE)
