"""No Python file of the working folder is executed, whatever its name and whichever process looks for it.

Those of a run and of a campaign are in `test_commands.py` and `test_campaign.py`.
"""

import subprocess

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from .conftest import ENVIRONMENT, PROGRAM, auvid, executed_traps, lay_traps


@pytest.fixture
def trapped(tmp_path):
    """Function: runs auvid in a folder full of modules that note that they were executed; returns what did."""
    lay_traps(tmp_path)

    def run(*arguments: str) -> str:
        command = [PROGRAM, *arguments]
        ended = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=False)
        assert ended.returncode in (0, 1), ended.stderr
        assert "Traceback" not in ended.stderr
        return executed_traps(tmp_path)

    return run


@pytest.mark.slow
def test_scan_of_a_file_executes_no_file_of_the_working_folder(trapped, tmp_path):
    """Another process wrote it, so that it is scanned in a child."""
    simulated = auvid("simulate", "--set", "manoeuvre.duration=2 s", "-o", tmp_path / "out")
    assert simulated.exit_code == 0
    assert trapped("identify", "out/dataset.h5", "-f", "ekf") == ""
    assert (tmp_path / "out/estimates/ekf.h5").is_file()


def matlab_7_3(path, columns):
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            file[name] = values[None]
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")


@pytest.mark.slow
@pytest.mark.parametrize("write", [savemat, matlab_7_3])
def test_import_of_matlab_files_executes_no_file_of_the_working_folder(write, trapped, tmp_path):
    time = np.arange(0.0, 20.0, 0.1)
    write(tmp_path / "log.mat", {"time": time, "depth": np.sin(time), "rudder": np.cos(time)})
    assert trapped("import", "--suggest", "log.mat", "-o", "map.yaml") == ""
    assert "rudder" in (tmp_path / "map.yaml").read_text()
