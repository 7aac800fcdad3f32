"""Settings changed in structure, types, units and tags, in files and by `--set`."""

import random
import re
import shutil
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from benchmarks.attack import odd_files
from benchmarks.attack.cases import Case
from benchmarks.attack.hostile import ABSURD, HOSTILE, TAGS_REFUSED, TEXTS, WRONG_UNITS
from benchmarks.attack.material import EXPERIMENTS, Material

_SHORT = "--set", "manoeuvre.duration=2 s"
# Text of the user's own, where anything may stand.
_FREE = {"name", "source", "notes", "status", "type", "title"}
_QUANTITY = re.compile(r"^[-+]?[\d.]+(e[-+]?\d+)?( \S+)?$")
# How often a case that the dry run accepts is simulated and identified, and how often if a number is absurd.
_RUNS = 0.1, 0.5
# How often something odd stands in place of a file.
_ODD = 0.02

Keys = tuple[str | int, ...]


def _walk(node: Any, path: Keys = ()) -> Iterator[tuple[Keys, Any]]:
    if path:
        yield path, node
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, child in items:
        yield from _walk(child, (*path, key))


def _parent(tree: Any, path: Keys) -> Any:
    for part in path[:-1]:
        tree = tree[part]
    return tree


def _is_quantity(path: Keys, value: Any) -> bool:
    """Say whether a number with or without a unit stands here, and must."""
    named = [part for part in path if isinstance(part, str)]
    free = _FREE.intersection(named[-1:]) or any(part in ("notes", "filters", "seed") for part in path[:1])
    number = isinstance(value, float) or (isinstance(value, str) and _QUANTITY.match(value) is not None)
    return number and not free


@cache
def _files(configs: Path) -> dict[str, str]:
    """Return what ships, by its path."""
    return {str(path.relative_to(configs)): path.read_text("utf-8") for path in sorted(configs.rglob("*.yaml"))}


def _mutate(rng: random.Random, tree: Any) -> tuple[str, bool]:
    """Change something in a tree; say what, and whether it must be refused."""
    places = list(_walk(tree))
    path, value = rng.choice(places)
    parent, key = _parent(tree, path), path[-1]
    where = ".".join(map(str, path))
    quantities = [(at, found) for at, found in places if _is_quantity(at, found)]
    kind = rng.choice(
        ("remove", "rename", "move", "type", "type", "absurd", "absurd", "unit", "unit", "unknown", "wrap", "swap")
    )
    if kind == "remove":
        del parent[key]
    elif kind == "rename" and isinstance(parent, dict):
        changed = str(key)[:-1] if rng.random() < 0.5 else rng.choice(("", "é", "x" * 300, f"{key} ", str(key).upper()))
        parent[changed] = parent.pop(key)
    elif kind in ("move", "swap"):
        other, found = rng.choice(places)
        if kind == "move" and isinstance(_parent(tree, other), dict):
            _parent(tree, other)[str(key)] = deepcopy(value)
        else:
            parent[key] = deepcopy(found) if len(repr(found)) < 2000 else None
    elif kind == "wrap":
        parent[key] = rng.choice(([value], [value, value], {str(key): value}, {"value": value}))
    elif kind == "unknown":
        mappings = [(at, found) for at, found in places if isinstance(found, dict) and "levels" not in at]
        if mappings:
            at, found = rng.choice(mappings)
            found["zzz_unknown"] = 1
            return f"{'.'.join(map(str, at))}: unknown key", "settings" not in at and "recording" not in at
    elif kind in ("absurd", "unit") and quantities:
        at, found = rng.choice(quantities)
        unit = str(found).partition(" ")[2]
        text = rng.choice(WRONG_UNITS if kind == "unit" else ABSURD)
        _parent(tree, at)[at[-1]] = text if kind == "unit" or not unit else f"{text} {unit}"
        return f"{'.'.join(map(str, at))}: {text}", kind == "unit"
    else:
        parent[key] = rng.choice(HOSTILE)
    return f"{where}: {kind}", False


def _has_tag(text: str) -> bool:
    """Say whether a tag is one, and does not stand within a text of several lines."""
    try:
        return any(isinstance(token, yaml.TagToken) for token in yaml.scan(text))
    except yaml.YAMLError:
        return True


def _mutate_text(rng: random.Random, text: str) -> tuple[bytes, str, bool]:
    """Change the text of a file: what a tree cannot hold."""
    lines = text.splitlines()
    kind = rng.choice(
        ("value", "value", "value", "byte", "double", "indent", "huge", "deep", "many", "cut", "encoding", "laughs")
    )
    number = rng.choice(
        [n for n, line in enumerate(lines) if ": " in line and not line.lstrip().startswith(("#", "-"))] or [0]
    )
    if kind == "value":
        value = rng.choice(TEXTS)
        lines[number] = f"{lines[number].partition(':')[0]}: {value}"
        changed = "\n".join(lines)
        return changed.encode(), f"line {number + 1}: {value[:40]}", value in TAGS_REFUSED and _has_tag(changed)
    if kind == "double":
        lines.insert(number, lines[number])
    elif kind == "indent":
        lines[number] = " " * rng.randrange(1, 5) + lines[number]
    elif kind == "huge":
        lines[number] += "x" * 200_000
    elif kind == "deep":
        lines.append("deep: " + "[" * (depth := rng.choice((100, 900, 5000))) + "]" * depth)
    elif kind == "many":
        lines += [f"key{n}: 1" for n in range(rng.choice((100, 5000)))]
    elif kind == "laughs":
        lines += [
            "l0: &l0 [a, a]",
            *(f"l{n}: &l{n} [{', '.join([f'*l{n - 1}'] * 9)}]" for n in range(1, rng.choice((3, 12)))),
        ]
    content = "\n".join(lines).encode()
    if kind == "byte":
        at = rng.randrange(len(content))
        content = content[:at] + bytes([rng.randrange(256)]) + content[at + rng.randrange(2) :]
    elif kind == "cut":
        content = content[: rng.randrange(len(content))]
    elif kind == "encoding":
        mark = rng.choice(("utf-16", "utf-32", "utf-8-sig", "utf-7"))
        return content.decode().encode(mark), mark, False
    return content, kind, kind in ("many", "laughs")


# A file that is changed: its name, its text, and what reads it.
_Place = tuple[str, str, tuple[str, ...]]
# All settings, a file as it ships, a map, a campaign; the dry run of a campaign takes longer.
_WEIGHTS = 6, 4, 1.5, 0.15


def _campaign(rng: random.Random, material: Material, folder: Path) -> _Place:
    text = (material.configs / "campaigns" / "regimes.yaml").read_text("utf-8")
    text = text.replace("experiment: spiral", "experiment: spiral\nsettings: {manoeuvre.duration: 2 s}\n")
    return "campaign.yaml", text.replace("seeds: 50", "seeds: 1"), ("campaign", "campaign.yaml", "--dry-run")


def _map(rng: random.Random, material: Material, folder: Path) -> _Place:
    return (
        "map.yaml",
        (material.logs / "csv.yaml").read_text("utf-8"),
        ("import", "-m", "map.yaml", "-o", "out/made.h5"),
    )


def _resolved(rng: random.Random, material: Material, folder: Path) -> _Place:
    return "whole.yaml", material.resolved(rng.choice(EXPERIMENTS)), ("run", "whole.yaml", "--dry-run")


def _shipped(rng: random.Random, material: Material, folder: Path) -> _Place:
    """Put a file of its own where an experiment names it."""
    files = [name for name in _files(material.configs) if not name.startswith("campaigns")]
    name = rng.choice(files)
    shutil.copytree(material.configs, folder, dirs_exist_ok=True)
    if "/" not in name:
        return name, _files(material.configs)[name], ("run", name, "--dry-run")
    part = name.partition("/")[0].rstrip("s")
    part = {"manoeuvre": "manoeuvre", "vehicle": "vehicle", "sensor": "sensors"}[part]
    return name, _files(material.configs)[name], ("run", "spiral.yaml", "--dry-run", "--set", f"{part}={name}")


def _dump(tree: Any) -> bytes:
    return yaml.safe_dump(tree, sort_keys=False, allow_unicode=True).encode("utf-8", "surrogatepass")


def make(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a case of a file."""
    place = rng.choices((_resolved, _shipped, _map, _campaign), _WEIGHTS)[0]
    name, text, command = place(rng, material, folder)
    if rng.random() < 0.3:
        content, what, refused = _mutate_text(rng, text)
    else:
        tree = yaml.safe_load(text)
        done = [_mutate(rng, tree) for _ in range(rng.choice((1, 1, 2, 3)))] if tree else []
        what, content = "; ".join(each for each, _ in done), _dump(tree)
        # A later change may take away what an earlier one put there.
        refused = len(done) == 1 and done[0][1]
    if name == "map.yaml":
        shutil.copyfile(material.logs / "csv.csv", folder / "csv.csv")
    (folder / name).write_bytes(content)
    if rng.random() < _ODD:
        put = odd_files.put(rng, folder / name)
        # Without a file of its own, `--set` finds the one of that name that ships.
        return Case(f"{name}: {put}", (command,), refused=put != "nothing" or "--set" not in command)
    return Case(f"{name}: {what}", (command, *_further(rng, command, what.partition(": ")[2] in ABSURD)), refused)


def _further(rng: random.Random, command: tuple[str, ...], absurd: bool) -> tuple[tuple[str, ...], ...]:
    """Add a short run after the dry run, now and then."""
    if command[0] != "run" or rng.random() > _RUNS[absurd]:
        return ()
    settings = tuple(word for word in command[1:] if word != "--dry-run")
    filters = ("-f", rng.choice(("tukf", "tukf", "ckf", "ukf", "ekf", "smoother", "output_error")))
    return (("simulate", *settings, *_SHORT, "-o", "out"), ("identify", "out/dataset.h5", *filters, "-o", "out"))


@cache
def _places(material: Material, experiment: str) -> list[tuple[Keys, Any]]:
    return list(_walk(yaml.safe_load(material.resolved(experiment))))


def make_override(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a case of `--set`."""
    experiment = rng.choice(EXPERIMENTS)
    path, value = rng.choice(_places(material, experiment))
    key = ".".join(map(str, path))
    kind = rng.choice(("absurd", "absurd", "unit", "hostile", "text", "text", "unknown", "path"))
    refused = False
    if kind == "unit":
        wrong = rng.choice(WRONG_UNITS)
        refused = _is_quantity(path, value)
        said = f"{key}={wrong}"
    elif kind == "absurd":
        said = f"{key}={rng.choice(ABSURD)}"
    elif kind == "hostile":
        hostile = rng.choice([each for each in HOSTILE if not isinstance(each, str) or "\0" not in each])
        said = f"{key}={hostile}"
    elif kind == "text":
        text = rng.choice(TEXTS)
        refused = text in TAGS_REFUSED
        said = f"{key}={text}"
    elif kind == "unknown":
        said, refused = f"{rng.choice(('', 'sensors.', 'manoeuvre.', 'identification.'))}zzz_unknown=1", True
    else:
        said = rng.choice(
            (
                "a." * 2000 + "a=1",
                f"{key}.deeper=1",
                f".{key}=1",
                f"{key}..=1",
                "=1",
                key,
                "",
                f"{key}=",
                f"{key}.0=1",
                f"{key}.-1=1",
            )
        )
    command = ("run", experiment, "--dry-run", "--set", said)
    return Case(f"{experiment} {said[:80]}", (command, *_further(rng, command, kind == "absurd")), refused)
