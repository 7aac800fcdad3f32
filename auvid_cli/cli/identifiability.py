"""auvid identifiability."""

from pathlib import Path

import typer

from auvid_cli.cli.options import (
    DataArgument,
    OutputOption,
    QuietOption,
    SeedOption,
    SetOption,
    VerboseOption,
    overrides,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors


def identifiability(
    data: DataArgument = None,
    settings: SetOption = None,
    seed: SeedOption = None,
    output: OutputOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Say what data can tell of each coefficient at best, before any filter runs.

    An experiment is simulated for it, a dataset file taken as it is. The bounds hold at the coefficients of the
    vehicle file.
    """
    with reporting_errors():
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import find_experiment, load_experiment

        terminal = Terminal(quiet, verbose)
        if data is not None and data.endswith(".h5"):
            if seed is not None:
                raise typer.BadParameter("--seed has no meaning for a dataset file")
            dataset = pipeline.foreign_dataset(Path(data), overrides(settings, None))
            folder = output if output is not None else pipeline.home_of(Path(data))
        else:
            experiment = load_experiment(find_experiment(data), overrides(settings, seed))
            folder = pipeline.results_folder(experiment, output)
            dataset = pipeline.simulated(experiment, terminal)
        pipeline.assess_to(folder, dataset, terminal)
