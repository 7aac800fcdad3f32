"""Axes of a campaign as settings of each run, and the outcomes of runs."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.campaign import CampaignAxis, Distribution
from auvid_cli.config.loading import Change
from auvid_cli.config.source_positions import KeyPath, Mistake, Tree, mistakes_text
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    import pandas as pd

Label: TypeAlias = str | float | int | bool


def ended(rows: "pd.DataFrame") -> "pd.Series":
    """Whether the run of each row reached the end of its data."""
    return rows["status"].str.startswith(("completed", "inconsistent"))


def failed(rows: "pd.DataFrame") -> "pd.Series":
    """Whether the run of each row ended with an error."""
    return rows["status"].str.startswith("failed")


def diverged(rows: "pd.DataFrame") -> "pd.Series":
    """Whether the filter of each row did not reach the end of its data."""
    return ~ended(rows) & ~failed(rows)


class CellErrors(NamedTuple):
    """Errors of the runs of a campaign with the same settings and filter."""

    key: tuple[Any, ...]  # value of each axis
    filter: str  # name of the filter variant
    errors: Array  # mean steady-state error of each run that ended and has one, shape (n,), %
    ended: int  # number of runs that reached the end of their data
    runs: int  # number of all runs

    @property
    def lost(self) -> float:
        """Return the share of runs that failed or diverged."""
        return 1.0 - self.ended / self.runs


def errors_by_cell(runs: "pd.DataFrame", columns: Sequence[str]) -> list[CellErrors]:
    """Return the errors of each combination of settings and filter, in the order of the runs.

    Parameters
    ----------
    runs : DataFrame
        A row for each run: axes, filter, status, steady_state_error_percent.
    columns : sequence of str
        Axes.
    """
    cells = []
    for key, rows in runs.groupby([*columns, "filter"], sort=False):
        *settings, name = key if isinstance(key, tuple) else (key,)
        errors = rows["steady_state_error_percent"].dropna().to_numpy(np.float64)
        cells.append(CellErrors(tuple(settings), str(name), errors, int(ended(rows).sum()), len(rows)))
    return cells


class Option(NamedTuple):
    """Choice on one axis for a run: its label in the results, its settings, and whether filters know them."""

    label: Label
    changes: list[Change]
    known: bool


def axis_options(axis: CampaignAxis, written: Tree, experiment: Mapping[str, Any]) -> list[Callable[[int], Option]]:
    """Return the options of an axis, each as a function of the seed.

    Parameters
    ----------
    written : Tree
        The axis in the campaign file, with positions.
    experiment : mapping
        Resolved settings; a relative axis multiplies their numbers.

    Raises
    ------
    ConfigError
        If a relative axis has no number to multiply.
    """
    if axis.levels is not None:
        places = {label: _at(written, ("levels", label)) for label in axis.levels}
        choices = [Option(label, changes_in(place), axis.known) for label, place in places.items()]
        if axis.drawn_levels is not None:
            return [lambda seed, numbers=axis.drawn_levels: _some_of(choices, numbers, _random(axis, seed))]
        return [lambda seed, option=option: option for option in choices]
    setting = setting_path(str(axis.setting))

    def option(label: Any, place: Tree) -> Option:
        value = _with_value(place, _scaled(label, setting, experiment, place)) if axis.relative else place
        return Option(label if isinstance(label, Label) else json.dumps(label), [(setting, value)], axis.known)

    if axis.draw is not None:
        place, distribution = _at(written, ("draw",)), axis.draw

        def drawn(seed: int) -> Option:
            value = _draw(distribution, _random(axis, seed))
            return option(value, _with_value(place, value))

        return [drawn]
    choices = [option(value, _at(written, ("values", k))) for k, value in enumerate(axis.values or ())]
    return [lambda seed, option=option: option for option in choices]


def changes_in(mapping: Tree | None) -> list[Change]:
    """Return the entries of a mapping with dotted keys as changes of settings."""
    return [(setting_path(key), value) for key, value in (mapping.content or {}).items()] if mapping else []


def setting_path(key: str) -> KeyPath:
    """Split a dotted key into a path."""
    return tuple(part.strip() for part in key.split("."))


def _with_value(place: Tree, value: float | list[float]) -> Tree:
    """Return a tree with the positions of `place` and a computed value."""
    content = [_with_value(place, item) for item in value] if isinstance(value, list) else value
    return Tree(content, place.at, place.key_at)


def _at(tree: Tree, path: KeyPath) -> Tree:
    *_, last = tree.descend(path)
    return last


def _random(axis: CampaignAxis, seed: int) -> np.random.Generator:
    # The name of the column, not its index, so that further axes do not change the draws.
    return np.random.default_rng([seed, *axis.column.encode()])


def _some_of(choices: Sequence[Option], numbers: tuple[int, int], random: np.random.Generator) -> Option:
    """Return some of the options, `numbers` fewest and most, as one."""
    fewest, most = numbers
    drawn = sorted(random.choice(len(choices), random.integers(fewest, most + 1), replace=False).tolist())
    label = "; ".join(str(choices[k].label) for k in drawn) or "none"
    return Option(label, [change for k in drawn for change in choices[k].changes], choices[0].known)


def _draw(distribution: Distribution, random: np.random.Generator) -> float:
    if distribution.normal is not None:
        return float(random.normal(*distribution.normal))
    if distribution.log_uniform is not None:
        low, high = np.log(distribution.log_uniform)
        return float(np.exp(random.uniform(low, high)))
    low, high = distribution.uniform or (0.0, 1.0)
    return float(random.uniform(low, high))


def _scaled(factor: Any, setting: KeyPath, experiment: Mapping[str, Any], place: Tree) -> float | list[float]:
    """Return a number or list of the experiment times a factor."""
    value: Any = experiment
    for part in setting:
        value = value.get(part) if isinstance(value, dict) else None
    if isinstance(value, dict):
        # An entry of a vehicle is a mapping with its value, status and source.
        value = value.get("value")
    numbers = value if isinstance(value, list) else [value]
    if isinstance(factor, bool) or not isinstance(factor, int | float):
        message = f"`relative` multiplies by numbers, got {factor!r}"
        raise ConfigError(mistakes_text([Mistake(place.at, setting, message)]))
    if not numbers or not all(isinstance(number, int | float) for number in numbers):
        message = "`relative` multiplies a number, but the experiment has no number there"
        raise ConfigError(mistakes_text([Mistake(place.at, setting, message)]))
    scaled = [factor * float(number) for number in numbers]
    return scaled if isinstance(value, list) else scaled[0]
