"""auvid identifiability."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli.options import (
    DataArgument,
    FigureFormatOption,
    OpenOption,
    OutputOption,
    OverwriteOption,
    QuietOption,
    SeedOption,
    SetOption,
    UseOption,
    VerboseOption,
    dataset_path,
    overrides,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors

if TYPE_CHECKING:
    from auvid_cli.data.dataset import Dataset


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
    figure_format: FigureFormatOption = None,
    show: OpenOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Say what data can tell of each coefficient at best, before any filter runs.

    An experiment is simulated for it, a dataset file taken as it is. The bounds hold at the true coefficients of a
    simulation, else at those of the vehicle file.
    """
    with reporting_errors() as command:
        from auvid_cli.api.files import read_dataset
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import find_experiment, load_with_files
        from auvid_cli.data.files import keep_apart
        from auvid_cli.data.replacement import put_copy
        from auvid_cli.data.results_folder import folder_of_dataset, folder_of_run, locked, tables_and_figures

        terminal = Terminal(quiet, verbose)
        changes, path = overrides(settings, seed, use), dataset_path(data)
        earlier = [] if at is None else [at]
        if path:
            dataset, folder = read_dataset(path, *changes), output or folder_of_dataset(path)
            command.enter_context(locked(folder))
            page = _page_in(folder)
            files = [path, *dataset.experiment.data_files(), *earlier]
            put_copy(path, dataset, folder, files, overwrite)
        else:
            experiment, files = load_with_files(find_experiment(data), changes)
            folder, files = output or folder_of_run(experiment.name), [*files, *earlier]
            command.enter_context(locked(folder))
            page = _page_in(folder)
            dataset = pipeline.simulate_to(folder, experiment, terminal, files, overwrite)
        keep_apart(tables_and_figures(folder), files)
        coefficients, where = _at(dataset, at)
        with terminal.compiling():
            from auvid_cli.api import core
            from auvid_cli.api.identifiability import identifiability as assess
            from auvid_cli.cli.browser import open_page
            from auvid_cli.cli.tables import write_and_draw
            from auvid_cli.report.page.identifiability_page import identifiability_page
            from auvid_cli.report.screen import print_identifiability

            core.load_sensors()
        with terminal.stage("sensitivities"):
            bounds = assess(dataset, coefficients)
        laid_out = page, lambda: identifiability_page(dataset, bounds, where)
        paths = write_and_draw(
            folder,
            bounds.tables(),
            lambda figures: figures.add_identifiability(bounds),
            laid_out,
            terminal,
            figure_format,
        )
        terminal.say(f"{dataset.experiment.vehicle.name}, at {where}:")
        print_identifiability(terminal.out, bounds)
        terminal.say_all(paths)
        if show:
            open_page(page, terminal)


def _page_in(folder: Path) -> Path:
    """Return where the page goes, before anything else is written there."""
    from auvid_cli.data.replacement import refuse_other_page

    page = folder / "identifiability.html"
    refuse_other_page(page)
    return page


def _at(dataset: "Dataset", estimate: Path | None) -> tuple[dict[str, float] | None, str]:
    """Return the coefficients of an estimate file, if one is named, and where all come from in words."""
    from auvid_cli.api.files import read_estimate

    if estimate is None:
        return None, "the true coefficients" if dataset.truth is not None else "those of the vehicle file"
    earlier, where = read_estimate(estimate), f"those of {estimate}"
    vehicle = earlier.experiment.vehicle.name
    if vehicle != dataset.experiment.vehicle.name:
        where += f", which is of another vehicle ({vehicle})"
    return earlier.final_coefficients(), where
