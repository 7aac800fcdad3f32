"""auvid design and campaign: plan the next run, and repeat an experiment many times."""

import os
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from auvid_cli.api import Destination
from auvid_cli.cli import DONE, VERDICT_FAILED, options
from auvid_cli.config.enums import FigureFormat
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

    from auvid_cli.config.manoeuvre import Envelope


def _limit(text: str) -> Any:
    return options.optional("QUANTITY", text)


@dataclass(frozen=True)
class EnvelopeOptions:
    """Limits of the run: texts with units."""

    duration: Annotated[str, _limit("Duration of the run. Default: 120 s.")] = "120 s"
    box: Annotated[str | None, _limit("Largest horizontal extent of the track. Default: 200 m.")] = None
    depth: Annotated[str | None, _limit("Largest range of depth. Default: 40 m.")] = None
    pitch: Annotated[str | None, _limit("Largest pitch angle. Default: 40 deg.")] = None
    roll: Annotated[str | None, _limit("Largest roll angle. Default: 40 deg.")] = None
    speed: Annotated[str | None, _limit("Lowest speed. Default: 0.4 times the cruise speed.")] = None
    energy: Annotated[str | None, _limit("Largest work of the thrust, without losses. Default: none.")] = None
    fins: Annotated[str | None, _limit("Largest fin angle. Default: limit of the manoeuvre.")] = None
    fin_rate: Annotated[str | None, _limit("Largest fin rate. Default: limit of the manoeuvre.")] = None


@dataclass(frozen=True)
class AimOptions:
    """Aim of the design, and prior knowledge of the vehicle."""

    chosen: Annotated[
        list[str] | None, options.optional("COEFFICIENT", "Design for this coefficient only; repeatable.", "--for")
    ] = None
    criterion: Annotated[
        str,
        typer.Option(
            metavar="D|worst", help="Minimise the mean log standard deviation (D) or the largest one (worst)."
        ),
    ] = "D"
    at: Annotated[Path | None, options.optional("ESTIMATE", "Draw trial vehicles from this estimate (.h5).")] = None
    given: Annotated[
        list[Path] | None,
        options.optional("DATASET", "Earlier dataset (.h5) whose information counts as well; repeatable."),
    ] = None
    spread: Annotated[
        str | None,
        _limit(
            "Standard deviation of trial vehicles, share of each value in the vehicle file. Default: its own, or 30 %."
        ),
    ] = None
    draws: Annotated[int, typer.Option(metavar="N", min=1, max=1000, help="Number of trial vehicles.")] = 8


@dataclass(frozen=True)
class SearchOptions:
    """Limits and workers of the search."""

    budget: Annotated[str, _limit("Duration of the search. Default: 3 min.")] = "3 min"
    generations: Annotated[int | None, options.optional("N", "Number of generations, instead of --budget.", min=1)] = (
        None
    )
    scheduler: options.SchedulerOption = None


@options.command
def design(
    *,
    experiment: options.ExperimentOptions,
    limits: EnvelopeOptions,
    aim: AimOptions,
    search: SearchOptions,
    origin: Annotated[
        str, typer.Option("--origin", metavar="LAT,LON", help="Start of the run in degrees, for track.geojson.")
    ] = "0,0",
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the mission files.")] = Path(
        "mission"
    ),
    overwrite: options.OverwriteOption = False,
    figure_format: options.FigureFormatOption = None,
    console: options.TerminalOptions,
) -> None:
    """Search for the most informative manoeuvre, and write the mission files for the crew.

    Each manoeuvre is simulated, with process noise, on several trial vehicles that are drawn from the prior knowledge.
    All of them must stay within the limits. The result is compared with spiral, doublets and zigzag on vehicles that
    the search did not use; if the spiral is as good, the spiral is written. Ctrl-C ends the search and keeps the best
    manoeuvre. A search that was killed continues with the same command.
    """
    terminal = console.terminal()
    source = experiment.load()
    given = [options.dataset_file(path) for path in aim.given or ()]
    envelope = _envelope(limits)
    time = None if search.generations else _quantity("budget", search.budget, "s")
    duration = _quantity("duration", limits.duration, "s")
    fin_angle = None if limits.fins is None else _quantity("fins", limits.fins, "rad", 1.6)
    fin_rate = None if limits.fin_rate is None else _quantity("fin-rate", limits.fin_rate, "rad/s")
    spread = None if aim.spread is None else _quantity("spread", aim.spread, "1")
    place = _origin(origin)
    if aim.criterion not in ("D", "worst"):
        raise ConfigError(f"--criterion {aim.criterion}: expected D or worst")
    with terminal.compiling():
        from auvid_cli.api.design import DesignSources, Requirement, SearchLimits, design_into
        from auvid_cli.report.screens import print_design

    requirement = Requirement(
        duration,
        envelope,
        fin_angle,
        fin_rate,
        tuple(aim.chosen or ()),
        "D" if aim.criterion == "D" else "worst",
        aim.draws,
        spread,
    )
    result, written = design_into(
        Destination(output, overwrite, terminal, tuple(figure_format or (FigureFormat.PNG,))),
        DesignSources(source, aim.at, given),
        requirement,
        SearchLimits(search.generations, time),
        search.scheduler,
        place,
    )
    print_design(terminal.out, result)
    terminal.print_lines(written)
    terminal.print(f"next: {_rehearsal(experiment, output / 'manoeuvre.yaml')}")


def _rehearsal(experiment: options.ExperimentOptions, manoeuvre: Path) -> str:
    """Return the command that simulates and identifies an experiment with the written manoeuvre."""
    kept = [setting for setting in experiment.settings or () if not setting.startswith("manoeuvre")]
    changes = [f"--set={setting}" for setting in (*kept, f"manoeuvre={manoeuvre}")]
    name = [] if experiment.experiment is None else [experiment.experiment]
    return shlex.join(["auvid", "run", *name, *changes, "-o", "results/designed_run"])


def _quantity(option: str, text: str, unit: str, below: float = float("inf")) -> float:
    """Return a quantity in SI; refuse values outside 0 to `below`."""
    from auvid_cli.config.units import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except ValueError as error:
        raise ConfigError(f"--{option}: {error}") from None
    if not 0.0 < value < below:
        upper = f" and below {below:g} {unit}" if below < float("inf") else ""
        raise ConfigError(f"--{option} {text}: must be larger than 0{upper}")
    return value


def _envelope(limits: EnvelopeOptions) -> "Envelope":
    """Return the envelope; report all invalid limits by the names of their options."""
    from pydantic import ValidationError

    from auvid_cli.config.manoeuvre import Envelope

    texts = {name: getattr(limits, name) for name in Envelope.model_fields}
    try:
        return Envelope.model_validate({name: text for name, text in texts.items() if text is not None})
    except ValidationError as error:
        raise ConfigError("\n".join(_message(Envelope, detail) for detail in error.errors())) from None


def _message(model: "type[Envelope]", error: "ErrorDetails") -> str:
    from auvid_cli.config.locate import LIMITS
    from auvid_cli.config.units import Unit

    name, limit = str(error["loc"][0]), LIMITS.get(error["type"])
    if limit is None:
        return f"--{name}: {error['msg'].removeprefix('Value error, ')}"
    unit = next(item.unit for item in model.model_fields[name].metadata if isinstance(item, Unit))
    return f"--{name} {error['input']}: {limit.format(**error.get('ctx', {}))} {unit}"


def _origin(text: str) -> tuple[float, float]:
    """Return latitude and longitude, degrees."""
    from auvid_cli.config.units import parse_number

    try:
        latitude, longitude = (parse_number(part) for part in text.split(","))
    except ValueError:
        latitude, longitude = float("nan"), float("nan")
    if not (abs(latitude) < 89.0 and abs(longitude) <= 180.0):
        raise ConfigError(f"--origin {text}: expected latitude and longitude in degrees, such as 41.18,-8.70")
    return latitude, longitude


@options.command
def campaign(
    *,
    file: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Campaign file, or the name of a shipped campaign (`auvid list campaigns`).",
            autocompletion=options.complete_campaign,
        ),
    ],
    scheduler: options.SchedulerOption = None,
    workers: Annotated[
        int | None, options.optional("N", "Number of processes on this machine. Default: one per core.", min=1)
    ] = None,
    settings: Annotated[
        list[str] | None,
        options.optional("KEY=VALUE", "Override a key of the campaign file, e.g. --set seeds=5.", "--set"),
    ] = None,
    output: Annotated[
        Path | None, options.optional("DIR", "Results folder. Default: results/campaigns/NAME.", "--output", "-o")
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Repeat the runs that failed.")] = False,
    again: Annotated[bool, typer.Option("--again", help="Repeat all runs, also the finished ones.")] = False,
    keep_estimates: Annotated[
        bool, typer.Option("--keep-estimates", help="Also write the complete estimate of each new run (20 MB each).")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print the number of runs and their approximate duration, and exit.")
    ] = False,
    figures: options.FigureOptions,
    console: options.TerminalOptions,
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
        from auvid_cli.report.campaign_results import print_summary

    plan, folder = plan_campaign(file, settings or (), output)
    where = Workers(scheduler, workers or os.cpu_count() or 1)
    chosen = CampaignOptions(where, retry, again, keep_estimates, figures.formats)
    if dry_run:
        forecast(plan, folder, chosen, terminal)
        return DONE
    result = run_campaign(plan, folder, chosen, terminal)
    if result.summary is not None:
        print_summary(terminal.out, result.summary, [file for file in result.files if file != result.page])
        terminal.print(f"report: {result.page}")
        if figures.show:
            terminal.open_page(result.page)
    for remark in result.remarks:
        terminal.print_wrapped(remark)
    return DONE if result.is_complete else VERDICT_FAILED
