"""A run is the same without what only POSIX or only Linux has: files of reserved size, fork, some signals."""

import subprocess
import sys

import pytest

ARGUMENTS = ["run", "spiral", "--filter", "ckf", "--set", "manoeuvre.duration=40 s", "--quiet", "--output"]
HIDE = """
import mmap, multiprocessing, os, signal, sys, sysconfig
for module, names in ((os, ("posix_fallocate", "SEEK_DATA")), (mmap, ("MADV_DONTNEED",)),
                      (signal, ("SIGHUP", "SIGALRM", "pthread_sigmask"))):
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
multiprocessing.get_all_start_methods = lambda: ["spawn"]
from auvid_cli.__main__ import main
import psutil  # it and sysconfig need a known platform
sysconfig.get_config_vars()
sys.platform = "another"
main()
"""


TABLES = "coefficients.csv", "sensor_errors.csv", "velocity_error.csv", "consistency.csv", "faults.csv"


def tables_after(command, folder):
    subprocess.run([sys.executable, *command, *ARGUMENTS, folder], check=True, timeout=300)
    assert (folder / "figures" / "convergence.png").is_file()
    return [(folder / "tables" / name).read_text() for name in TABLES]


@pytest.mark.slow
def test_run_needs_nothing_that_only_posix_has(tmp_path):
    usual = tables_after(["-m", "auvid_cli"], tmp_path / "usual")
    assert tables_after(["-c", HIDE], tmp_path / "hidden") == usual
