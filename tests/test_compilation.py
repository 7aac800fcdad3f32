"""The cache of compiled code: filled by other processes, and made anew where there is nowhere to keep it."""

import ast
import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import auvid_cli
from auvid_cli.code_cache import CORE

ELSEWHERE = """
from auvid_cli.compilation import compile_elsewhere, is_compiled, told_of_compilation
before = is_compiled("auvid_cli.filters.factor")
code = compile_elsewhere("auvid_cli.filters.factor").wait()
told = []
with told_of_compilation(lambda: told.append(1), list):
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


PACKAGE = Path(auvid_cli.__file__).parent


def compiling_modules():
    """Syntax trees of the modules that have compiled functions, by path within the package."""
    for path in PACKAGE.rglob("*.py"):
        tree = ast.parse(path.read_text())
        decorators = [d for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) for d in node.decorator_list]
        if any(isinstance(d, ast.Call) and getattr(d.func, "id", "") == "compiled" for d in decorators):
            yield path.relative_to(PACKAGE), tree


def test_the_cache_depends_on_all_that_is_compiled():
    modules = dict(compiling_modules())
    assert len(modules) > 8
    assert {path.parts[0] for path in modules} <= set(CORE)


def test_no_constant_of_a_compiled_function_comes_from_where_the_cache_does_not_look():
    for path, tree in compiling_modules():
        for node in ast.walk(tree):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("auvid_cli."):
                continue
            part = node.module.split(".")[1]
            if part not in CORE and f"{part}.py" not in CORE:
                values = [getattr(importlib.import_module(node.module), name.name) for name in node.names]
                constants = [value for value in values if not isinstance(value, Callable)]
                assert not constants, (path, node.module, constants)
