"""Data flows one way, and imports with it."""

import ast
import re
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
    "export": {"config", "data", "evaluation", "identification", "vehicle"},
    "start": {"config", "export", "simulation", "vehicle"},
    "campaign": {"config", "data", "evaluation", "identification", "simulation", "vehicle"},
    "report": {"campaign", "config", "data", "design", "evaluation", "inspection", "logs", "validation", "vehicle"},
}
MAY_IMPORT["api"] = {*MAY_IMPORT} - {"filters", "vehicle"}
MAY_IMPORT["cli"] = {"api", "config", "data", "report"}
MODULES = [path for path in PACKAGE.rglob("*.py") if path.parent != PACKAGE]


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return names


def rooms_of(names: set[str]) -> set[str]:
    parts = [name.split(".") for name in names]
    return {part[1] for part in parts if part[0] == "auvid_cli" and len(part) > 1 and part[1] in MAY_IMPORT}


def test_every_room_is_known():
    assert {path.relative_to(PACKAGE).parts[0] for path in MODULES} == {*MAY_IMPORT}


def test_no_arrow_points_back():
    reached: set[str] = set()
    for room, others in MAY_IMPORT.items():
        assert others <= reached, room
        reached.add(room)


def test_every_arrow_is_used():
    for room, others in MAY_IMPORT.items():
        paths = [path for path in MODULES if path.relative_to(PACKAGE).parts[0] == room]
        assert others <= set[str]().union(*(rooms_of(imported(path)) for path in paths)), room


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_room_imports_only_from_those_it_may(path):
    room = path.relative_to(PACKAGE).parts[0]
    assert rooms_of(imported(path)) <= MAY_IMPORT[room] | {room}


def test_filters_know_nothing_of_vehicles():
    for path in (PACKAGE / "filters").glob("*.py"):
        rooms = {name.split(".")[1] for name in imported(path) if name.startswith("auvid_cli.")}
        assert rooms <= {"filters", "angles", "lanes", "compilation"}


def test_nothing_that_identifies_reads_the_truth():
    for path in [*(PACKAGE / "identification").glob("*.py"), *(PACKAGE / "filters").glob("*.py")]:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        attributes = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        assert not attributes & {"truth", "true", "all_coefficients"}, path.name


def test_no_two_modules_define_a_public_type_of_the_same_name():
    definitions: dict[str, set[str]] = {}
    for path in PACKAGE.rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            for name, definition in defined_types(node):
                # An alias that is the same everywhere is one thing.
                definitions.setdefault(name, set()).add(definition or str(path))
    assert [name for name, different in definitions.items() if len(different) > 1] == []


def defined_types(node: ast.stmt) -> list[tuple[str, str]]:
    """Return public types that a statement defines, and of an alias what it stands for."""
    match node:
        case ast.ClassDef(name=name):
            named = [(name, "")]
        case ast.Assign(targets=targets, value=value):
            named = [(target.id, ast.unparse(value)) for target in targets if isinstance(target, ast.Name)]
        case ast.AnnAssign(target=ast.Name(id=name), value=value) if value is not None:
            named = [(name, ast.unparse(value))]
        case _:
            named = []
    return [(name, definition) for name, definition in named if re.match("[A-Z]+[a-z]", name)]
