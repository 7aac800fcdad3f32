"""One tree of settings from an experiment file, the files that it names, and overrides."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

from auvid_cli.config.shipped import shipped_files, shipped_part
from auvid_cli.config.source_positions import (
    MAX_DEPTH,
    OVERRIDE,
    ConfigSource,
    KeyPath,
    Mistake,
    Position,
    Tree,
    dotted,
    read_tree,
)
from auvid_cli.regular_files import read_bytes
from auvid_cli.text import shortened

# Sections that may name a file, with the kind of such files that ship.
SECTIONS = {"vehicle": "vehicles", "sensors": "sensors", "manoeuvre": "manoeuvres"}
SUFFIXES = (".yaml", ".yml")
_DATA_FILES = (("manoeuvre", "file"), ("identification", "prior", "from_estimate"))
_LIST_OF_NAMES = ("identification", "coefficients")
MAX_BYTES = 1_000_000  # size of a settings file

Change = tuple[KeyPath, Tree]
"""Value for the settings, with the path where it goes."""


@dataclass(frozen=True)
class Override:
    """Change of settings: `KEY.KEY=VALUE`, or all values of a YAML file.

    Attributes
    ----------
    text : str
        As the user wrote it.
    changes : tuple of Change
    mistakes : tuple of Mistake
        Errors of the text itself; then there are no changes, or only those that could be read.
    """

    text: str
    changes: tuple[Change, ...] = ()
    mistakes: tuple[Mistake, ...] = ()

    @classmethod
    def parse(cls, text: str) -> "Override":
        """Read an override, whose values are YAML."""
        at = Position(ConfigSource(f"{OVERRIDE}{shortened(text, 200)}", Path()))
        try:
            if "=" in text or not text.endswith(SUFFIXES):
                return cls(text, (_key_and_value(text, at),))
            tree, mistakes = read_tree(read_source(Path(text)))
            if not mistakes and not isinstance(tree.content, dict):
                raise ValueError("expected settings, key: value")
            return cls(text, tuple(_values(tree)), mistakes)
        except ValueError as error:
            return cls(text, (), (Mistake(at, (), str(error)),))

    @property
    def keys(self) -> list[str]:
        """Return the keys that it changes, with dots."""
        return [dotted(path) for path, _ in self.changes]


def _key_and_value(text: str, at: Position) -> Change:
    key, equals, value = text.partition("=")
    path = tuple(part.strip() for part in key.split("."))
    if not equals or not all(path):
        raise ValueError("expected key.key=value, for example sensors.dvl.rate=7 Hz")
    if len(path) > MAX_DEPTH:
        raise ValueError(f"has {len(path)} keys, one within the other, where there may be {MAX_DEPTH}")
    tree, mistakes = read_tree(replace(at.source, text=value))
    if mistakes:
        raise ValueError(mistakes[0].message)
    return path, tree.placed_at(at)


def _values(tree: Tree, path: KeyPath = ()) -> Iterator[Change]:
    """Yield all values that are not mappings."""
    if isinstance(tree.content, dict):
        for key, child in tree.content.items():
            yield from _values(child, (*path, key))
    elif path:
        yield path, tree


def read_source(path: Path, name: str | None = None) -> ConfigSource:
    """Read the text of a settings file; bytes that are not UTF-8 stay visible as surrogates.

    Raises
    ------
    ValueError
        If it cannot be read; the message gives the reason without the path.
    """
    text = read_bytes(path, MAX_BYTES).decode("utf-8-sig", errors="surrogateescape")
    return ConfigSource(name or str(path), path.parent, text, path)


def assemble(source: ConfigSource, overrides: Iterable[str] = ()) -> tuple[Tree, list[Mistake]]:
    """Read an experiment, insert the files that it names, and apply overrides in turn.

    Parameters
    ----------
    source : ConfigSource
        The experiment file.
    overrides : iterable of str
        As for `Override`.

    Returns
    -------
    Tree
        Settings that are plain values throughout.
    list of Mistake
        Errors of reading and setting. A file that cannot be read leaves an empty mapping.
    """
    tree, mistakes = read_tree(source)
    if not isinstance(tree.content, dict):
        return tree, [*mistakes]
    parsed = [Override.parse(text) for text in overrides]
    tree, wrong = with_changes(tree, [change for override in parsed for change in override.changes], source.folder)
    return tree, [*mistakes, *(mistake for override in parsed for mistake in override.mistakes), *wrong]


def with_changes(tree: Tree, changes: Iterable[Change], folder: Path) -> tuple[Tree, list[Mistake]]:
    """Put values into the settings of an experiment, in turn, and insert the files that are then named.

    Parameters
    ----------
    tree : Tree
        A mapping.
    changes : iterable of Change
        A file that a value names is relative to the source of the value.
    folder : pathlib.Path
        Second folder in which such files are searched.

    Returns
    -------
    Tree, list of Mistake
        As of `assemble`.
    """
    mistakes: list[Mistake] = []
    for path, new in changes:
        try:
            if len(path) > 1:
                tree = _with_file(tree, str(path[0]), folder, mistakes)
            tree = tree.put(path, new)
        except ValueError as error:
            hint, name = "", str(path[-1]) if path else ""
            if path[:-1] == _LIST_OF_NAMES and not name.isdecimal():
                hint = f"; it is 'all', or a list of names to estimate; a value belongs to vehicle.coefficients.{name}"
            mistakes.append(Mistake(new.at, path, f"{error}{hint}"))
    for section in SECTIONS:
        tree = _with_file(tree, section, folder, mistakes)
    for place in _DATA_FILES:
        tree = _with_absolute_path(tree, place)
    return tree, mistakes


def _with_file(tree: Tree, section: str, folder: Path, mistakes: list[Mistake]) -> Tree:
    """Replace a section that is the path of a file by the content of the file."""
    named = tree.child(section)
    if named is None or not isinstance(named.content, str) or not named.content.endswith(SUFFIXES):
        return tree
    candidates = [base / named.content for base in dict.fromkeys((named.at.source.folder, folder))]
    own = next((candidate for candidate in candidates if candidate.exists()), None)
    path = own or shipped_part(named.content) or candidates[0]
    name = os.path.normpath(path)
    try:
        content, wrong = read_tree(read_source(path, name))
    except ValueError as error:
        near = get_close_matches(named.content, [file.name for file in shipped_files(SECTIONS[section])], n=1)
        hint = f"; did you mean {near[0]!r}, which ships with auvid?" if near and not path.exists() else ""
        content = replace(named, content={}, readable=False)
        wrong = (Mistake(named.at, (), f"{name}: {error}{hint}"),)
    mistakes += (mistake.under((section,)) for mistake in wrong)
    return tree.put((section,), content)


def _with_absolute_path(tree: Tree, path: KeyPath) -> Tree:
    """Make the path of a data file absolute: it is relative to the source of the value."""
    nodes = list(tree.descend(path))
    last = nodes[-1]
    if len(nodes) <= len(path) or not isinstance(last.content, str) or not last.content:
        return tree
    absolute = os.path.normpath((last.at.source.folder / last.content).absolute())
    return tree.put(path, replace(last, content=absolute))
