"""Reading what stands in a results folder, as far as it belongs together."""

from dataclasses import replace
from pathlib import Path

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.filter_name import JUDGE
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.dataset_file import read_dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.data.hdf5 import scan
from auvid_cli.data.replacement import other_estimates
from auvid_cli.data.results_folder import dataset_in, estimates_in
from auvid_cli.errors import FileError


def read_simulated(folder: Path, experiment: RunSettings) -> Dataset:
    """Read the simulated dataset of an experiment, with the experiment's present identification settings.

    Raises
    ------
    FileError
        If there is none, or if it was simulated with other settings than the experiment has now.
    """
    path = dataset_in(folder)
    if not path.is_file():
        raise FileError(f"{path}: no such dataset; make it with `auvid simulate`, or do all with `auvid run`")
    dataset = read_dataset(path)
    for part in ("seed", "vehicle", "sensors", "manoeuvre"):
        if getattr(dataset.experiment, part, None) != getattr(experiment, part, None):
            raise FileError(
                f"{path}: was simulated with other settings of `{part}` than the experiment has now; run "
                "`auvid simulate` again, give the same --set here, or name the dataset file to identify it as it is"
            )
    return replace(dataset, experiment=experiment)


def read_results(folder: Path) -> tuple[Dataset, list[Estimate]]:
    """Read dataset and estimates of a results folder, estimates in the order of `FilterName`.

    Raises
    ------
    FileError
        If something is missing or an estimate belongs to another dataset.
    """
    paths = estimates_in(folder)
    scan([dataset_in(folder), *paths.values()])
    dataset, estimates = read_dataset(dataset_in(folder)), [read_estimate(path) for path in paths.values()]
    if not estimates:
        raise FileError(f"{folder / 'estimates'}: no estimates; make them with `auvid identify`")
    for (name, path), estimate in zip(paths.items(), estimates, strict=True):
        if estimate.filter != name.value:
            raise FileError(f"{path}: is an estimate of {estimate.filter}; give it the name of its filter")
        if estimate.dataset_sha256 != dataset.sha256:
            raise FileError(
                f"{folder / 'estimates' / estimate.filter}.h5: was made from another dataset than "
                f"{folder / 'dataset.h5'}; run `auvid identify` again"
            )
    for why in other_estimates(folder, estimates[0].experiment, dataset.sha256, ()).values():
        raise FileError(f"{why} than that of {estimates[0].filter}, and tables show all together; identify again")
    if dataset.truth is None:
        # Nothing else says which of them is right.
        estimates.sort(key=lambda estimate: estimate.filter != JUDGE)
    return dataset, estimates
