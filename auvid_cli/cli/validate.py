"""auvid validate."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli.exit_codes import DONE, VERDICT_FAILED
from auvid_cli.cli.options import (
    FigureFormatOption,
    OpenOption,
    OutputOption,
    OverwriteOption,
    QuietOption,
    UseOption,
    VerboseVerdictsOption,
    overrides,
    refuse_log,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors

if TYPE_CHECKING:
    from auvid_cli.data.dataset import Dataset
    from auvid_cli.data.estimate import Estimate


def validate(
    estimate_file: Annotated[
        Path, typer.Argument(metavar="ESTIMATE", help="Estimate file (.h5), e.g. results/spiral/estimates/ckf.h5.")
    ],
    dataset_files: Annotated[
        list[Path],
        typer.Argument(metavar="DATASET", help="Dataset files (.h5) of other runs than it was made from."),
    ],
    use: UseOption = None,
    anew: Annotated[
        bool, typer.Option("--anew", help="Find thrust, fin trims and ballast anew in each run, constants too.")
    ] = False,
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    figure_format: FigureFormatOption = None,
    show: OpenOption = False,
    quiet: QuietOption = False,
    verbose: VerboseVerdictsOption = False,
) -> None:
    """Say how well an identified model predicts a run that it has not seen; exit code 1 if it does not.

    The estimate's vehicle and coefficients move by the dataset's inputs alone: in one free run, and from many starts
    over horizons of 0.5 to 50 s. The errors stand beside those of the prior, of a motion that goes on unchanged, and
    beside what the stated uncertainties amount to. Several datasets, and all segments of each (--use, of all of them),
    are judged together; the results stand beside the first.
    """
    with reporting_errors() as command:
        from auvid_cli.api.files import read_dataset, read_estimate
        from auvid_cli.data.estimate_file import read_reference
        from auvid_cli.data.files import keep_apart
        from auvid_cli.data.hdf5 import scan
        from auvid_cli.data.replacement import put_copy, refuse_other_page
        from auvid_cli.data.results_folder import folder_of_dataset, locked, tables_and_figures

        terminal = Terminal(quiet, verbose)
        for path in dataset_files:
            refuse_log(path)
        scan([estimate_file, *dataset_files])
        estimate = read_estimate(estimate_file)
        datasets = [read_dataset(path, *overrides(None, use=use)) for path in dataset_files]
        with terminal.compiling():
            from auvid_cli.api import core
            from auvid_cli.api.validation import predict, unseen_segments
            from auvid_cli.cli.browser import open_page
            from auvid_cli.cli.tables import write_and_draw
            from auvid_cli.report.page.validation_page import validation_page
            from auvid_cli.report.validation_screen import print_validation

            core.load_sensors()
        with terminal.stage("compare with the estimate's own data"):
            training = _dataset_behind(estimate_file, estimate)
            segments = [part for dataset in datasets for part in unseen_segments(dataset, estimate, training)]
        folder, inputs = output or folder_of_dataset(dataset_files[0]), [estimate_file, *dataset_files]
        page = folder / "validation.html"
        command.enter_context(locked(folder))
        refuse_other_page(page)
        put_copy(dataset_files[0], datasets[0], folder, inputs, overwrite)
        keep_apart(tables_and_figures(folder), inputs)
        with terminal.stage("predict"):
            judge = read_reference(estimate_file, estimate)
            validation = predict(segments, estimate, training, anew=anew, reference=judge)
        tables = validation.tables()
        laid_out = page, lambda: validation_page(validation)
        paths = write_and_draw(
            folder, tables, lambda figures: figures.add_validation(validation), laid_out, terminal, figure_format
        )
        print_validation(terminal.out, validation, passed=verbose)
        terminal.say_all(paths)
        if show:
            open_page(page, terminal)
        raise typer.Exit(VERDICT_FAILED if validation.checks.failed() else DONE)


def _dataset_behind(path: Path, estimate: "Estimate") -> "Dataset | None":
    """Read what an estimate of a results folder was made from, if it is still there."""
    from auvid_cli.api.files import read_dataset
    from auvid_cli.data.netcdf import digest

    dataset = path.resolve().parents[1] / "dataset.h5"
    if dataset.is_file() and digest(dataset) == estimate.dataset_sha256:
        return read_dataset(dataset)
    return None
