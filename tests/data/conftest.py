"""Small data files, written once and copied for every test that harms one."""

import shutil

import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.data import estimate_file
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.dataset_file import write_dataset
from auvid_cli.identification.run import identify


@pytest.fixture(scope="session")
def dataset(simulated_with):
    """Two seconds with a few lost samples."""
    return simulated_with("manoeuvre.duration=2 s", "sensors.dvl.dropout_probability=0.3")


@pytest.fixture(scope="session")
def estimate(dataset):
    """By the TUKF, of three coefficients with the others held."""
    chosen = dataset.experiment.identification.model_copy(update={"coefficients": ("X_u|u|", "Z_uude", "N_uudr")})
    experiment = dataset.experiment.model_copy(update={"identification": chosen})
    return identify(Dataset(dataset.inputs, dataset.sensors, experiment, sha256="0123abcd" * 8), FilterName.TUKF)


@pytest.fixture(scope="session")
def write_estimate():
    """Function: write an estimate all in one part."""
    return estimate_file.write_estimate


@pytest.fixture(scope="session")
def written(dataset, estimate, write_estimate, tmp_path_factory):
    """Both files by kind."""
    folder = tmp_path_factory.mktemp("written")
    write_dataset(folder / "dataset.h5", dataset)
    write_estimate(folder / "estimate.h5", estimate)
    return {"dataset": folder / "dataset.h5", "estimate": folder / "estimate.h5"}


@pytest.fixture(params=["dataset", "estimate"])
def kind(request):
    """Of data file."""
    return request.param


@pytest.fixture
def copy(kind, written, tmp_path):
    """A file of that kind to do harm to."""
    return shutil.copy(written[kind], tmp_path / f"{kind}.h5")
