"""auvid campaign: an experiment with many seeds, filters and settings."""

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
            help="Campaign file, or the name of a shipped campaign (`auvid list campaigns`).",
            autocompletion=complete_campaign,
        ),
    ],
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Dask scheduler, such as tls://HOST:8786. Default: this machine only. At tcp://, everyone who reaches "
            "the scheduler can run code.",
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Number of processes on this machine. Default: one per core.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the campaign file, e.g. --set seeds=5."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Results folder. Default: results/campaigns/NAME."),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Repeat the runs that failed.")] = False,
    again: Annotated[bool, typer.Option("--again", help="Repeat all runs, also the finished ones.")] = False,
    keep_estimates: Annotated[
        bool,
        typer.Option("--keep-estimates", help="Also write the complete estimate of each new run (20 MB each)."),
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print the number of runs and their approximate duration, and exit.")
    ] = False,
    figures: FigureOptions,
    console: TerminalOptions,
) -> int:
    """Repeat an experiment with many seeds, filters and settings, and report statistics.

    The runs use all cores, or a cluster. Finished runs are not repeated: the same command continues an interrupted
    campaign.
    """
    if scheduler is not None and workers is not None:
        raise ConfigError("--workers and --scheduler: expected one of them; a scheduler has its own workers")
    terminal = console.terminal()
    # Compile before the workers start: they load the core from the cache.
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
