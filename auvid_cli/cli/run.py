"""auvid run."""

import typer

from auvid_cli.cli.options import (
    DryRunOption,
    ExperimentArgument,
    FilterOption,
    OutputOption,
    QuietOption,
    SeedOption,
    SetOption,
    VerboseOption,
    overrides,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors


def run(
    experiment: ExperimentArgument = None,
    filters: FilterOption = None,
    settings: SetOption = None,
    seed: SeedOption = None,
    output: OutputOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    dry_run: DryRunOption = False,
) -> None:
    """Simulate an experiment, identify with every filter named there, report."""
    with reporting_errors():
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import find_experiment, load_experiment

        loaded = load_experiment(find_experiment(experiment), overrides(settings, seed))
        if dry_run:
            pipeline.print_settings(loaded)
            return
        terminal = Terminal(quiet, verbose)
        folder = pipeline.results_folder(loaded, output)
        # The filters know nothing of vehicles, so the halves have no function in common.
        with terminal.compiling_beside("auvid_cli.filters.square_root", "auvid_cli.filters.information"):
            dataset = pipeline.simulate_to(folder, loaded, terminal)
            with terminal.compiling():
                import auvid_cli.identification.process  # noqa: F401
        chosen = tuple(filters or loaded.identification.filters)
        with pipeline.drawing(folder) as figures:
            estimates = pipeline.identify_to(folder, dataset, chosen, terminal, figures.add_innovations)
            raise typer.Exit(pipeline.report_to(folder, dataset, estimates, terminal, figures))
