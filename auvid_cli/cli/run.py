"""auvid run."""

import typer

from auvid_cli.cli.options import (
    DryRunOption,
    ExperimentArgument,
    FigureFormatOption,
    FilterOption,
    OpenOption,
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


def run(
    experiment: ExperimentArgument = None,
    filters: FilterOption = None,
    settings: SetOption = None,
    seed: SeedOption = None,
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    figure_format: FigureFormatOption = None,
    show: OpenOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    dry_run: DryRunOption = False,
) -> None:
    """Simulate an experiment, identify with every filter named there, report: report.html, tables, figures."""
    with reporting_errors() as command:
        if not dry_run:
            from auvid_cli.report.figures.workers import load_ahead

            load_ahead()
        from auvid_cli.api import core
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import dump_experiment, find_experiment, load_with_files
        from auvid_cli.data.files import keep_apart
        from auvid_cli.data.replacement import refuse_other_page
        from auvid_cli.data.results_folder import folder_of_run, locked, page_in, products
        from auvid_cli.report.figures.draw import drawing

        refuse_log(experiment)
        loaded, files = load_with_files(find_experiment(experiment), overrides(settings, seed))
        if dry_run:
            print(dump_experiment(loaded), end="")
            return
        chosen = loaded.identification.with_judge(filters or loaded.identification.by_default())
        loaded.identification.check_filters(chosen)
        terminal = Terminal(quiet, verbose)
        folder = output or folder_of_run(loaded.name)
        command.enter_context(locked(folder))
        refuse_other_page(page_in(folder))
        keep_apart(products(folder), files)
        with drawing(folder, figure_format) as figures:
            with terminal.compiling_beside(*core.FILTERS):
                dataset = pipeline.simulate_to(folder, loaded, terminal, files, overwrite, chosen)
                with terminal.compiling():
                    core.load_vehicles()
            with terminal.compiling():
                from auvid_cli.api.evaluation import Evaluator
                from auvid_cli.api.preparation import prepare
            prepared = pipeline.settle(prepare(dataset), terminal)
            evaluator = Evaluator(prepared)
            # The same for all filters, and known before the slowest of them is done.
            estimates = pipeline.identify_to(folder, prepared, chosen, terminal, overwrite, evaluator.find_bounds)
            raise typer.Exit(pipeline.report_to(folder, evaluator, estimates, terminal, figures, show))
