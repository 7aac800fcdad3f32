"""No Python file of the working folder is executed, whatever its name and whichever process looks for it."""

import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
from scipy.io import savemat

NAMES = (
    *("pickle", "signal", "struct", "socket", "random", "tempfile", "copyreg", "json", "logging", "ctypes", "string"),
    *("numpy", "scipy", "h5py", "matplotlib", "numba", "dask", "distributed", "sitecustomize", "usercustomize"),
)
CAMPAIGN = """\
name: small
settings: {manoeuvre.duration: 5 s, identification.judge: false}
seeds: 1
filters: [ekf]
"""
SHORT = "--set=manoeuvre.duration=2 s"


@pytest.fixture
def trapped(tmp_path, tmp_path_factory):
    """Function: runs auvid in a folder full of modules that note that they were executed; returns what did."""
    for name in NAMES:
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'a').write({name!r} + ' ')\n")
    # Start the command as pip installs it: Python searches the folder of the program first, not the working folder.
    program = tmp_path_factory.mktemp("bin") / "auvid"
    program.write_text("from auvid_cli.__main__ import main\nif __name__ == '__main__':\n    main()\n")

    def run(*arguments: str) -> str:
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
        command = [sys.executable, program, *arguments]
        ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert ended.returncode in (0, 1), ended.stderr
        assert "Traceback" not in ended.stderr
        executed = tmp_path / "executed"
        return executed.read_text() if executed.exists() else ""

    return run


@pytest.mark.slow
def test_run_executes_no_file_of_the_working_folder(trapped, tmp_path):
    assert trapped("run", SHORT, "--filter=ekf", "-o", "out") == ""
    assert (tmp_path / "out/report.html").is_file()
    assert list((tmp_path / "out/figures").iterdir())
    # The scan of the files that another process wrote.
    assert trapped("check", "out") == ""


@pytest.mark.slow
def test_campaign_executes_no_file_of_the_working_folder(trapped, tmp_path):
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN)
    assert trapped("campaign", "campaign.yaml", "-o", "out", "--workers=1") == ""
    assert list((tmp_path / "out").rglob("*.parquet"))


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
