"""Export of identified models and runs to other programs."""

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import NamedTuple

from auvid_cli._version import __version__
from auvid_cli.api import Progress
from auvid_cli.api.files import (
    check_same_dataset,
    checked,
    estimate_and_file,
    read_dataset,
    read_estimate,
    refuse_to_replace,
)
from auvid_cli.config.enums import FormatName, named
from auvid_cli.config.loading import dump_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import read_reference
from auvid_cli.data.files import check_no_overlap, exported_from, folder_of_estimate, locked, write_text
from auvid_cli.data.hdf5 import scan
from auvid_cli.data.netcdf import digest
from auvid_cli.data.results import refuse_unless
from auvid_cli.errors import ConfigError, FileError
from auvid_cli.evaluation.judgement import judge_one
from auvid_cli.export.formats import FORMATS, check_stem, file_stem
from auvid_cli.export.model import model_found_by
from auvid_cli.export.recording import RECORDING_LOSSES, topics_of, write_mcap
from auvid_cli.export.unsupported_features import caveats, caveats_of, unsupported_lines


class Export(NamedTuple):
    """A model or a run in one format."""

    file_name: str  # default name of the file
    remarks: list[str]  # caveats, and features that the format does not support
    write: Callable[[Path], None]  # writes a file; an existing one is replaced


def _model_export(
    dataset: Dataset, estimate: Estimate, target: FormatName, source: Path | None
) -> tuple[Export, Callable[[Path], str]]:
    """Return the export of a model, and a function that returns the text for a file, named like the file.

    `source` is the file of the estimate, which ``smoother.h5`` in the same folder judges; None if it is only in memory.
    """
    sha256, reference = ("", None) if source is None else (digest(source), read_reference(source, estimate))
    if target.is_of_a_run:
        raise ConfigError(f"{target}: is a format of runs; expected a format of models. Use export_run")
    form, model = FORMATS[target], model_found_by(estimate, dataset, sha256, reference)
    unsupported = form.unsupported(model)

    def text(file: Path) -> str:
        check_stem(target, file.stem)
        return form.file_text(model, unsupported, file.stem)

    name = f"{file_stem(model.experiment.vehicle.name, model.filter)}{form.suffix}"
    remarks = [*caveats(model), *unsupported_lines(unsupported)]
    return Export(name, remarks, lambda file: write_text(file, text(file))), text


def _run_export(dataset: Dataset, estimate: Estimate, source: Path | None) -> Export:
    """Return a run as an MCAP file; see `_model_export` for `source`."""
    topics = topics_of(dataset, estimate)
    origin = {
        "made from": f"the dataset with SHA-256 {dataset.sha256}" if dataset.sha256 else "a dataset in memory",
        "auvid": __version__,
        "filter": estimate.filter,
        "status": estimate.status,
        "settings": dump_experiment(estimate.experiment),
    }
    reference = None if source is None else read_reference(source, estimate)
    return Export(
        f"{file_stem(estimate.experiment.vehicle.name, estimate.filter)}.mcap",
        [*caveats_of(judge_one(estimate, reference)), *RECORDING_LOSSES],
        lambda file: write_mcap(file, topics, origin),
    )


def _refuse_inputs(file: Path, dataset: Dataset, source: Path | None) -> None:
    """Raise a FileError if a file to be written is the estimate or the dataset."""
    check_no_overlap([file], [] if source is None else [source])
    refuse_to_replace(dataset, file)


@checked
def export_model(dataset: Dataset, estimate: Estimate | str | Path, target: str, file: str | Path | None = None) -> str:
    """Return an estimate as a model for another program. Its header lists unsupported features.

    Parameters
    ----------
    dataset : Dataset
        Dataset of the estimate.
    estimate : Estimate, str or pathlib.Path
        In memory, or a file. A coefficient counts as identified if the estimate is sound; ``smoother.h5`` in the same
        folder judges the estimate of a filter.
    target : str
        ``"yaml"`` (a vehicle file), ``"json"``, ``"python"`` (needs only NumPy), ``"matlab"``, ``"sdf"`` (Gazebo),
        ``"holoocean"``, ``"simulator"`` (Python Vehicle Simulator) or ``"mss"`` (Marine Systems Simulator).
    file : str or pathlib.Path, optional
        File to write; an existing file is replaced. Default: none.

    Returns
    -------
    str
        The text of the model.

    Raises
    ------
    ConfigError
        If the format is unknown, or does not allow the name of the file.
    DataError
        If the filter diverged, or the estimate was made from another dataset.
    FileError
        If reading or writing fails, or the file is the dataset itself.

    Examples
    --------
    >>> text = auvid.export_model(dataset, estimate, "python", "vehicle.py")
    >>> "def " in text
    True
    """
    form = named(FormatName, target, "format of a model")
    found, source = estimate_and_file(estimate)
    check_same_dataset(dataset, [found])
    export, text_of = _model_export(dataset, found, form, source)
    text = text_of(Path(export.file_name if file is None else file))
    if file is not None:
        _refuse_inputs(Path(file), dataset, source)
        write_text(Path(file), text)
    return text


@checked
def export_run(dataset: Dataset, estimate: Estimate | str | Path, file: str | Path) -> Path:
    """Write a run as an MCAP file, for Foxglove, Rerun and ROS 2.

    ``/pose``, ``/velocity``, ``/path`` and ``/tf`` are the estimated motion, dead reckoned from the first position, in
    the axes of ROS: east, north, up, and forward, port, up (REP 103). ``/states`` has all estimated states with the
    coefficients, and ``/innovations/SENSOR`` each measurement minus its prediction, both with standard deviations, SI.
    ``/truth`` is the true motion of a simulation. This function needs the extra ``ros``.

    Parameters
    ----------
    dataset : Dataset
        Dataset of the estimate.
    estimate : Estimate, str or pathlib.Path
        In memory, or a file. It may have diverged.
    file : str or pathlib.Path
        File to write; an existing file is replaced.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    DataError
        If the estimate was made from another dataset, or its times are outside the range of ROS.
    FileError
        If reading or writing fails, the file is the dataset itself, or mcap or rosbags is not installed.

    Examples
    --------
    >>> auvid.export_run(dataset, estimate, "dive.mcap").name
    'dive.mcap'
    """
    found, source = estimate_and_file(estimate)
    check_same_dataset(dataset, [found])
    export = _run_export(dataset, found, source)
    _refuse_inputs(Path(file), dataset, source)
    export.write(Path(file))
    return Path(file)


def export_into(
    file: Path | None, path: Path, target: FormatName, dataset: Path | None, overwrite: bool, progress: Progress
) -> tuple[Path, list[str]]:
    """Export the model or the run of an estimate file; returns the written file, and remarks.

    Parameters
    ----------
    file : pathlib.Path or None
        None: ``export/VEHICLE_FILTER.*`` in the results folder.
    path : pathlib.Path
        Estimate file.
    dataset : pathlib.Path or None
        Dataset file of the estimate. None: dataset.h5 in its results folder.
    overwrite : bool
        Whether to replace a file that was not exported from the same data.
    """
    folder = folder_of_estimate(path)
    dataset_file = dataset or folder / "dataset.h5"
    scan([path, dataset_file])
    estimate = read_estimate(path)
    if not dataset_file.is_file():
        raise FileError(f"{dataset_file}: dataset not found; choose the dataset of {path} with --dataset")
    data = read_dataset(dataset_file)
    if data.sha256 != estimate.dataset_sha256:
        raise FileError(f"{dataset_file}: is not the dataset of {path}; choose that dataset with --dataset")
    with progress.stage("bounds"):
        if target.is_of_a_run:
            export = _run_export(data, estimate, path)
        else:
            export, _ = _model_export(data, estimate, target, path)
    found = file or folder / "export" / export.file_name
    check_no_overlap([found], [path, dataset_file])
    with locked(folder) if file is None else nullcontext():
        if found.exists() and exported_from(found) != data.sha256:
            refuse_unless(overwrite, f"{found}: exists, and was not exported from the same data")
        export.write(found)
    return found, export.remarks
