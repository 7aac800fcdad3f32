"""The cache of compiled code: filled by other processes, and made anew where there is nowhere to keep it."""

import os
import subprocess
import sys

import pytest

ELSEWHERE = """
from auvid_cli.compilation import compile_elsewhere, is_compiled, told_of_compilation
before = is_compiled("auvid_cli.filters.factor")
code = compile_elsewhere("auvid_cli.filters.factor").wait()
told = []
with told_of_compilation(lambda: told.append(1)):
    import auvid_cli.filters.factor
    after_one = len(told)
    import auvid_cli.vehicle.dynamics
print(before, code, is_compiled("auvid_cli.filters.factor"), after_one, len(told) > 0)
"""


@pytest.mark.parametrize("place", ["{tmp}/new", "{tmp}/file/within"])
def test_what_another_process_has_compiled_is_found(tmp_path, place):
    (tmp_path / "file").write_text("where a folder cannot be")
    environment = os.environ | {"NUMBA_CACHE_DIR": place.format(tmp=tmp_path)}
    command = [sys.executable, "-c", ELSEWHERE]
    output = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    assert output.split() == ["False", "0", "True", "0", "True"]
