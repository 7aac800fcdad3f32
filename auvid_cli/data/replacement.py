"""Rules for replacing results in a folder.

A folder belongs to one dataset, its `dataset.h5`: all other results there are made from it, and its estimates with the
same settings. Replacing what would break this needs the user's permission.
"""

import shutil
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

from auvid_cli import __version__
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.filter_name import FilterName
from auvid_cli.config.load import dump_experiment, parse_run
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.dataset_file import holds_data, write_dataset
from auvid_cli.data.files import keep_apart, replacing
from auvid_cli.data.hdf5 import scan
from auvid_cli.data.netcdf import digest
from auvid_cli.data.netcdf_reading import FileAttributes, open_file, read_attributes
from auvid_cli.data.results_folder import dataset_in, estimates_in, is_page, products, remove, tables_and_figures
from auvid_cli.errors import AuvidError, FileError
from auvid_cli.printable import one_line


class _Origin(FileAttributes):
    """Settings that made a file, and the dataset of an estimate."""

    settings: str
    dataset_sha256: str = ""


def refuse_unless(overwrite: bool, objection: str) -> None:
    """Raise a FileError with an objection, if there is one and the user does not allow to overwrite."""
    if objection and not overwrite:
        raise FileError(f"{objection}; name another place with --output, or replace it with --overwrite")


def put_dataset(path: Path, dataset: Dataset, inputs: Iterable[Path], overwrite: bool, objection: str) -> None:
    """Write a dataset, unless the file there has the same numbers: then everything made from it remains true.

    Parameters
    ----------
    path : pathlib.Path
    dataset : Dataset
    inputs : iterable of pathlib.Path
        Files that it was made from; never overwritten.
    overwrite : bool
        Whether other results may be replaced.
    objection : str
        Result of `other_run`.
    """
    if path.exists() and not objection:
        if holds_data(path, dataset):
            return
        objection = f"{path}: holds other data than auvid {__version__} makes by the same settings"
    refuse_unless(overwrite, objection)
    _replace(path, inputs, lambda: write_dataset(path, dataset))


def put_copy(path: Path, dataset: Dataset, folder: Path, inputs: Iterable[Path], overwrite: bool) -> None:
    """Copy the file of a dataset into a results folder, unless it is there; arguments as of `put_dataset`."""
    copy = dataset_in(folder)
    if copy.is_file() and digest(copy) == dataset.sha256:
        return
    refuse_unless(overwrite, f"{copy}: holds other data than {path}" if copy.exists() else _without_dataset(folder))

    def write() -> None:
        with replacing(copy) as temporary:
            shutil.copyfile(path, temporary)

    _replace(copy, [path, *inputs], write)


def _replace(path: Path, inputs: Iterable[Path], write: Callable[[], None]) -> None:
    """Write a dataset, then remove all that was made from the former one."""
    stale = products(path.parent) if path == dataset_in(path.parent) else []
    keep_apart([path, *stale], inputs)
    write()
    remove(stale)


def refuse_other_page(path: Path) -> None:
    """Raise a FileError if a file that is no page of auvid's has the name of a page."""
    if path.exists() and not is_page(path):
        raise FileError(f"{path}: is not a page of auvid's, and would be written over; move it away")


def other_run(path: Path, experiment: RunSettings) -> str:
    """Return the objection to writing the dataset of an experiment: results of another run; empty if none."""
    if path.exists():
        return _difference(path, "dataset", experiment)
    return _without_dataset(path.parent) if path == dataset_in(path.parent) else ""


def other_estimates(
    folder: Path, experiment: RunSettings, sha256: str, filters: Collection[FilterName]
) -> dict[Path, str]:
    """Return the estimates in a folder that do not go with a run, each with the reason.

    Parameters
    ----------
    folder : pathlib.Path
    experiment : RunSettings
        Settings of the run.
    sha256 : str
        Digest of its dataset.
    filters : collection of FilterName
        Filters of the run: settings that concern one filter alone are compared for these only.
    """
    estimates = estimates_in(folder)
    scan(estimates.values())
    reasons = {
        path: _difference(path, "estimate", experiment, name if name in filters else None, sha256)
        for name, path in estimates.items()
    }
    return {path: reason for path, reason in reasons.items() if reason}


def _without_dataset(folder: Path) -> str:
    results = [*estimates_in(folder).values(), *tables_and_figures(folder)]
    return f"{results[0]}: was made from data that are no longer there" if results else ""


def _difference(
    path: Path, kind: str, experiment: RunSettings, filter_name: FilterName | None = None, sha256: str = ""
) -> str:
    """Return the reason why a file does not go with an experiment; empty if it does."""
    if not path.is_file():
        return f"{path}: is no file"
    try:
        with open_file(path, kind) as file:
            origin = read_attributes(file, _Origin)
        if sha256 and origin.dataset_sha256 != sha256:
            return f"{path}: was made from other data"
        if origin.settings == dump_experiment(experiment):
            return ""
        there = parse_run(origin.settings, f"{path} (settings)")
    except AuvidError as error:
        return one_line(str(error).splitlines()[0])
    here = experiment
    if kind == "estimate":
        here, there = (
            run.model_copy(update={"name": "", "identification": run.identification.of_filter(filter_name)})
            for run in (here, there)
        )
    parts = [part for part in type(here).model_fields if getattr(here, part) != getattr(there, part, None)]
    return f"{path}: was made with other settings of {', '.join(f'`{part}`' for part in parts)}" if parts else ""
