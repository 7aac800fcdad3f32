"""The core is compiled to instructions that treat several numbers at once: counted, not timed.

Here all loops together, as they stand in the machine code; `python -m benchmarks.guard` counts what is executed.
"""

import json
import os
import platform
import subprocess
import sys

import pytest

# A processor that every x86-64 machine can compile for, so that the counts are the same everywhere.
HASWELL = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma,+bmi,+bmi2,+sse4.2,+popcnt"}
COUNT = """
import importlib, json, re, sys
from auvid_cli.compilation import compiled
counts, kernels = {}, {}
for path in sys.argv[1:]:
    module, name = path.rsplit(".", 1)
    kernels[path] = getattr(importlib.import_module("auvid_cli." + module), name)
for path, kernel in kernels.items():
    options = kernel.targetoptions
    if options["no_cpython_wrapper"]:
        # Compiled only with those that call it: it has machine code of its own only here.
        (signature,) = [overload.signature for overload in kernel.overloads.values()]
        kernel = compiled(signature, reassociate="reassoc" in options["fastmath"])(kernel.py_func)
    (text,) = kernel.inspect_asm().values()
    found = re.findall(r"^\\s+(v?(?:add|sub|mul|div|fn?m(?:add|sub)\\d+)[sp]d)\\b", text, re.MULTILINE)
    counts[path] = [sum(instruction.endswith(kind) for instruction in found) for kind in ("pd", "sd")]
print(json.dumps(counts))
"""
# Least share of packed instructions among all of arithmetic, and most of both, a tenth from what was counted with
# LLVM 22; a loop that is vectorised has its scalar twin for what is left over. What a filter's step runs through is
# bounded from above as well as it can be without running it: a new loop, or a second copy of one, shows.
KERNELS = {
    "vehicle.equations.motion_derivative": (0.45, 510),
    "filters.sigma_points.draw_points": (0.42, 150),
    "filters.sigma_points.collect_points": (0.62, 250),
    "filters.factor.triangularise": (0.50, 72),
    "filters.factor.carlson_update": (0.24, 38),
    "filters.least_squares._compress": (0.60, 42),
    "filters.square_root.predict": (0.55, 500),
    "filters.sigma_points.update": (0.50, 640),
    "filters.square_root._run": (0.52, 1100),
    "vehicle.equations.runge_kutta_step": (0.45, 101),
    "vehicle.jacobian.transition_step": (0.51, 337),
    "vehicle.jacobian.motion_jacobian": (0.0, 319),
}


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="counts instructions of x86-64")
def test_kernels_work_on_several_numbers_at_once_and_have_not_grown(tmp_path):
    """All in one test, since two workers would compile twice; in a fresh cache."""
    environment = os.environ | HASWELL | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", COUNT, *KERNELS]
    counted = json.loads(subprocess.run(command, env=environment, capture_output=True, check=True, text=True).stdout)
    assert counted.keys() == KERNELS.keys()
    assert all(packed + scalar > 0 for packed, scalar in counted.values())
    shares = {name: (packed, scalar, *KERNELS[name]) for name, (packed, scalar) in counted.items()}
    narrow = {name: row for name, row in shares.items() if row[0] < row[2] * (row[0] + row[1])}
    grown = {name: row for name, row in shares.items() if row[0] + row[1] > row[3]}
    assert (narrow, grown) == ({}, {})
