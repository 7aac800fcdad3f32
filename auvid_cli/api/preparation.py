"""Data prepared once for all that goes through them, and whether estimates were made from them."""

from collections.abc import Iterable
from pathlib import Path

from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.data.netcdf import digest
from auvid_cli.errors import DataError, FileError
from auvid_cli.identification.prepared_data import PreparedData, prepare

__all__ = ["estimate_and_file", "prepare", "prepare_checked", "refuse_estimates_of_others", "refuse_to_replace"]


def prepare_checked(dataset: Dataset, *estimates: Estimate) -> PreparedData:
    """Prepare a dataset to evaluate estimates, after a look at whether they were made from it.

    Raises
    ------
    DataError
        If the dataset of an estimate is another, or nothing of the data can be used.
    """
    refuse_estimates_of_others(dataset, estimates)
    return prepare(dataset)


def estimate_and_file(estimate: Estimate | str | Path) -> tuple[Estimate, Path | None]:
    """Return an estimate in memory as it is, or that of a file, and the file."""
    if isinstance(estimate, Estimate):
        return estimate, None
    return read_estimate(Path(estimate)), Path(estimate)


def refuse_estimates_of_others(dataset: Dataset, estimates: Iterable[Estimate]) -> None:
    """Refuse estimates of other data, as far as files tell: what was in no file may be of any.

    Raises
    ------
    DataError
        If the dataset of an estimate is another.
    """
    for estimate in estimates:
        if estimate.dataset_sha256 and dataset.sha256 and estimate.dataset_sha256 != dataset.sha256:
            raise DataError(f"the estimate of {estimate.filter} was made from another dataset than this one")


def refuse_to_replace(dataset: Dataset, file: Path) -> None:
    """Refuse to write where the dataset stands: what was recorded cannot be made again.

    Raises
    ------
    FileError
        If the file is that of the dataset.
    """
    if dataset.sha256 and file.is_file() and digest(file) == dataset.sha256:
        raise FileError(f"{file}: is the dataset itself, and would be lost; name another file")
