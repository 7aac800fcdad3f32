"""auvid export."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli.options import OverwriteOption, QuietOption, VerboseOption, refuse_log
from auvid_cli.cli.terminal import Terminal, reporting_errors
from auvid_cli.config.format_name import FormatName

if TYPE_CHECKING:
    from auvid_cli.data.dataset import Dataset


def export(
    path: Annotated[Path, typer.Argument(metavar="ESTIMATE", help="Estimate file, results/NAME/estimates/FILTER.h5.")],
    target: Annotated[
        FormatName,
        typer.Option(
            "--to",
            metavar="FORM",
            help=f"Form of the model, {', '.join(form.value for form in FormatName if not form.is_of_a_run)}, "
            "or of the run, mcap.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="File to write. Default: export/VEHICLE_FILTER.* in the results folder.",
            show_default=False,
        ),
    ] = None,
    dataset: Annotated[
        Path | None,
        typer.Option(
            "--dataset",
            metavar="DATASET",
            help="Dataset that the estimate was made from. Default: dataset.h5 of the results folder.",
            show_default=False,
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Write an identified model, or with `--to mcap` a whole run, for other programs, and say what they cannot hold."""
    with reporting_errors():
        from auvid_cli.data.estimate_file import read_estimate
        from auvid_cli.data.files import keep_apart
        from auvid_cli.data.hdf5 import scan
        from auvid_cli.data.replacement import refuse_unless
        from auvid_cli.data.results_folder import exported_from

        terminal = Terminal(quiet, verbose)
        home = path.parent.parent if path.parent.name == "estimates" else path.parent
        dataset_file = dataset or home / "dataset.h5"
        refuse_log(dataset_file)
        scan([path, dataset_file])
        estimate = read_estimate(path)
        data = _dataset_of(path, estimate.dataset_sha256, dataset_file)
        if target.is_of_a_run:
            from auvid_cli.api.recordings import RunExport

            exported = RunExport(data, estimate, path)
        else:
            with terminal.compiling():
                from auvid_cli.api.models import Export
            with terminal.stage("bounds"):
                exported = Export(data, estimate, target, path)
        file = output or home / "export" / exported.file_name
        keep_apart([file], [path, dataset_file])
        if file.exists() and exported_from(file) != data.sha256:
            refuse_unless(overwrite, f"{file}: is there, and was not exported from the same data")
        exported.write(file)
        terminal.say_all([*exported.remarks, file])


def _dataset_of(path: Path, sha256: str, dataset: Path) -> "Dataset":
    from auvid_cli.data.dataset_file import read_dataset
    from auvid_cli.errors import FileError

    if not dataset.is_file():
        raise FileError(f"{dataset}: no such dataset; name the one that {path} was made from with --dataset")
    data = read_dataset(dataset)
    if data.sha256 != sha256:
        raise FileError(f"{dataset}: is not the dataset that {path} was made from; name that one with --dataset")
    return data
