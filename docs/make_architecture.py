"""Draw the rooms and their imports from the source code: `python docs/make_architecture.py` writes the picture."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "auvid_cli"
TARGET = Path(__file__).parent / "images/architecture.svg"
# Pixels: of a box, and from one to the next.
_WIDTH, _HEIGHT, _ACROSS, _DOWN, _MARGIN = 116, 34, 150, 84, 16


def rooms(package: Path = PACKAGE) -> dict[str, set[str]]:
    """Return the rooms that each room imports from, by the import statements of all modules."""
    names = sorted(path.parent.name for path in package.glob("*/__init__.py"))
    return {name: _imported(package / name) & {*names} - {name} for name in names}


def _imported(room: Path) -> set[str]:
    modules: set[str] = set()
    for path in room.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                modules |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
            elif isinstance(node, ast.Import):
                modules |= {alias.name for alias in node.names}
    return {module.split(".")[1] for module in modules if module.startswith("auvid_cli.")}


def reduced(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """Return the transitive reduction of an acyclic graph."""
    above: dict[str, set[str]] = {}
    for room in TopologicalSorter(graph).static_order():
        above[room] = graph[room].union(*(above[other] for other in graph[room]))
    return {room: {o for o in others if not any(o in above[p] for p in others)} for room, others in graph.items()}


def _places(graph: dict[str, set[str]], edges: dict[str, set[str]]) -> dict[str, tuple[float, float]]:
    """Find middle and top of each box: below those it imports from, as near under them as its neighbours allow."""
    depth: dict[str, int] = {}
    for room in TopologicalSorter(graph).static_order():
        depth[room] = 1 + max((depth[other] for other in graph[room]), default=-1)
    x: dict[str, float] = {}
    for row in range(1 + max(depth.values())):
        wanted = {r: sum(x[o] for o in edges[r]) / max(len(edges[r]), 1) for r in depth if depth[r] == row}
        free = float("-inf")
        for room in sorted(wanted, key=lambda r: (wanted[r], r)):
            x[room] = max(wanted[room], free)
            free = x[room] + _ACROSS
    left = min(x.values())
    return {room: (x[room] - left + _MARGIN + _WIDTH / 2, _MARGIN + _DOWN * depth[room]) for room in x}


def architecture() -> str:
    """Return the picture: who is below imports from who is above, and data flow down."""
    graph = rooms()
    edges = reduced(graph)
    place = _places(graph, edges)
    width = 2 * _MARGIN + _WIDTH + max(x for x, _ in place.values()) - min(x for x, _ in place.values())
    height = 2 * _MARGIN + _HEIGHT + max(y for _, y in place.values()) - _MARGIN
    arrows = "\n".join(
        f'<path d="M{x:g} {y + _HEIGHT:g} L{a:g} {b - 3:g}" marker-end="url(#head)"/>'
        for room in sorted(edges)
        for (x, y), (a, b) in ((place[other], place[room]) for other in sorted(edges[room]))
    )
    boxes = "\n".join(
        f'<rect x="{x - _WIDTH / 2:g}" y="{y:g}" width="{_WIDTH}" height="{_HEIGHT}" rx="5"/>'
        f'<text x="{x:g}" y="{y + 22:g}">{room}</text>'
        for room, (x, y) in sorted(place.items())
    )
    size = f'viewBox="0 0 {width:g} {height:g}" width="{width:g}" height="{height:g}"'
    return f"""<svg xmlns="http://www.w3.org/2000/svg" {size}>
<title>Rooms of auvid: each imports from those above it</title>
<style>rect {{ fill: #eef3f8; stroke: #35618f }} path {{ stroke: #7a8794; fill: none }}
text {{ font: 15px sans-serif; text-anchor: middle; fill: #10263d }} .page {{ fill: #fff; stroke: none }}</style>
<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">
<path d="M0 0 L8 4 L0 8" /></marker></defs>
<rect class="page" width="{width:g}" height="{height:g}"/>
{arrows}
{boxes}
</svg>
"""


if __name__ == "__main__":
    TARGET.write_text(architecture(), encoding="utf-8")
