"""What may take the place of results that stand in a folder.

A folder belongs to one dataset, its `dataset.h5`: all other results there are made from that, and its estimates with
the same settings. What would break this is refused, unless the user says that it may replace what stands there.
"""

import shutil
from collections.abc import Callable, Collection, Iterable
from functools import partial
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


class _Made(FileAttributes):
    """Settings by which a file was made, and of an estimate the data."""

    settings: str
    dataset_sha256: str = ""


def refuse_unless(overwrite: bool, objection: str) -> None:
    """Refuse to replace what stands in the way, if anything does, and say how to go on.

    Raises
    ------
    FileError
        If there is an objection, and the user has not said that it may be replaced.
    """
    if objection and not overwrite:
        raise FileError(f"{objection}; name another place with --output, or replace it with --overwrite")


def put_dataset(path: Path, dataset: Dataset, inputs: Iterable[Path], overwrite: bool, objection: str) -> None:
    """Write a dataset, unless the very same stands there: then what was made from it remains true.

    Parameters
    ----------
    path : pathlib.Path
    dataset : Dataset
    inputs : iterable of pathlib.Path
        What it was made from, and may not be lost.
    overwrite : bool
        Whether anything else that stands there may be replaced.
    objection : str
        What `other_run` says of it.

    Raises
    ------
    FileError
        If it may not, or cannot.
    """
    if path.exists() and not objection:
        if holds_data(path, dataset):
            return
        objection = f"{path}: holds other data than auvid {__version__} makes by the same settings"
    refuse_unless(overwrite, objection)
    _replace(path, inputs, partial(write_dataset, path, dataset))


def put_copy(path: Path, dataset: Dataset, folder: Path, inputs: Iterable[Path], overwrite: bool) -> None:
    """Copy a dataset's file into a results folder, so that all that is made from it stands beside it.

    Parameters
    ----------
    path : pathlib.Path
    dataset : Dataset
        That was read from it.
    folder : pathlib.Path
    inputs, overwrite
        As of `put_dataset`.

    Raises
    ------
    FileError
        If results of other data stand there, and may not be replaced.
    """
    copy = dataset_in(folder)
    objection = "" if copy.exists() else _without_dataset(folder)
    if copy.exists():
        if copy.is_file() and digest(copy) == dataset.sha256:
            return
        objection = f"{copy}: holds other data than {path}"
    refuse_unless(overwrite, objection)
    _replace(copy, [path, *inputs], partial(_copy, path, copy))


def _copy(path: Path, copy: Path) -> None:
    with replacing(copy) as temporary:
        shutil.copyfile(path, temporary)


def _replace(path: Path, inputs: Iterable[Path], write: Callable[[], object]) -> None:
    """Write a dataset, and then take away what was made from the one that stood there before."""
    made_from_it = products(path.parent) if path == dataset_in(path.parent) else []
    keep_apart([path, *made_from_it], inputs)
    write()
    remove(made_from_it)


def refuse_other_page(path: Path) -> None:
    """Refuse to write a page over another file than a page of auvid's.

    Raises
    ------
    FileError
        If such a file stands there.
    """
    if path.exists() and not is_page(path):
        raise FileError(f"{path}: is not a page of auvid's, and would be written over; move it away")


def other_run(path: Path, experiment: RunSettings) -> str:
    """Say what of another run than an experiment's stands where its dataset is to go; empty if nothing does."""
    if path.exists():
        return _difference(path, "dataset", experiment)
    return _without_dataset(path.parent) if path == dataset_in(path.parent) else ""


def other_estimates(
    folder: Path, experiment: RunSettings, sha256: str, filters: Collection[FilterName]
) -> dict[Path, str]:
    """Find the estimates in a folder beside which those of some filters may not stand, and why.

    Parameters
    ----------
    folder : pathlib.Path
    experiment : RunSettings
        By which the filters are run.
    sha256 : str
        Of the dataset.
    filters : collection of FilterName
        Of these the settings that are theirs alone count as well.
    """
    others, estimates = {}, estimates_in(folder)
    scan(estimates.values())
    for name, path in estimates.items():
        if why := _difference(path, "estimate", experiment, name if name in filters else None, sha256):
            others[path] = why
    return others


def _without_dataset(folder: Path) -> str:
    results = [*estimates_in(folder).values(), *tables_and_figures(folder)]
    return f"{results[0]}: was made from data that are no longer there" if results else ""


def _difference(
    path: Path, kind: str, experiment: RunSettings, filter_name: FilterName | None = None, sha256: str = ""
) -> str:
    """Say why a file does not go with an experiment; empty if it does."""
    if not path.is_file():
        return f"{path}: is no file"
    try:
        with open_file(path, kind) as file:
            made = read_attributes(file, _Made)
            if sha256 and made.dataset_sha256 != sha256:
                return f"{path}: was made from other data"
        if made.settings == dump_experiment(experiment):
            return ""
        there = parse_run(made.settings, f"{path} (settings)")
    except AuvidError as error:
        # Whatever it is, it is not what would be written.
        return one_line(str(error).splitlines()[0])
    here = experiment
    if kind == "estimate":
        here, there = (_settings_for(filter_name, run) for run in (here, there))
    parts = [part for part in type(here).model_fields if getattr(here, part) != getattr(there, part, None)]
    return f"{path}: was made with other settings of {', '.join(f'`{part}`' for part in parts)}" if parts else ""


def _settings_for(filter_name: FilterName | None, run: RunSettings) -> RunSettings:
    """Return a run's settings without those that concern other filters alone, and without its name."""
    identification = run.identification.of_filter(filter_name)
    return run.model_copy(update={"name": "", "identification": identification})
