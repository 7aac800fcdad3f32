"""One tree of settings from an experiment file, the files that it names, and overrides."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

from auvid_cli.config.position import OVERRIDE, ConfigSource, KeyPath, Mistake, Position, dotted
from auvid_cli.config.shipped import shipped_files, shipped_part
from auvid_cli.config.tree import MAX_DEPTH, Tree, read_tree
from auvid_cli.printable import shortened
from auvid_cli.regular import read_bytes

# Which may name a file, and of what kind such files ship.
SECTIONS = {"vehicle": "vehicles", "sensors": "sensors", "manoeuvre": "manoeuvres"}
SUFFIXES = (".yaml", ".yml")
# Which lists names, and where values of these stand.
_NAMES, _VALUES = ("identification", "coefficients"), ("vehicle", "coefficients")
MOST_BYTES = 1_000_000


def read_source(path: Path, name: str | None = None) -> ConfigSource:
    """Read the text of a settings file; bytes that are not UTF-8 stay visible as surrogates.

    Raises
    ------
    ValueError
        If it cannot be read; the message says why, without the path.
    """
    text = read_bytes(path, MOST_BYTES).decode("utf-8-sig", errors="surrogateescape")
    return ConfigSource(name or str(path), path.parent, text, path)


def assemble(source: ConfigSource, overrides: Iterable[str] = ()) -> tuple[Tree, list[Mistake]]:
    """Read an experiment, splice in the files that it names, and apply overrides in turn.

    Parameters
    ----------
    source : ConfigSource
        The experiment file.
    overrides : iterable of str
        ``key.key=value``, where the value is YAML; or a YAML file with settings.

    Returns
    -------
    Tree
        Settings that are plain values throughout.
    list of Mistake
        What could not be read or set. A file that cannot be read leaves an empty mapping behind.
    """
    tree, wrong = read_tree(source)
    mistakes = [*wrong]
    if not isinstance(tree.content, dict):
        return tree, mistakes
    changes: list[tuple[KeyPath, Tree]] = []
    for override in overrides:
        try:
            new, wrong = read_changes(override)
        except ValueError as error:
            new, wrong = [], [Mistake(_place(override), (), str(error))]
        changes, mistakes = changes + new, mistakes + wrong
    tree, wrong = with_changes(tree, changes, source.folder)
    return tree, mistakes + wrong


def with_changes(tree: Tree, changes: Iterable[tuple[KeyPath, Tree]], folder: Path) -> tuple[Tree, list[Mistake]]:
    """Put values into the settings of an experiment, in turn, and splice in the files that are then named.

    Parameters
    ----------
    tree : Tree
        A mapping.
    changes : iterable of (KeyPath, Tree)
        Where each value goes; a file that it names is relative to the source that it is written in.
    folder : pathlib.Path
        Where else such files may lie.

    Returns
    -------
    Tree, list of Mistake
        As of `assemble`.
    """
    mistakes: list[Mistake] = []
    for path, new in changes:
        try:
            if len(path) > 1:
                tree = _splice(tree, str(path[0]), folder, mistakes)
            tree = tree.put(path, new)
        except ValueError as error:
            mistakes.append(Mistake(new.at, path, f"{error}{_elsewhere(path)}"))
    for section in SECTIONS:
        tree = _splice(tree, section, folder, mistakes)
    for place in (("manoeuvre", "file"), ("identification", "prior", "from_estimate")):
        tree = _absolute_data_file(tree, place)
    return tree, mistakes


def _elsewhere(path: KeyPath) -> str:
    """Say where a value belongs that was to be put among names."""
    if path[:-1] != _NAMES or str(path[-1]).isdecimal():
        return ""
    return f"; it is 'all', or a list of those to estimate: a value stands in {dotted((*_VALUES, path[-1]))}"


def read_changes(override: str) -> tuple[list[tuple[KeyPath, Tree]], list[Mistake]]:
    """Read an override: a value and where it goes, or those of a settings file.

    Raises
    ------
    ValueError
        If it is neither, or the file cannot be read.
    """
    if "=" in override or not override.endswith(SUFFIXES):
        return [parse_override(override)], []
    tree, mistakes = read_tree(read_source(Path(override)))
    if not mistakes and not isinstance(tree.content, dict):
        raise ValueError("expected settings, key: value")
    return [*_values(tree)], [*mistakes]


def changed_keys(override: str) -> list[str]:
    """Return the settings that an override changes, with dots; none if it cannot be read, which `assemble` says."""
    try:
        changes, _ = read_changes(override)
    except ValueError:
        return []
    return [".".join(map(str, path)) for path, _ in changes]


def _values(tree: Tree, path: KeyPath = ()) -> Iterator[tuple[KeyPath, Tree]]:
    """Yield what is no mapping itself, and where it stands."""
    if isinstance(tree.content, dict):
        for key, child in tree.content.items():
            yield from _values(child, (*path, key))
    elif path:
        yield path, tree


def parse_override(override: str) -> tuple[KeyPath, Tree]:
    """Split ``key.key=value`` into a path and what goes there.

    Raises
    ------
    ValueError
        If it is no such thing, or the value no YAML.
    """
    at = _place(override)
    key, equals, value = override.partition("=")
    path = tuple(part.strip() for part in key.split("."))
    if not equals or not all(path):
        raise ValueError("expected key.key=value, for example sensors.dvl.rate=7 Hz")
    if len(path) > MAX_DEPTH:
        raise ValueError(f"has {len(path)} keys, one within the other, where there may be {MAX_DEPTH}")
    tree, mistakes = read_tree(ConfigSource(at.source.name, at.source.folder, value))
    if mistakes:
        raise ValueError(mistakes[0].message)
    return path, _all_at(tree, at)


def _place(override: str) -> Position:
    return Position(ConfigSource(f"{OVERRIDE}{shortened(override, 200)}", Path()))


def _all_at(tree: Tree, at: Position) -> Tree:
    content = tree.content
    if isinstance(content, dict):
        content = {key: _all_at(child, at) for key, child in content.items()}
    elif isinstance(content, list):
        content = [_all_at(child, at) for child in content]
    return Tree(content, at, at)


def _splice(tree: Tree, section: str, folder: Path, mistakes: list[Mistake]) -> Tree:
    """Replace a section that is the path of a file by what the file holds."""
    named = tree.child(section)
    if named is None or not isinstance(named.content, str) or not named.content.endswith(SUFFIXES):
        return tree
    candidates = [base / named.content for base in dict.fromkeys((named.at.source.folder, folder))]
    own = next((candidate for candidate in candidates if candidate.exists()), None)
    path = own or shipped_part(named.content) or candidates[0]
    name = os.path.normpath(path)
    try:
        content, mistakes_within = read_tree(read_source(path, name))
    except ValueError as error:
        content, mistakes_within = (
            replace(named, content={}, readable=False),
            (Mistake(named.at, (), f"{name}: {error}{_meant(section, named.content) if not path.exists() else ''}"),),
        )
    mistakes += (mistake.under((section,)) for mistake in mistakes_within)
    return tree.put((section,), content)


def _meant(section: str, name: str) -> str:
    """Name the part that ships with auvid and was perhaps meant."""
    near = get_close_matches(name, [file.name for file in shipped_files(SECTIONS[section])], n=1)
    return f"; did you mean {near[0]!r}, which ships with auvid?" if near else ""


def _absolute_data_file(tree: Tree, path: KeyPath) -> Tree:
    """Make the path of a data file absolute: it is relative to the source that it is written in."""
    *_, last = nodes = list(tree.descend(path))
    if len(nodes) <= len(path) or not isinstance(last.content, str) or not last.content:
        return tree
    absolute = str((last.at.source.folder / last.content).absolute())
    return tree.put(path, replace(last, content=os.path.normpath(absolute)))
