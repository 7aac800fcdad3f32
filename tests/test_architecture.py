"""Data flows one way, and imports with it."""

import ast
from collections.abc import Iterator, Set
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "auvid_cli"
# Which rooms each may import from, besides itself; an arrow never points back.
MAY_IMPORT = {
    "vehicle": set(),
    "filters": set(),
    "config": {"vehicle"},
    "data": {"config", "vehicle"},
    "logs": {"config", "data", "vehicle"},
    "simulation": {"config", "data", "vehicle"},
    "inspection": {"config", "data", "vehicle"},
    "identification": {"config", "data", "filters", "vehicle"},
    "evaluation": {"config", "data", "filters", "identification", "inspection", "vehicle"},
    "design": {"config", "data", "identification", "simulation", "vehicle"},
    "validation": {"config", "data", "evaluation", "filters", "identification", "vehicle"},
    "fitting": {"config", "data", "evaluation", "identification", "inspection", "validation", "vehicle"},
    "export": {"config", "data", "evaluation", "identification", "vehicle"},
    "campaign": {"config", "data", "evaluation", "fitting", "identification", "simulation", "vehicle"},
    "report": {
        "campaign",
        "config",
        "data",
        "design",
        "evaluation",
        "fitting",
        "inspection",
        "logs",
        "validation",
        "vehicle",
    },
}
MAY_IMPORT["api"] = {*MAY_IMPORT} - {"filters", "vehicle"}
MAY_IMPORT["cli"] = {"api", "config", "data", "report"}
# What starts the others.
ENTRANCES = {"__init__", "__main__"}


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


PATHS = {name_of(path): path for path in PACKAGE.rglob("*.py")}
MODULES = [path for path in PATHS.values() if path.parent != PACKAGE]


def statements(tree: ast.AST, everywhere: bool) -> Iterator[ast.AST]:
    """Yield the nodes of a module; those that are not run when it is imported only if asked."""
    for node in ast.iter_child_nodes(tree):
        is_for_checkers = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        if everywhere or not (isinstance(node, ast.FunctionDef | ast.Lambda) or is_for_checkers):
            yield node
            yield from statements(node, everywhere)


@cache
def syntax_tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imported(path: Path, everywhere: bool = True) -> frozenset[str]:
    names = set()
    for node in statements(syntax_tree(path), everywhere):
        if isinstance(node, ast.ImportFrom) and node.module:
            names.update({f"{node.module}.{alias.name}" for alias in node.names} & PATHS.keys() or {node.module})
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return frozenset(names)


def rooms_of(names: Set[str]) -> set[str]:
    parts = [name.split(".") for name in names]
    return {part[1] for part in parts if part[0] == "auvid_cli" and len(part) > 1 and part[1] in MAY_IMPORT}


def test_rooms_are_all_listed():
    assert {path.relative_to(PACKAGE).parts[0] for path in MODULES} == {*MAY_IMPORT}


def test_rooms_import_only_from_earlier_rooms():
    reached: set[str] = set()
    for room, others in MAY_IMPORT.items():
        assert others <= reached, room
        reached.add(room)


@pytest.mark.slow
def test_allowed_imports_are_all_used():
    for room, others in MAY_IMPORT.items():
        paths = [path for path in MODULES if path.relative_to(PACKAGE).parts[0] == room]
        assert others <= set[str]().union(*(rooms_of(imported(path)) for path in paths)), room


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_module_imports_only_from_allowed_rooms(path):
    room = path.relative_to(PACKAGE).parts[0]
    assert rooms_of(imported(path)) <= MAY_IMPORT[room] | {room}


@pytest.mark.parametrize("path", sorted(PACKAGE.glob("*.py")), ids=lambda path: path.name)
def test_root_module_imports_from_no_room(path):
    if path.stem not in ENTRANCES:
        assert rooms_of(imported(path)) == set()


def test_module_imports_form_no_circle():
    graph = {name: imported(path, everywhere=False) & PATHS.keys() - {name} for name, path in PATHS.items()}
    # Raises CycleError, which names the circle.
    assert len([*TopologicalSorter(graph).static_order()]) == len(PATHS)


def test_filters_import_nothing_of_vehicles():
    for path in (PACKAGE / "filters").glob("*.py"):
        assert rooms_of(imported(path)) <= {"filters"}


def test_identification_never_reads_the_truth():
    for path in [*(PACKAGE / "identification").glob("*.py"), *(PACKAGE / "filters").glob("*.py")]:
        attributes = {node.attr for node in ast.walk(syntax_tree(path)) if isinstance(node, ast.Attribute)}
        assert not attributes & {"truth", "true", "all_coefficients"}, path.name
