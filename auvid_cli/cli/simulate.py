"""auvid simulate."""

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
)
from auvid_cli.cli.terminal import Terminal, reporting_errors


def simulate(
    experiment: ExperimentArgument = None,
    settings: SetOption = None,
    seed: SeedOption = None,
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    dry_run: DryRunOption = False,
) -> None:
    """Simulate an experiment's vehicle and sensors into results/NAME/dataset.h5."""
    with reporting_errors():
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import dump_experiment, find_experiment, load_with_files
        from auvid_cli.data.results_folder import folder_of_run

        loaded, files = load_with_files(find_experiment(experiment), overrides(settings, seed))
        if dry_run:
            print(dump_experiment(loaded), end="")
            return
        folder = output or folder_of_run(loaded.name)
        pipeline.simulate_to(folder, loaded, Terminal(quiet, verbose), files, overwrite)
