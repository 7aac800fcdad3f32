"""Completions for shells; without any a shell completes names of files.

This module does not load the settings classes, because a shell asks at every press of a key.
"""

from collections.abc import Iterable
from pathlib import Path

from auvid_cli.config.shipped import shipped_configs

_KEYS = Path(__file__).with_name("setting_keys.txt")
_SETTINGS, _DATASETS = (".yaml", ".yml"), (".h5", ".hdf5")


def complete_experiment(incomplete: str) -> list[str]:
    """List shipped experiments and settings files of this folder that begin so."""
    return _beginning(incomplete, _shipped("."), _files_here(_SETTINGS))


def complete_data(incomplete: str) -> list[str]:
    """List shipped experiments, settings files and datasets of this folder that begin so."""
    return _beginning(incomplete, _shipped("."), _files_here((*_SETTINGS, *_DATASETS)))


def complete_campaign(incomplete: str) -> list[str]:
    """List shipped campaigns and settings files of this folder that begin so."""
    return _beginning(incomplete, _shipped("campaigns"), _files_here(_SETTINGS))


def complete_setting(incomplete: str) -> list[str]:
    """List keys of an experiment and settings files of this folder that begin so."""
    keys = _KEYS.read_text(encoding="utf-8").split()
    return _beginning(incomplete, (f"{key}=" for key in keys), _files_here(_SETTINGS))


def _beginning(incomplete: str, *offers: Iterable[str]) -> list[str]:
    return [name for names in offers for name in names if name.startswith(incomplete)]


def _shipped(folder: str) -> list[str]:
    return sorted(path.stem for path in (shipped_configs() / folder).glob("*.yaml"))


def _files_here(suffixes: tuple[str, ...]) -> list[str]:
    return sorted(path.name for path in Path().iterdir() if path.suffix in suffixes)
