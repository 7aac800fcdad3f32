"""Results folders: read datasets and estimates that belong together, and decide which results may be replaced."""

import shutil
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

from auvid_cli._version import __version__
from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.loading import dump_experiment, parse_run
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.dataset_file import holds_data, read_dataset, write_dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.data.files import (
    check_no_overlap,
    dataset_in,
    estimates_in,
    is_page,
    products,
    remove,
    replacing,
    tables_and_figures,
)
from auvid_cli.data.hdf5 import scan
from auvid_cli.data.netcdf import FileAttributes, digest, open_file, read_attributes
from auvid_cli.errors import AuvidError, FileError
from auvid_cli.text import one_line


class _Origin(FileAttributes):
    """Settings of a file, and the dataset of an estimate."""

    settings: str
    dataset_sha256: str = ""


def refuse_unless(overwrite: bool, objection: str) -> None:
    """Raise a FileError with an objection, unless it is empty or the user allows to overwrite."""
    if objection and not overwrite:
        raise FileError(f"{objection}; name another place with --output, or replace it with --overwrite")


def put_dataset(path: Path, dataset: Dataset, inputs: Iterable[Path], overwrite: bool, objection: str) -> None:
    """Write a dataset, unless the file has the same numbers already: then all results made from it stay valid.

    Parameters
    ----------
    path : pathlib.Path
    dataset : Dataset
    inputs : iterable of pathlib.Path
        Files that it was made from; they are never overwritten.
    overwrite : bool
        Whether results of another run may be replaced.
    objection : str
        Result of `other_run`.
    """
    if path.exists() and not objection:
        if holds_data(path, dataset):
            return
        objection = f"{path}: holds other data than auvid {__version__} makes from the same settings"
    refuse_unless(overwrite, objection)
    _replace(path, inputs, lambda: write_dataset(path, dataset))


def put_copy(path: Path, dataset: Dataset, folder: Path, inputs: Iterable[Path], overwrite: bool) -> None:
    """Copy the file of a dataset into a results folder, unless it is there; see `put_dataset`."""
    copy = dataset_in(folder)
    if copy.is_file() and digest(copy) == dataset.sha256:
        return
    refuse_unless(overwrite, f"{copy}: holds other data than {path}" if copy.exists() else _without_dataset(folder))

    def write() -> None:
        with replacing(copy) as temporary:
            shutil.copyfile(path, temporary)

    _replace(copy, [path, *inputs], write)


def _replace(path: Path, inputs: Iterable[Path], write: Callable[[], None]) -> None:
    """Write a dataset, then remove all results of the former one."""
    stale = products(path.parent) if path == dataset_in(path.parent) else []
    check_no_overlap([path, *stale], inputs)
    write()
    remove(stale)


def refuse_other_page(path: Path) -> None:
    """Raise a FileError if the path of a page has a file that auvid did not write."""
    if path.exists() and not is_page(path):
        raise FileError(f"{path}: is not a page of auvid's, and would be written over; move it away")


def other_run(path: Path, experiment: RunSettings) -> str:
    """Return an objection if the dataset of an experiment would replace results of another run; otherwise ""."""
    if path.exists():
        return _difference(path, "dataset", experiment)
    return _without_dataset(path.parent) if path == dataset_in(path.parent) else ""


def other_estimates(
    folder: Path, experiment: RunSettings, sha256: str, filters: Collection[FilterName]
) -> dict[Path, str]:
    """Return the estimates in a folder that do not belong to a run, with the reasons.

    `sha256` is the digest of the dataset of the run; settings of a single filter are compared only for `filters`.
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
    return f"{results[0]}: was made from a dataset that is missing now" if results else ""


def _difference(
    path: Path, kind: str, experiment: RunSettings, filter_name: FilterName | None = None, sha256: str = ""
) -> str:
    """Return the reason why a file does not belong to an experiment; empty if it does."""
    if not path.is_file():
        return f"{path}: is not a file"
    try:
        with open_file(path, kind) as file:
            origin = read_attributes(file, _Origin)
        if sha256 and origin.dataset_sha256 != sha256:
            return f"{path}: was made from other data"
        if origin.settings == dump_experiment(experiment):
            return ""
        former = parse_run(origin.settings, f"{path} (settings)")
    except AuvidError as error:
        return one_line(str(error).splitlines()[0])
    if kind == "estimate":
        experiment, former = (
            run.model_copy(update={"name": "", "identification": run.identification.for_filter(filter_name)})
            for run in (experiment, former)
        )
    parts = [part for part in type(experiment).model_fields if getattr(experiment, part) != getattr(former, part, None)]
    return f"{path}: was made with other settings of {', '.join(f'`{part}`' for part in parts)}" if parts else ""


def read_simulated(folder: Path, experiment: RunSettings) -> Dataset:
    """Read the simulated dataset of an experiment, with its current identification settings.

    Raises
    ------
    FileError
        If it is missing, or was simulated with other settings.
    """
    path = dataset_in(folder)
    if not path.is_file():
        raise FileError(f"{path}: no such dataset; make it with `auvid simulate`, or use `auvid run`")
    dataset = read_dataset(path)
    for part in ("seed", "vehicle", "sensors", "manoeuvre"):
        if getattr(dataset.experiment, part, None) != getattr(experiment, part, None):
            raise FileError(
                f"{path}: was simulated with other settings of `{part}`; run `auvid simulate` again, give the same "
                "--set here, or name the dataset file to identify it as it is"
            )
    return dataset.with_settings(experiment)


def read_results(folder: Path) -> tuple[Dataset, list[Estimate]]:
    """Read dataset and estimates of a results folder, estimates in the order of `FilterName`.

    Raises
    ------
    FileError
        If a file is missing or an estimate is of another dataset.
    """
    paths = estimates_in(folder)
    scan([dataset_in(folder), *paths.values()])
    dataset, estimates = read_dataset(dataset_in(folder)), [read_estimate(path) for path in paths.values()]
    if not estimates:
        raise FileError(f"{folder / 'estimates'}: no estimates; make them with `auvid identify`")
    for (name, path), estimate in zip(paths.items(), estimates, strict=True):
        if estimate.filter != name.value:
            raise FileError(f"{path}: is an estimate of {estimate.filter}; rename the file to {estimate.filter}.h5")
        if estimate.dataset_sha256 != dataset.sha256:
            raise FileError(
                f"{folder / 'estimates' / estimate.filter}.h5: was made from another dataset than "
                f"{folder / 'dataset.h5'}; run `auvid identify` again"
            )
    for why in other_estimates(folder, estimates[0].experiment, dataset.sha256, ()).values():
        raise FileError(f"{why} than {estimates[0].filter}, and tables show all together; run `auvid identify` again")
    if dataset.truth is None:
        # Without a truth the judge is the reference, and comes first.
        estimates.sort(key=lambda estimate: estimate.filter != JUDGE)
    return dataset, estimates
