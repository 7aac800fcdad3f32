"""The dynamics are compiled to instructions that treat several sigma points at once: counted, not timed."""

import json
import os
import platform
import subprocess
import sys

import pytest

# A processor that every x86-64 machine can compile for, so that the counts are the same everywhere.
HASWELL = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma,+bmi,+bmi2,+sse4.2,+popcnt"}
COUNT = """
import json, re
from auvid_cli.vehicle.dynamics import motion_derivative
(text,) = motion_derivative.inspect_asm().values()
names = re.findall(r"^\\s+(v?(?:add|sub|mul|div|fn?m(?:add|sub)\\d+)[sp]d)\\b", text, re.MULTILINE)
print(json.dumps({kind: sum(name.endswith(kind) for name in names) for kind in ("pd", "sd")}))
"""


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="counts instructions of x86-64")
def test_the_whole_right_hand_side_works_on_several_points_at_once(tmp_path):
    environment = os.environ | HASWELL | {"NUMBA_CACHE_DIR": str(tmp_path)}
    output = subprocess.run([sys.executable, "-c", COUNT], env=environment, capture_output=True, text=True, check=True)
    counts = json.loads(output.stdout)
    packed, scalar = counts["pd"], counts["sd"]
    # What the loop does four points at a time it does once more one by one, for those left over, and nothing besides.
    assert packed >= 0.95 * scalar
    # Eight of these calls go into a step of the filter for each four points: what is added here is felt.
    assert 100 < packed < 200
