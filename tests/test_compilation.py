"""Compiled functions and their cache on disk."""

import ast
import importlib
import os
import subprocess
import sys
import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

import auvid_cli
from auvid_cli.numerics import CORE, check_numba

PACKAGE = Path(auvid_cli.__file__).parent
ELSEWHERE = """
from auvid_cli.numerics import compile_elsewhere, is_compiled, on_compilation
before = is_compiled("auvid_cli.vehicle.actuator_motion")
with compile_elsewhere("auvid_cli.vehicle.actuator_motion") as compilation:
    error = compilation.exception()
events = []
with on_compilation(lambda: events.append(1)):
    import auvid_cli.vehicle.actuator_motion
    after_one = len(events)
    import auvid_cli.filters.problem
print(before, error, is_compiled("auvid_cli.vehicle.actuator_motion"), after_one, len(events) > 0)
"""
CACHED = """
from numba import types
from auvid_cli.numerics import compiled, on_compilation
@compiled()
def double(number):
    return 2 * number
events = []
with on_compilation(lambda: events.append(1)):
    @compiled(types.int64(types.int64))
    def double_and_one(number):
        return double(number) + 1
print(double_and_one(20), len(events))
"""
DAMAGED = """
import itertools, pathlib, runpy, sys
folder = pathlib.Path(sys.argv[1])
for kind, content in itertools.product(("nbi", "nbc"), (b"", b"no machine code\\n" * 100)):
    (path,) = folder.rglob(f"*.{kind}")
    path.write_bytes(content)
    for _ in range(3):
        runpy.run_path(str(folder / "doubling.py"))
"""


@pytest.mark.slow
@pytest.mark.parametrize("place", ["{tmp}/new", "{tmp}/file/within"])
def test_code_compiled_by_another_process_is_found(tmp_path, place):
    (tmp_path / "file").write_text("a file where a folder is expected")
    environment = os.environ | {"NUMBA_CACHE_DIR": place.format(tmp=tmp_path)}
    command = [sys.executable, "-c", ELSEWHERE]
    output = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    assert output.split() == ["False", "None", "True", "0", "True"]


@pytest.fixture(scope="module")
def cache_of_script(tmp_path_factory):
    """Folder of a script with compiled functions, and of their cache; each test leaves a valid cache behind."""
    folder = tmp_path_factory.mktemp("cache")
    (folder / "doubling.py").write_text(CACHED)
    assert compile_again(folder) == ["41", "2"]
    return folder


def compile_again(folder: Path) -> list[str]:
    """Result of a compiled function, and the number of functions that were compiled."""
    return run_python("import runpy, sys\nrunpy.run_path(sys.argv[1] + '/doubling.py')", folder)


def run_python(code: str, folder: Path) -> list[str]:
    """Words that a process prints, with the cache in a folder."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder)}
    command = [sys.executable, "-c", code, str(folder)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.split()


@pytest.mark.slow
def test_compiled_function_is_loaded_with_its_callees_inside(cache_of_script):
    assert compile_again(cache_of_script) == ["41", "0"]
    assert len(list(cache_of_script.rglob("*.nbc"))) == 1


@pytest.mark.slow
def test_unreadable_cache_files_are_compiled_again(cache_of_script):
    # First without the cache, then into it, then from it; for each kind of file and of damage.
    assert run_python(DAMAGED, cache_of_script) == ["41", "2", "41", "2", "41", "0"] * 4


@pytest.mark.parametrize("version", ["0.60.1", "0.69.0rc1", "1.0.0", "0.70.0dev0+12.gabc"])
def test_unsupported_numba_is_refused(version):
    with pytest.raises(ImportError, match=f"numba {version.split('+')[0]}.*install"):
        check_numba(version)


def test_supported_numba_is_the_declared_one():
    check_numba()
    project = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text())["project"]
    (declared,) = (entry for entry in project["dependencies"] if entry.startswith("numba"))
    with pytest.raises(ImportError, match=f'"{declared}"'):
        check_numba("0.1")


@cache
def compiling_modules():
    """Syntax trees of the modules that have compiled functions, by path within the package."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        if "@compiled(" not in (text := path.read_text(encoding="utf-8")):
            continue
        tree = ast.parse(text)
        decorators = [d for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) for d in node.decorator_list]
        if any(isinstance(d, ast.Call) and getattr(d.func, "id", "") == "compiled" for d in decorators):
            found[path.relative_to(PACKAGE)] = tree
    return found


@pytest.mark.slow
def test_cache_depends_on_all_compiled_modules():
    assert len(compiling_modules()) > 8
    assert {path.parts[0] for path in compiling_modules()} <= set(CORE)


@pytest.mark.slow
def test_constants_of_compiled_functions_come_from_the_core():
    for path, tree in compiling_modules().items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("auvid_cli."):
                continue
            part, *rest = node.module.split(".")[1:]
            if not {part, f"{part}.py", "/".join([part, *rest]) + ".py"} & {*CORE}:
                values = [getattr(importlib.import_module(node.module), name.name) for name in node.names]
                constants = [value for value in values if not isinstance(value, Callable)]
                assert not constants, (path, node.module, constants)


@pytest.mark.slow
def test_code_for_few_data_is_not_compiled_for_all():
    code = (
        "import sys, auvid_cli.api.results, auvid_cli.filters.smoother, auvid_cli.identification.run;"
        "print([m for m in ('filters.marginal', 'identification.sensors') if f'auvid_cli.{m}' in sys.modules])"
    )
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "[]\n"
