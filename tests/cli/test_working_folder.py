"""No Python file of the working folder is executed, whatever its name and whichever process looks for it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

NAMES = (
    *("pickle", "signal", "struct", "socket", "random", "tempfile", "copyreg", "json", "logging", "ctypes", "string"),
    *("numpy", "scipy", "h5py", "matplotlib", "numba", "dask", "distributed", "sitecustomize", "usercustomize"),
)
MAP = """
vehicle: vt690
time: {{format: s}}
inputs: {{log: {log}, time: t, delta_r: {{column: u, unit: rad}}}}
sensors: {{depth: {{log: {log}, time: t, d: {{column: u, unit: m}}, noise: {{d: 0.1 m}}}}}}
"""
CAMPAIGN = """
base: {experiment: vt690_zigzag, manoeuvre: {duration: 2 s}}
filters: [ekf]
seeds: 2
"""
SHORT = "--set=manoeuvre.duration=2 s"


@pytest.fixture
def trapped(tmp_path):
    """Function: runs auvid in a folder full of modules that note that they were executed; returns what did."""
    for name in NAMES:
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'a').write({name!r} + ' ')\n")
    start = Path(sys.executable).with_name("auvid_for_test")
    program = tmp_path.parent / f"{tmp_path.name}_bin" / start.name
    program.parent.mkdir()
    # As pip installs the command: its own folder comes first, not the working folder.
    program.write_text("import sys\nfrom auvid_cli.__main__ import main\nif __name__ == '__main__':\n    main()\n")

    def run(*arguments: str) -> str:
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
        ended = subprocess.run(
            [sys.executable, str(program), *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert "Traceback" not in ended.stderr, ended.stderr
        executed = tmp_path / "executed"
        return executed.read_text() if executed.exists() else ""

    return run


def test_run_executes_no_file_of_the_working_folder(trapped, tmp_path):
    assert trapped("run", "vt690_zigzag", SHORT, "--filter=ekf", "-o", "out") == ""
    assert (tmp_path / "out/report.html").is_file()
    assert list((tmp_path / "out/figures").iterdir())
    # The scan of the files that another process wrote.
    assert trapped("report", "out") == ""


def test_campaign_executes_no_file_of_the_working_folder(trapped, tmp_path):
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN)
    assert trapped("campaign", "campaign.yaml", "-o", "out", "--workers=1") == ""
    assert list((tmp_path / "out").rglob("*.parquet"))
