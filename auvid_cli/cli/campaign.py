"""auvid campaign: many runs."""

import os
from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.options import FigureOptions, TerminalOptions, command, complete_campaign
from auvid_cli.cli.streams import DONE, VERDICT_FAILED
from auvid_cli.errors import ConfigError


@command
def campaign(
    *,
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
    figures: FigureOptions,
    console: TerminalOptions,
) -> int:
    """Run an experiment over seeds, filters and settings, on all cores or a cluster, and report statistics.

    Finished runs are never repeated: the same command goes on with an interrupted campaign, and reports a finished one.
    """
    if scheduler is not None and workers is not None:
        raise ConfigError("--workers is for this machine, and --scheduler has workers of its own: say one of them")
    terminal = console.terminal()
    # The workers find the compiled core in its cache.
    with terminal.compiling():
        from auvid_cli.api.campaign import CampaignOptions, Workers, forecast, plan_campaign, run_campaign
        from auvid_cli.report.campaign_tables import print_findings

    plan, folder = plan_campaign(file, settings or (), output)
    where = Workers(scheduler, workers or os.cpu_count() or 1)
    options = CampaignOptions(where, retry, again, keep_estimates, figures.formats)
    if dry_run:
        forecast(plan, folder, options, terminal)
        return DONE
    result = run_campaign(plan, folder, options, terminal)
    if result.findings is not None:
        print_findings(terminal.out, result.findings, result.files)
        if figures.show:
            terminal.open_page(result.page)
    for remark in result.remarks:
        terminal.print_wrapped(remark)
    return DONE if result.is_complete else VERDICT_FAILED
