"""No Python file of the working folder is executed, whatever its name and whichever process looks for it.

Those of a run and of a campaign are in `test_commands.py` and `test_campaign.py`.
"""

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from .conftest import auvid, run_among_traps


@pytest.mark.slow
def test_scan_of_a_file_executes_no_file_of_the_working_folder(tmp_path):
    """Another process wrote it, so that it is scanned in a child."""
    simulated = auvid("simulate", "--set", "manoeuvre.duration=2 s", "-o", tmp_path / "out")
    assert simulated.exit_code == 0
    assert run_among_traps(tmp_path, "identify", "out/dataset.h5", "-f", "ekf")[1] == ""
    assert (tmp_path / "out/estimates/ekf.h5").is_file()


def matlab_7_3(path, columns):
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            file[name] = values[None]
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")


@pytest.mark.slow
@pytest.mark.parametrize("write", [savemat, matlab_7_3])
def test_import_of_matlab_files_executes_no_file_of_the_working_folder(write, tmp_path):
    time = np.arange(0.0, 20.0, 0.1)
    write(tmp_path / "log.mat", {"time": time, "depth": np.sin(time), "rudder": np.cos(time)})
    assert run_among_traps(tmp_path, "import", "--suggest", "log.mat", "-o", "map.yaml")[1] == ""
    assert "rudder" in (tmp_path / "map.yaml").read_text()
