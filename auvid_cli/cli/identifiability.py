"""auvid identifiability."""

from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.options import (
    DataArgument,
    OutputOption,
    QuietOption,
    SeedOption,
    SetOption,
    UseOption,
    VerboseOption,
    overrides,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors


def identifiability(
    data: DataArgument = None,
    settings: SetOption = None,
    use: UseOption = None,
    seed: SeedOption = None,
    at: Annotated[
        Path | None,
        typer.Option(
            "--at",
            metavar="ESTIMATE",
            help="Estimate file (.h5) at whose coefficients to look; for a vehicle that states none.",
            show_default=False,
        ),
    ] = None,
    output: OutputOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Say what data can tell of each coefficient at best, before any filter runs.

    An experiment is simulated for it, a dataset file taken as it is. The bounds hold at the true coefficients of a
    simulation, else at those of the vehicle file.
    """
    with reporting_errors():
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import find_experiment, load_experiment

        terminal = Terminal(quiet, verbose)
        changes, path = overrides(settings, seed, use), pipeline.dataset_path(data)
        if path:
            dataset, folder = pipeline.foreign_dataset(path, changes), output or pipeline.home_of(path)
        else:
            experiment = load_experiment(find_experiment(data), changes)
            dataset, folder = pipeline.simulated(experiment, terminal), pipeline.results_folder(experiment, output)
        pipeline.assess_to(folder, dataset, at, terminal)
