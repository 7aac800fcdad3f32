"""The cache of compiled code: filled by other processes, and made anew where there is nowhere to keep it."""

import os
import subprocess
import sys

import pytest

ELSEWHERE = """
from auvid_cli.compilation import compile_elsewhere, nothing_compiled
before = nothing_compiled()
code = compile_elsewhere("auvid_cli.filters.factor").wait()
from numba.core.event import RecordingListener, install_listener
listener = RecordingListener()
with install_listener("numba:compile", listener):
    import auvid_cli.filters.factor
print(before, code, nothing_compiled(), len(listener.buffer))
"""


@pytest.mark.parametrize("place", ["{tmp}/new", "{tmp}/file/within"])
def test_what_another_process_has_compiled_is_found(tmp_path, place):
    (tmp_path / "file").write_text("where a folder cannot be")
    environment = os.environ | {"NUMBA_CACHE_DIR": place.format(tmp=tmp_path)}
    command = [sys.executable, "-c", ELSEWHERE]
    output = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    assert output.split() == ["True", "0", "False", "0"]
