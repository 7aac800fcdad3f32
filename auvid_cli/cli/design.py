"""auvid design."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.design_options import envelope_of, place_of, quantity_of, refuse_what_stands
from auvid_cli.cli.design_search import SearchLimits, search_on, spread_over
from auvid_cli.cli.options import (
    ExperimentArgument,
    FigureFormatOption,
    OverwriteOption,
    QuietOption,
    SeedOption,
    SetOption,
    VerboseOption,
    overrides,
    refuse_log,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors
from auvid_cli.errors import ConfigError


def _limit(name: str, what: str) -> typer.models.OptionInfo:
    return typer.Option(f"--{name}", metavar="QUANTITY", help=what, show_default=False)


def design(
    experiment: ExperimentArgument = None,
    settings: SetOption = None,
    duration: Annotated[str, _limit("duration", "Length of the run. Default: 120 s.")] = "120 s",
    box: Annotated[str | None, _limit("box", "Largest extent of the track. Default: 200 m.")] = None,
    depth: Annotated[str | None, _limit("depth", "From the shallowest to the deepest point. Default: 40 m.")] = None,
    pitch: Annotated[str | None, _limit("pitch", "Largest pitch. Default: 40 deg.")] = None,
    roll: Annotated[str | None, _limit("roll", "Largest roll. Default: 40 deg.")] = None,
    speed: Annotated[str | None, _limit("speed", "Least speed. Default: 0.4 of the cruise.")] = None,
    energy: Annotated[str | None, _limit("energy", "Largest work of the thrust, without losses. Default: any.")] = None,
    fins: Annotated[str | None, _limit("fins", "Largest fin angle. Default: the manoeuvre's limits.")] = None,
    fin_rate: Annotated[str | None, _limit("fin-rate", "Largest fin rate. Default: the manoeuvre's limits.")] = None,
    chosen: Annotated[
        list[str] | None,
        typer.Option(
            "--for", metavar="COEFFICIENT", help="Count this coefficient only; repeatable.", show_default=False
        ),
    ] = None,
    criterion: Annotated[
        str, typer.Option("--criterion", metavar="D|worst", help="Mean of the logarithms of the sd, or the largest.")
    ] = "D",
    at: Annotated[
        Path | None,
        typer.Option("--at", metavar="ESTIMATE", help="Draw vehicles from this estimate (.h5).", show_default=False),
    ] = None,
    given: Annotated[
        list[Path] | None,
        typer.Option(
            "--given",
            metavar="DATASET",
            help="Count what this dataset (.h5) says as known already; repeatable.",
            show_default=False,
        ),
    ] = None,
    spread: Annotated[
        str | None,
        _limit("spread", "Draw vehicles so far about the vehicle file's values. Default: as it states, else 30 %."),
    ] = None,
    draws: Annotated[int, typer.Option("--draws", metavar="N", min=1, max=1000, help="Vehicles the search sees.")] = 8,
    budget: Annotated[str, _limit("budget", "Time to search. Default: 3 min.")] = "3 min",
    generations: Annotated[
        int | None,
        typer.Option(
            "--generations", metavar="N", min=1, help="Search so many generations instead.", show_default=False
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="Dask scheduler, such as tcp://10.0.0.1:8786. Default: the cores of this machine.",
            show_default=False,
        ),
    ] = None,
    origin: Annotated[
        str, typer.Option("--origin", metavar="LAT,LON", help="Where the run begins, degrees, for track.geojson.")
    ] = "0,0",
    seed: SeedOption = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the files of the crew.")
    ] = Path("mission"),
    overwrite: OverwriteOption = False,
    figure_format: FigureFormatOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Find the run that tells most of a vehicle, and write what a crew needs to sail it.

    Manoeuvres are tried on vehicles drawn about what is known, with process noise, in an envelope that all of them
    keep. What comes out is compared with spiral, doublets and zigzag on vehicles that the search has not seen; where
    the spiral is as good, it is written. Ctrl-C ends the search and keeps the best so far; one that was killed goes on
    by the same command.
    """
    with reporting_errors():
        from auvid_cli.config.load import find_experiment, load_with_files
        from auvid_cli.data.files import keep_apart, write_text

        terminal = Terminal(quiet, verbose)
        refuse_log(experiment)
        loaded, read = load_with_files(find_experiment(experiment), overrides(settings, seed))
        place, paths = place_of(origin), [output / name for name in _FILES]
        refuse_what_stands(paths, overwrite)
        for source in given or ():
            refuse_log(source)
        sources = [*([] if at is None else [at]), *(given or ())]
        keep_apart([*paths, output / _STATE], [*read, *sources])
        envelope = envelope_of(box=box, depth=depth, pitch=pitch, roll=roll, speed=speed, energy=energy)
        limit = None if generations else quantity_of("budget", budget, "s")
        length = quantity_of("duration", duration, "s")
        fin_angle = None if fins is None else quantity_of("fins", fins, "rad", 1.6)
        rate = None if fin_rate is None else quantity_of("fin-rate", fin_rate, "rad/s")
        share = None if spread is None else quantity_of("spread", spread, "1")
        if criterion not in ("D", "worst"):
            raise ConfigError(f"--criterion {criterion}: expected D or worst")
        with terminal.compiling():
            from auvid_cli.api import core
            from auvid_cli.api import design as api
            from auvid_cli.api.files import read_dataset, read_estimate
            from auvid_cli.report.design_screen import print_design, sentences
            from auvid_cli.report.figures.draw import drawing

            core.load_sensors()
        wish = api.Wish(
            length,
            envelope,
            fin_angle,
            rate,
            tuple(chosen or ()),
            "D" if criterion == "D" else "worst",
            draws,
            share,
        )
        with ExitStack() as stack:
            spread_out = None if scheduler is None else stack.enter_context(spread_over(scheduler))
            estimate = None if at is None else read_estimate(at)
            data = {str(path): read_dataset(path) for path in given or ()}
            task = stack.enter_context(api.designing(loaded, wish, estimate, data, spread_out))
            terminal.tell(f"{loaded.vehicle.name}: {draws} drawn from {task.belief.origin}")
            for name in api.left_out(loaded):
                terminal.tell(f"note: not counted: {name}")
            for path in data:
                terminal.tell(f"known already: what {path} says")
            key = api.search_key(loaded, wish, sources)
            reached = search_on(task, terminal, SearchLimits(generations, limit), output / _STATE, key, overwrite)
            with terminal.stage("compare"):
                result = api.conclude(task, reached)
                gain = "the spiral itself" if result.is_own else f"{result.chosen}, x{result.gain:.2f} over the spiral"
                remark = f"auvid design, seed {loaded.seed}, {reached.generation} generations: {gain}"
                mission = api.mission(task, result, remark, place)
        texts = mission.texts | {"result.md": "\n".join(f"- {line}" for line in sentences(result)) + "\n"}
        for name, text in texts.items():
            write_text(output / name, text)
        with drawing(output, figure_format) as figures, terminal.stage("figure"):
            figures.add_mission(result, mission.band)
            drawn = figures.finish()
        print_design(terminal.out, result)
        terminal.say_all([*(output / name for name in texts), *drawn])


_FILES = "manoeuvre.yaml", "inputs.csv", "track.geojson", "timeline.md", "checklist.md", "result.md"
_STATE = "search.json"
