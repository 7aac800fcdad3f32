"""auvid identifiability."""

from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.options import (
    DataArgument,
    OutputOption,
    OverwriteOption,
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
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Say what data can tell of each coefficient at best, before any filter runs.

    An experiment is simulated for it, a dataset file taken as it is. The bounds hold at the true coefficients of a
    simulation, else at those of the vehicle file.
    """
    with reporting_errors():
        from auvid_cli.api.files import read_dataset
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import find_experiment, load_with_files
        from auvid_cli.data.files import keep_apart
        from auvid_cli.data.replacement import put_copy
        from auvid_cli.data.results_folder import tables_and_figures

        terminal = Terminal(quiet, verbose)
        changes, path = overrides(settings, seed, use), pipeline.dataset_path(data)
        earlier = [] if at is None else [at]
        if path:
            dataset, folder = read_dataset(path, *changes), output or pipeline.home_of(path)
            files = [path, *dataset.experiment.data_files(), *earlier]
            put_copy(path, dataset, folder, files, overwrite)
        else:
            experiment, files = load_with_files(find_experiment(data), changes)
            folder, files = pipeline.results_folder(experiment, output), [*files, *earlier]
            dataset = pipeline.simulate_to(folder, experiment, terminal, files, overwrite)
        keep_apart(tables_and_figures(folder), files)
        pipeline.assess_to(folder, dataset, at, terminal)
