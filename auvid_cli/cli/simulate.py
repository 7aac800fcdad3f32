"""auvid simulate."""

from typing import Annotated

import typer

from auvid_cli.cli.options import (
    DryRunOption,
    ExperimentArgument,
    OutputOption,
    OverwriteOption,
    QuietOption,
    SeedOption,
    SetOption,
    VerboseOption,
    overrides,
    refuse_log,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors


def simulate(
    experiment: ExperimentArgument = None,
    settings: SetOption = None,
    seed: SeedOption = None,
    as_log: Annotated[
        bool,
        typer.Option(
            "--as-log",
            help="Write no dataset but CSV files, as a vehicle of somebody else would have logged the run, and a "
            "vehicle file that is 30 % off.",
        ),
    ] = False,
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    dry_run: DryRunOption = False,
) -> None:
    """Simulate an experiment's vehicle and sensors into results/NAME/dataset.h5."""
    with reporting_errors() as command:
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import dump_experiment, find_experiment, load_with_files
        from auvid_cli.data.results_folder import folder_of_run, locked

        refuse_log(experiment)
        loaded, files = load_with_files(find_experiment(experiment), overrides(settings, seed))
        if dry_run:
            print(dump_experiment(loaded), end="")
            return
        folder = output or folder_of_run(loaded.name)
        command.enter_context(locked(folder))
        if as_log:
            pipeline.simulate_log_to(folder, loaded, Terminal(quiet, verbose), files, overwrite)
            return
        pipeline.simulate_to(folder, loaded, Terminal(quiet, verbose), files, overwrite)
