"""The cache of compiled code: filled by other processes, and made anew where there is nowhere to keep it."""

import ast
import importlib
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from numba import types

import auvid_cli
from auvid_cli import code_cache
from auvid_cli.code_cache import CORE
from auvid_cli.compilation import compiled, on_compilation

ELSEWHERE = """
from auvid_cli.compilation import compile_elsewhere, is_compiled, told_of_compilation
before = is_compiled("auvid_cli.simulation.imperfections")
code = compile_elsewhere("auvid_cli.simulation.imperfections").wait()
told = []
with told_of_compilation(lambda: told.append(1), list):
    import auvid_cli.simulation.imperfections
    after_one = len(told)
    import auvid_cli.filters.problem
print(before, code, is_compiled("auvid_cli.simulation.imperfections"), after_one, len(told) > 0)
"""


@pytest.mark.parametrize("place", ["{tmp}/new", "{tmp}/file/within"])
def test_what_another_process_has_compiled_is_found(tmp_path, place):
    (tmp_path / "file").write_text("where a folder cannot be")
    environment = os.environ | {"NUMBA_CACHE_DIR": place.format(tmp=tmp_path)}
    command = [sys.executable, "-c", ELSEWHERE]
    output = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    assert output.split() == ["False", "0", "True", "0", "True"]


@pytest.fixture
def compiled_again(tmp_path, monkeypatch):
    """Function: what is said of damage and of compiling while a function is compiled, or taken from the cache."""
    monkeypatch.setattr(code_cache, "cache_folder", lambda: tmp_path)

    def again():
        told = []
        with on_compilation(lambda: told.append("compiled"), lambda: told.append("damaged")):
            double = compiled(types.int64(types.int64))(_double)
        assert double(21) == 42
        return told

    assert again() == ["compiled"]
    assert again() == []
    return again


def _double(number):
    return 2 * number


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


DAMAGES = {
    "cut short": lambda path: path.write_bytes(path.read_bytes()[:-100]),
    "emptied": lambda path: path.write_bytes(b""),
    "garbled": flip,
    "of zeros": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "of text": lambda path: path.write_text("no machine code\n" * 100),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_damaged_machine_code_is_not_run_but_compiled_again_and_kept(compiled_again, tmp_path, kind, damage):
    (path,) = tmp_path.rglob(f"*.{kind}")
    damage(path)
    assert compiled_again() == ["damaged", "compiled"]
    assert compiled_again() == []


def test_what_cannot_be_kept_is_compiled_each_time(compiled_again, tmp_path):
    (path,) = tmp_path.rglob("*.nbi")
    path.unlink()
    path.mkdir()
    assert "compiled" in compiled_again()
    assert "compiled" in compiled_again()


_part = compiled(types.int64(types.int64), internal=True)(_double)


def _double_and_one(number):
    return _part(number) + 1


def test_what_only_compiled_functions_call_is_kept_inside_these(tmp_path, monkeypatch):
    monkeypatch.setattr(code_cache, "cache_folder", lambda: tmp_path)
    whole = compiled(types.int64(types.int64))(_double_and_one)
    assert whole(20) == 41
    assert {path.name.split("-")[0] for path in tmp_path.rglob("*.nb?")} == {"test_compilation._double_and_one"}


APART = """
import sys
import numba
import numpy
from numba import types
from auvid_cli.compilation import compiled, told_of_compilation
vector = types.float64[::1]
for _ in range(int(sys.argv[1])):
    numba.njit("int64(int64)")(lambda number: number)
told = []
with told_of_compilation(lambda: told.append(1), list):
    @compiled(types.void(vector), reassociate=True, apart=True)
    def double(values):
        for k in range(values.size):
            values[k] *= 2.0
    @compiled(types.void(vector), reassociate=True, internal=True)
    def double_twice(values):
        double(values)
        double(values)
    @compiled(types.void(vector), reassociate=True)
    def eightfold(values):
        double(values)
        double_twice(values)
values = numpy.ones(3)
eightfold(values)
print(values.tolist(), len(told))
"""


def test_what_stays_apart_is_found_by_what_another_process_compiled(tmp_path):
    """Whatever else it compiled before, and however it orders sets."""
    script, eight = tmp_path / "eightfold.py", "[8.0, 8.0, 8.0]"
    script.write_text(APART)

    def said(before):
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONHASHSEED": str(before)}
        command = [sys.executable, script, str(before)]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()

    assert said(0) == f"{eight} 3"
    for before in range(1, 5):
        (path,) = tmp_path.rglob("*double-*.nbc")
        path.unlink()
        assert said(before) == f"{eight} 1"


@compiled(types.int64(types.int64), apart=True)
def _triple(number):
    return 3 * number


def _triple_and_one(number):
    return _triple(number) + 1


def test_what_stays_apart_is_called_where_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr(code_cache, "cache_folder", lambda: tmp_path)
    caller = compiled(types.int64(types.int64))(_triple_and_one)
    assert caller(5) == 16
    (code,) = caller.inspect_llvm().values()
    assert re.findall(r"^declare .*_triple", code, re.MULTILINE)
    assert not re.findall(r"^define .*_triple\b(?!_and)", code, re.MULTILINE)


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
            part, *rest = node.module.split(".")[1:]
            if not {part, f"{part}.py", "/".join([part, *rest]) + ".py"} & {*CORE}:
                values = [getattr(importlib.import_module(node.module), name.name) for name in node.names]
                constants = [value for value in values if not isinstance(value, Callable)]
                assert not constants, (path, node.module, constants)


def test_what_few_data_need_is_not_compiled_for_all():
    code = (
        "import sys, auvid_cli.api.evaluation, auvid_cli.filters.smoother, auvid_cli.identification.run;"
        "print([m for m in ('filters.marginal', 'identification.sensors') if f'auvid_cli.{m}' in sys.modules])"
    )
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "[]\n"
