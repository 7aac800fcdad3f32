"""Axes of a campaign, and how its runs ended."""

import json
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from auvid_cli.config.campaign import CampaignAxis, Distribution
from auvid_cli.config.loading import Change
from auvid_cli.config.source_positions import KeyPath, Mistake, Tree, mistakes_text
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    import pandas as pd

Label: TypeAlias = str | float | int | bool


def ended(rows: "pd.DataFrame") -> "pd.Series":
    """Say whether a row is of a run that came to the end of its data."""
    return rows["status"].str.startswith(("completed", "inconsistent"))


def failed(rows: "pd.DataFrame") -> "pd.Series":
    """Say whether a row is of a run that could not be done at all."""
    return rows["status"].str.startswith("failed")


def diverged(rows: "pd.DataFrame") -> "pd.Series":
    """Say whether a row is of a run whose filter did not come to the end of its data."""
    return ~ended(rows) & ~failed(rows)


class Option(NamedTuple):
    """Settings of one run by one axis.

    Attributes
    ----------
    label : str or number
        In the results.
    changes : list of Change
        Settings, with the place where they are written.
    known : bool
        Whether filters assume it, too.
    """

    label: Label
    changes: list[Change]
    known: bool


def axis_options(axis: CampaignAxis, written: Tree, experiment: Mapping[str, Any]) -> list[Callable[[int], Option]]:
    """Return the options of an axis, each as a function of the seed.

    Parameters
    ----------
    axis : CampaignAxis
    written : Tree
        The same as it stands in the campaign file.
    experiment : mapping
        Resolved settings, which a relative axis multiplies.

    Raises
    ------
    ConfigError
        If there is no number to multiply.
    """
    if axis.levels is not None:
        places = {label: _at(written, ("levels", label)) for label in axis.levels}
        choices = [Option(label, changes_in(place), axis.known) for label, place in places.items()]
        return [lambda seed, option=option: option for option in choices]
    setting = setting_path(str(axis.setting))

    def option(label: Any, place: Tree) -> Option:
        value = _instead(place, _times(label, setting, experiment, place)) if axis.relative else place
        return Option(label if isinstance(label, Label) else json.dumps(label), [(setting, value)], axis.known)

    if axis.draw is not None:
        place, distribution = _at(written, ("draw",)), axis.draw
        # Of the column and not of its place among the axes: another axis more leaves it as it was.
        key = list(axis.column.encode())

        def drawn(seed: int) -> Option:
            value = _draw(distribution, np.random.default_rng([seed, *key]))
            return option(value, _instead(place, value))

        return [drawn]
    choices = [option(value, _at(written, ("values", k))) for k, value in enumerate(axis.values or ())]
    return [lambda seed, option=option: option for option in choices]


def changes_in(mapping: Tree | None) -> list[Change]:
    """List the entries of a mapping from dotted keys to values."""
    return [(setting_path(key), value) for key, value in (mapping.content or {}).items()] if mapping else []


def setting_path(key: str) -> KeyPath:
    """Split a dotted key into a path."""
    return tuple(part.strip() for part in key.split("."))


def _instead(place: Tree, value: float | list[float]) -> Tree:
    """Put a computed value in the place of one that is written there."""
    content = [_instead(place, item) for item in value] if isinstance(value, list) else value
    return Tree(content, place.at, place.key_at)


def _at(tree: Tree, path: KeyPath) -> Tree:
    *_, last = tree.descend(path)
    return last


def _draw(distribution: Distribution, random: np.random.Generator) -> float:
    if distribution.normal is not None:
        return float(random.normal(*distribution.normal))
    if distribution.log_uniform is not None:
        low, high = np.log(distribution.log_uniform)
        return float(np.exp(random.uniform(low, high)))
    low, high = distribution.uniform or (0.0, 1.0)
    return float(random.uniform(low, high))


def _times(factor: Any, setting: KeyPath, experiment: Mapping[str, Any], place: Tree) -> float | list[float]:
    """Multiply what the experiment states by a factor."""
    value: Any = experiment
    for part in setting:
        value = value.get(part) if isinstance(value, dict) else None
    if isinstance(value, dict):
        # An entry of a vehicle, which says where its value comes from.
        value = value.get("value")
    numbers = value if isinstance(value, list) else [value]
    if isinstance(factor, bool) or not isinstance(factor, int | float):
        raise ConfigError(
            mistakes_text([Mistake(place.at, setting, f"`relative` multiplies by numbers, got {factor!r}")])
        )
    if not numbers or not all(isinstance(number, int | float) for number in numbers):
        message = "`relative` multiplies a number, and the experiment states none there"
        raise ConfigError(mistakes_text([Mistake(place.at, setting, message)]))
    scaled = [factor * float(number) for number in numbers]
    return scaled if isinstance(value, list) else scaled[0]
