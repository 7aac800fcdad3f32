"""auvid campaign."""

import os
from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.completion import complete_campaign
from auvid_cli.cli.options import FigureFormatOption, OpenOption, QuietOption, VerboseOption
from auvid_cli.cli.terminal import Terminal, reporting_errors


def campaign(
    file: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Campaign file, or the name of one that ships with auvid.",
            autocompletion=complete_campaign,
        ),
    ],
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler to use, such as tcp://HOST:8786. Default: this machine."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Processes on this machine. Default: one for each core.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the campaign file, e.g. --set seeds=5."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Results folder. Default: results/campaigns/NAME."),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Also try the runs again that failed.")] = False,
    again: Annotated[bool, typer.Option("--again", help="Do all runs again, also those that are finished.")] = False,
    keep_estimates: Annotated[
        bool, typer.Option("--keep-estimates", help="Also write the whole estimate of each new run: some 20 MB each.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say how many runs there are and about how long they take, and stop.")
    ] = False,
    figure_format: FigureFormatOption = None,
    show: OpenOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Run an experiment over seeds, filters and settings, on all cores or a cluster, and report statistics.

    Finished runs are never repeated: the same command goes on with an interrupted campaign, and reports a finished one.
    """
    with reporting_errors():
        terminal = Terminal(quiet, verbose)
        # The workers find the compiled core in its cache.
        with terminal.compiling():
            from auvid_cli.cli import campaigning
            from auvid_cli.errors import ConfigError

        plan, folder = campaigning.set_up(file, tuple(settings or ()), output)
        if scheduler is not None and workers is not None:
            raise ConfigError("--workers is for this machine, and --scheduler has workers of its own: say one of them")
        where = campaigning.Where(scheduler, workers or os.cpu_count() or 1)
        choice = campaigning.Choice(retry, again, keep_estimates, show, tuple(figure_format or ()))
        if dry_run:
            campaigning.forecast(plan, folder, where, choice, terminal)
            return
        raise typer.Exit(campaigning.conduct(plan, folder, where, choice, terminal))
