"""auvid run."""

from typing import TYPE_CHECKING

import typer

from auvid_cli.cli.options import (
    DryRunOption,
    ExperimentArgument,
    FilterOption,
    OutputOption,
    OverwriteOption,
    QuietOption,
    SeedOption,
    SetOption,
    VerboseOption,
    overrides,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors

if TYPE_CHECKING:
    from auvid_cli.data.estimate import Estimate


def run(
    experiment: ExperimentArgument = None,
    filters: FilterOption = None,
    settings: SetOption = None,
    seed: SeedOption = None,
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    dry_run: DryRunOption = False,
) -> None:
    """Simulate an experiment, identify with every filter named there, report."""
    with reporting_errors():
        if not dry_run:
            from auvid_cli.report.figures.workers import load_ahead

            load_ahead()
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import find_experiment, load_with_files
        from auvid_cli.data.files import keep_apart
        from auvid_cli.data.results_folder import products

        loaded, files = load_with_files(find_experiment(experiment), overrides(settings, seed))
        if dry_run:
            pipeline.print_settings(loaded)
            return
        chosen = loaded.identification.with_judge(filters or loaded.identification.by_default())
        loaded.identification.check_filters(chosen)
        terminal = Terminal(quiet, verbose)
        folder = pipeline.results_folder(loaded, output)
        keep_apart(products(folder), files)
        with pipeline.drawing(folder) as figures:
            # The filters know nothing of vehicles, so the halves have no function in common.
            with terminal.compiling_beside("auvid_cli.filters.square_root", "auvid_cli.filters.information"):
                dataset = pipeline.simulate_to(folder, loaded, terminal, files, overwrite, chosen)
                with terminal.compiling():
                    import auvid_cli.identification.process  # noqa: F401
            figures.add_path(dataset)
            prepared = pipeline.prepare(dataset, terminal)
            bounds_of = pipeline.bounds_of(prepared, terminal)

            def on_estimate(estimate: "Estimate") -> None:
                figures.add_innovations(estimate)
                # The same for all filters, and known before the slowest of them is done.
                bounds_of(estimate)

            estimates = pipeline.identify_to(folder, prepared, chosen, terminal, overwrite, on_estimate)
            raise typer.Exit(pipeline.report_to(folder, prepared, estimates, bounds_of, terminal, figures))
