"""Read settings from files, text and overrides, validate them, and write them as text."""

import os
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import ValidationError

from auvid_cli.config.enums import shipped_configs, shipped_files, shipped_part
from auvid_cli.config.experiment import Experiment, ImportedRun, RunSettings
from auvid_cli.config.locate import locate
from auvid_cli.config.settings import Settings
from auvid_cli.config.source_positions import (
    MAX_DEPTH,
    OVERRIDE,
    ConfigSource,
    KeyPath,
    Mistake,
    Position,
    Tree,
    dotted,
    mistakes_text,
    read_tree,
)
from auvid_cli.config.vehicle import Drawing, VehicleSettings
from auvid_cli.errors import ConfigError
from auvid_cli.regular_files import read_bytes
from auvid_cli.text import shortened

# Settings file in the folder of an experiment.
EXPERIMENT_FILE = "experiment.yaml"
# Sections that may name a file, and the folder of the shipped files of that section.
SECTIONS = {"vehicle": "vehicles", "sensors": "sensors", "manoeuvre": "manoeuvres"}
SUFFIXES = (".yaml", ".yml")
MAX_BYTES = 1_000_000  # size of a settings file
_DATA_FILES = (("manoeuvre", "file"), ("identification", "prior", "from_estimate"))
_LIST_OF_NAMES = ("identification", "coefficients")

AnySettings = TypeVar("AnySettings", bound=Settings)
Change = tuple[KeyPath, Tree]
"""Path of a setting and its new value."""


@dataclass(frozen=True)
class Override:
    """Change of settings: `KEY.KEY=VALUE`, or all values of a YAML file."""

    text: str  # text of the user
    changes: tuple[Change, ...] = ()
    mistakes: tuple[Mistake, ...] = ()  # errors of the text; `changes` has the parts without errors

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
        """Return the dotted keys that it changes."""
        return [dotted(path) for path, _ in self.changes]


def _key_and_value(text: str, at: Position) -> Change:
    key, equals, value = text.partition("=")
    path = tuple(part.strip() for part in key.split("."))
    if not equals or not all(path):
        raise ValueError("expected key.key=value, for example sensors.dvl.rate=7 Hz")
    if len(path) > MAX_DEPTH:
        raise ValueError(f"{len(path)} nested keys; expected at most {MAX_DEPTH}")
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
    """Read the text of a settings file, with bytes that are not UTF-8 as surrogates.

    Raises
    ------
    ValueError
        If it cannot be read; the message gives the reason without the path.
    """
    text = read_bytes(path, MAX_BYTES).decode("utf-8-sig", errors="surrogateescape")
    return ConfigSource(name or str(path), path.parent, text, path)


def open_source(path: Path) -> ConfigSource:
    """Read a settings file as text; ConfigError if it cannot be read."""
    try:
        return read_source(path)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}") from None


def assemble(source: ConfigSource, overrides: Iterable[str] = ()) -> tuple[Tree, list[Mistake]]:
    """Read an experiment, insert the files that it names, and apply overrides in turn.

    Returns
    -------
    Tree
        Settings as plain values.
    list of Mistake
        Errors of reading and setting. An unreadable file leaves an empty mapping.
    """
    tree, mistakes = read_tree(source)
    if not isinstance(tree.content, dict):
        return tree, [*mistakes]
    parsed = [Override.parse(text) for text in overrides]
    changes = [change for override in parsed for change in override.changes]
    tree, errors = with_changes(tree, changes, source.folder)
    return tree, [*mistakes, *(mistake for override in parsed for mistake in override.mistakes), *errors]


def with_changes(tree: Tree, changes: Iterable[Change], folder: Path) -> tuple[Tree, list[Mistake]]:
    """Put values into the settings of an experiment one by one, and insert the files that these values name.

    A file that a value names is relative to the source of the value, or else to `folder`.
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
                hint = f"; expected 'all' or a list of names; a value belongs in vehicle.coefficients.{name}"
            mistakes.append(Mistake(new.at, path, f"{error}{hint}"))
    for section in SECTIONS:
        tree = _with_file(tree, section, folder, mistakes)
    for path in _DATA_FILES:
        tree = _with_absolute_path(tree, path)
    return tree, mistakes


def _with_file(tree: Tree, section: str, folder: Path, mistakes: list[Mistake]) -> Tree:
    """Replace a section that is the path of a file by the content of the file."""
    named = tree.child(section)
    if named is None or not isinstance(named.content, str) or not named.content.endswith(SUFFIXES):
        return tree
    candidates = [base / named.content for base in dict.fromkeys((named.at.source.folder, folder))]
    # A link to a missing file is an error: a shipped file never takes its place.
    own = next((candidate for candidate in candidates if os.path.lexists(candidate)), None)
    path = own or shipped_part(named.content) or candidates[0]
    name = os.path.normpath(path)
    try:
        content, errors = read_tree(read_source(path, name))
    except ValueError as error:
        near = get_close_matches(named.content, [file.name for file in shipped_files(SECTIONS[section])], n=1)
        hint = f"; did you mean {near[0]!r}, which ships with auvid?" if near and not own else ""
        content = replace(named, content={}, readable=False)
        errors = (Mistake(named.at, (), f"{name}: {error}{hint}"),)
    mistakes += (replace(mistake, path=(section, *mistake.path)) for mistake in errors)
    return tree.put((section,), content)


def _with_absolute_path(tree: Tree, path: KeyPath) -> Tree:
    """Make the path of a data file absolute: it is relative to the source of the value."""
    nodes = list(tree.descend(path))
    last = nodes[-1]
    if len(nodes) <= len(path) or not isinstance(last.content, str) or not last.content:
        return tree
    absolute = os.path.normpath((last.at.source.folder / last.content).absolute())
    return tree.put(path, replace(last, content=absolute))


def validated(model: type[AnySettings], tree: Tree, mistakes: Iterable[Mistake]) -> AnySettings:
    """Return settings of a class from a tree; ConfigError with all earlier mistakes and those in the tree."""
    found = [*mistakes]
    try:
        settings = model.model_validate(tree.data)
    except ValidationError as error:
        located = locate(error, model, tree)
        found += (m for m in located if all(node.readable for node in tree.descend(m.path)))
    else:
        if not found:
            return settings
    raise ConfigError(mistakes_text(found))


def load_experiment(path: Path, overrides: Sequence[str] = ()) -> Experiment:
    """Read and validate an experiment file.

    Parameters
    ----------
    path : pathlib.Path
        YAML file. Its sections may name further files, relative to its own folder.
    overrides : sequence of str
        As for `Override`, applied in turn.

    Raises
    ------
    ConfigError
        With all mistakes, each at its file, line and column.
    """
    return load_with_files(path, overrides)[0]


def load_with_files(path: Path, overrides: Sequence[str] = ()) -> tuple[Experiment, list[Path]]:
    """Load an experiment as `load_experiment` does; also return the files that it is read from and that it names."""
    tree, mistakes = assemble(open_source(path), overrides)
    experiment = validated(Experiment, tree, mistakes)
    return experiment, [*tree.files(), *experiment.data_files()]


def parse_run(text: str, name: str, overrides: Sequence[str] = ()) -> RunSettings:
    """Validate the settings in a data file, of an experiment or of a recorded run; otherwise as `parse_experiment`."""
    tree, mistakes = assemble(ConfigSource(name, Path(), text), overrides)
    is_recorded = isinstance(tree.data, dict) and "recording" in tree.data
    return validated(ImportedRun if is_recorded else Experiment, tree, mistakes)


def parse_experiment(text: str, name: str, overrides: Sequence[str] = ()) -> Experiment:
    """Validate the text of an experiment; ConfigError with all mistakes.

    Parameters
    ----------
    text : str
        YAML, as from `dump_experiment`. Relative paths in it refer to the current folder.
    name : str
        Name of the source in messages.
    overrides : sequence of str
        As for `Override`, applied in turn.
    """
    return validated(Experiment, *assemble(ConfigSource(name, Path(), text), overrides))


def parse_drawing(drawing: Mapping[str, Any]) -> Drawing:
    """Validate a drawing given as plain values with units; ConfigError with all mistakes."""
    try:
        text = yaml.safe_dump(_plain(drawing), sort_keys=False)
    except yaml.YAMLError as error:
        raise ConfigError(f"geometry: {type(error.args[-1]).__name__} is not a value of a setting") from None
    return validated(Drawing, *read_tree(ConfigSource("geometry", Path(), text)))


def parse_vehicle(text: str, name: str) -> VehicleSettings:
    """Validate the YAML text of a vehicle file, called `name` in messages; ConfigError with all mistakes."""
    return validated(VehicleSettings, *read_tree(ConfigSource(name, Path(), text)))


def _plain(value: Any) -> Any:
    """Turn mappings, sequences and numbers of any kind into those that YAML can write."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, Real) and not isinstance(value, bool):
        return int(value) if isinstance(value, Integral) else float(value)
    return [_plain(inner) for inner in value] if isinstance(value, list | tuple) else value


def dump_experiment(experiment: RunSettings) -> str:
    """Return resolved settings as YAML in SI numbers, which `parse_run` reads back to an equal object."""
    return as_yaml(given_settings(experiment))


def as_yaml(settings: dict[str, Any]) -> str:
    """Return plain values as YAML in their order."""
    # PyYAML's own dumper writes the same text more slowly than libyaml.
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return yaml.dump(settings, Dumper=dumper, sort_keys=False, width=100, default_flow_style=None)


def given_settings(experiment: RunSettings) -> dict[str, Any]:
    """Return resolved settings as plain values in SI, without None and empty lists and mappings."""
    return _without_empty(experiment.model_dump(mode="json", by_alias=True))


def _without_empty(settings: Any) -> Any:
    if not isinstance(settings, dict):
        return settings
    inner = {key: _without_empty(value) for key, value in settings.items()}
    return {key: value for key, value in inner.items() if value not in (None, [], {})}


def find_campaign(name: str) -> Path:
    """Find a campaign file by path or by the name of a shipped one."""
    return _file_or_shipped(name, shipped_configs() / "campaigns", "a campaign")


def find_experiment(name: str | None) -> Path:
    """Find an experiment file.

    Parameters
    ----------
    name : str or None
        Path, folder with an ``experiment.yaml``, or name of a shipped experiment; None for ``spiral``.

    Raises
    ------
    ConfigError
        If it is none of these; the message lists the shipped experiments.
    """
    folder = shipped_configs()
    if name is None:
        return folder / "spiral.yaml"
    within = Path(name) / EXPERIMENT_FILE
    path = within if name and os.path.lexists(within) else _file_or_shipped(name, folder, "an experiment")
    if path.is_dir():
        raise ConfigError(f"{name}: folder without {EXPERIMENT_FILE}; name an experiment file")
    return path


def _file_or_shipped(name: str, folder: Path, kind: str) -> Path:
    shipped = {path.stem: path for path in sorted(folder.glob("*.yaml"))}
    path = Path(name)
    # The results folder of an experiment may have its name.
    if name in shipped and (path.is_dir() or not os.path.lexists(path)):
        return shipped[name]
    if name and os.path.lexists(path):
        return path
    key, equals, _ = name.partition("=")
    is_setting = equals and all(part.isidentifier() for part in key.split("."))
    hint = f"; give a setting as --set {shlex.quote(name)}, in Python as an argument of its own"
    raise ConfigError(
        f"{name!r} is neither a file nor {kind} that ships with auvid: {', '.join(shipped) or 'none'}"
        + (hint if is_setting else "")
    )
