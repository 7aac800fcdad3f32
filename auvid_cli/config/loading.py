"""Settings from files and text, and back to text."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import ValidationError

from auvid_cli.config.assembly import assemble, read_source
from auvid_cli.config.experiment import Experiment, ImportedRun, RunSettings
from auvid_cli.config.locate import locate
from auvid_cli.config.settings import Settings
from auvid_cli.config.shipped import shipped_configs
from auvid_cli.config.source_positions import ConfigSource, Mistake, Tree, mistakes_text, read_tree
from auvid_cli.config.vehicle import Drawing, VehicleSettings
from auvid_cli.errors import ConfigError

# File of an experiment that is a folder.
EXPERIMENT_FILE = "experiment.yaml"


def load_experiment(path: Path, overrides: Sequence[str] = ()) -> Experiment:
    """Read and validate an experiment file.

    Parameters
    ----------
    path : pathlib.Path
        YAML file. Its sections may name further files, relative to its own folder.
    overrides : sequence of str
        As for `Override`, applied in turn.

    Returns
    -------
    Experiment
        Resolved settings in SI.

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


def open_source(path: Path) -> ConfigSource:
    """Read a settings file as text; ConfigError if it cannot be read."""
    try:
        return read_source(path)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}") from None


def parse_run(text: str, name: str, overrides: Sequence[str] = ()) -> RunSettings:
    """Validate settings from a data file: those of an experiment or of a recorded run; as `parse_experiment`."""
    tree, mistakes = assemble(ConfigSource(name, Path(), text), overrides)
    is_recorded = isinstance(tree.data, dict) and "recording" in tree.data
    return validated(ImportedRun if is_recorded else Experiment, tree, mistakes)


def parse_experiment(text: str, name: str, overrides: Sequence[str] = ()) -> Experiment:
    """Validate an experiment that is kept as text, for example inside a data file.

    Parameters
    ----------
    text : str
        YAML, as from `dump_experiment`. Relative paths in it refer to the current folder.
    name : str
        Name of the source in messages.
    overrides : sequence of str
        As for `Override`, applied in turn.

    Raises
    ------
    ConfigError
        With all mistakes.
    """
    return validated(Experiment, *assemble(ConfigSource(name, Path(), text), overrides))


def parse_drawing(drawing: Mapping[str, Any]) -> Drawing:
    """Validate a drawing given as plain values with units; ConfigError with all mistakes."""
    return _parse_part(Drawing, yaml.safe_dump(_plain(drawing), sort_keys=False), "geometry")


def parse_vehicle(text: str, name: str) -> VehicleSettings:
    """Validate the YAML text of a vehicle file, called `name` in messages; ConfigError with all mistakes."""
    return _parse_part(VehicleSettings, text, name)


def _plain(value: Any) -> Any:
    """Turn mappings and sequences of any kind into dicts and lists, which YAML knows."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, list | tuple) else value


def dump_experiment(experiment: RunSettings) -> str:
    """Return resolved settings as YAML in SI numbers, which `parse_run` reads back to an equal object."""
    return as_yaml(given_settings(experiment))


def as_yaml(settings: dict[str, Any]) -> str:
    """Return plain values as YAML in their order."""
    # Without libyaml PyYAML's own dumper writes the same, only more slowly.
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return yaml.dump(settings, Dumper=dumper, sort_keys=False, width=100, default_flow_style=None)


def given_settings(experiment: RunSettings) -> dict[str, Any]:
    """Return resolved settings as plain values in SI, without None and empty lists and mappings."""
    return _given(experiment.model_dump(mode="json", by_alias=True))


def find_campaign(name: str) -> Path:
    """Find a campaign file by path or by the name of a shipped one."""
    return _file_or_shipped(name, shipped_configs() / "campaigns", "a campaign")


def find_experiment(name: str | None) -> Path:
    """Find an experiment file.

    Parameters
    ----------
    name : str or None
        Path, folder with an ``experiment.yaml``, or name of a shipped experiment such as ``spiral``, the default.

    Raises
    ------
    ConfigError
        If it is none of these; the message lists the shipped experiments.
    """
    folder = shipped_configs()
    if name is None:
        return folder / "spiral.yaml"
    within = Path(name) / EXPERIMENT_FILE
    path = within if name and within.is_file() else _file_or_shipped(name, folder, "an experiment")
    if path.is_dir():
        raise ConfigError(f"{name}: is a folder without {EXPERIMENT_FILE}; name an experiment file")
    return path


def _file_or_shipped(name: str, folder: Path, what: str) -> Path:
    shipped = {path.stem: path for path in sorted(folder.glob("*.yaml"))}
    path = Path(name)
    if name in shipped and not path.is_file():
        return shipped[name]
    if name and path.exists():
        return path
    key, equals, _ = name.partition("=")
    is_setting = equals and all(part.isidentifier() for part in key.split("."))
    hint = f"; a setting stands behind it: --set {shlex.quote(name)}, in Python an argument of its own"
    raise ConfigError(
        f"{name!r} is neither a file nor {what} that ships with auvid: {', '.join(shipped) or 'none'}"
        + (hint if is_setting else "")
    )


AnySettings = TypeVar("AnySettings", bound=Settings)


def _parse_part(model: type[AnySettings], text: str, name: str) -> AnySettings:
    tree, mistakes = read_tree(ConfigSource(name, Path(), text))
    return validated(model, tree, [*mistakes])


def validated(model: type[AnySettings], tree: Tree, mistakes: list[Mistake]) -> AnySettings:
    """Return settings of a class from a tree; ConfigError with all earlier mistakes and those in the tree."""
    try:
        settings = model.model_validate(tree.data)
    except ValidationError as error:
        located = locate(error, model, tree)
        mistakes += (m for m in located if all(node.readable for node in tree.descend(m.path)))
    else:
        if not mistakes:
            return settings
    raise ConfigError(mistakes_text(mistakes))


def _given(settings: Any) -> Any:
    if not isinstance(settings, dict):
        return settings
    inner = {key: _given(value) for key, value in settings.items()}
    return {key: value for key, value in inner.items() if value not in (None, [], {})}
