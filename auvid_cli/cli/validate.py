"""auvid validate."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli.exit_codes import DONE, VERDICT_FAILED
from auvid_cli.cli.options import OutputOption, OverwriteOption, QuietOption, UseOption, VerboseOption, overrides
from auvid_cli.cli.terminal import Terminal, reporting_errors

if TYPE_CHECKING:
    from auvid_cli.data.dataset import Dataset
    from auvid_cli.data.estimate import Estimate


def validate(
    estimate_file: Annotated[
        Path, typer.Argument(metavar="ESTIMATE", help="Estimate file (.h5), e.g. results/spiral/estimates/ckf.h5.")
    ],
    dataset_file: Annotated[
        Path, typer.Argument(metavar="DATASET", help="Dataset file (.h5) of another run than it was made from.")
    ],
    use: UseOption = None,
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Say how well an identified model predicts a run that it has not seen; exit code 1 if it does not.

    The estimate's vehicle and coefficients move by the dataset's inputs alone: in one free run, and from many starts
    over horizons of 0.5 to 50 s. The errors stand beside those of the prior, of a motion that goes on unchanged, and
    beside what the stated uncertainties amount to.
    """
    with reporting_errors():
        from auvid_cli.cli import pipeline
        from auvid_cli.data.dataset_file import read_dataset
        from auvid_cli.data.estimate_file import read_estimate
        from auvid_cli.data.files import keep_apart
        from auvid_cli.data.replacement import put_copy
        from auvid_cli.data.results_folder import tables_and_figures
        from auvid_cli.data.screening import screen

        terminal = Terminal(quiet, verbose)
        screen([estimate_file, dataset_file])
        estimate, whole = read_estimate(estimate_file), read_dataset(dataset_file, overrides(None, use=use))
        with terminal.compiling():
            from auvid_cli.evaluation.estimate_checks import failed
            from auvid_cli.report.csv_tables import write_csv_tables
            from auvid_cli.report.validation_screen import print_validation
            from auvid_cli.validation.data_leakage import unseen_data
            from auvid_cli.validation.validate import validate as validated
        with terminal.stage("compare with the estimate's own data"):
            dataset = unseen_data(whole, estimate, _dataset_behind(estimate_file, estimate))
        folder = output or pipeline.home_of(dataset_file)
        put_copy(dataset_file, whole, folder, [estimate_file], overwrite)
        keep_apart(tables_and_figures(folder), [estimate_file, dataset_file])
        with terminal.stage("predict"):
            validation = validated(dataset, estimate)
        paths = write_csv_tables(validation.tables(), folder / "tables")
        with pipeline.drawing(folder) as figures, terminal.progress("figures") as (progress,):
            figures.add_validation(dataset, validation)
            paths += figures.finish(progress)
        print_validation(terminal.out, validation)
        for path in paths:
            terminal.say(str(path))
        raise typer.Exit(VERDICT_FAILED if failed(validation.checks) else DONE)


def _dataset_behind(path: Path, estimate: "Estimate") -> "Dataset | None":
    """Read what an estimate of a results folder was made from, if it is still there."""
    from auvid_cli.data.dataset_file import read_dataset
    from auvid_cli.data.netcdf import digest

    dataset = path.resolve().parents[1] / "dataset.h5"
    if dataset.is_file() and digest(dataset) == estimate.dataset_sha256:
        return read_dataset(dataset)
    return None
