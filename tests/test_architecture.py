"""Data flows one way, and imports with it."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "auvid_cli"
ROOMS = (
    *("config", "vehicle", "simulation", "data", "logs", "filters"),
    *("identification", "evaluation", "campaign", "export", "report", "api", "cli"),
)
# Plain value types that an earlier room may name.
VALUES = {
    "auvid_cli.vehicle.coefficients",
    "auvid_cli.vehicle.parameters",
    "auvid_cli.data.dataset",
    "auvid_cli.data.estimate",
}
MODULES = [path for path in PACKAGE.rglob("*.py") if path.parent != PACKAGE]


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return names


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_room_imports_from_a_later_one(path):
    room = path.relative_to(PACKAGE).parts[0]
    for name in imported(path) - VALUES:
        parts = name.split(".")
        if parts[0] == "auvid_cli" and len(parts) > 1 and parts[1] in ROOMS:
            assert ROOMS.index(parts[1]) <= ROOMS.index(room), f"{room} imports {name}"


def test_filters_know_nothing_of_vehicles():
    for path in (PACKAGE / "filters").glob("*.py"):
        rooms = {name.split(".")[1] for name in imported(path) if name.startswith("auvid_cli.")}
        assert rooms <= {"filters", "angles", "lanes", "compilation"}


def test_nothing_that_identifies_reads_the_truth():
    for path in [*(PACKAGE / "identification").glob("*.py"), *(PACKAGE / "filters").glob("*.py")]:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        attributes = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        assert not attributes & {"truth", "true", "all_coefficients"}, path.name
