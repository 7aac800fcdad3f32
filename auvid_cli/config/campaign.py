"""Settings of a campaign: an experiment repeated over seeds, filters and axes, and the choices on each axis."""

import json
from collections.abc import Callable, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, field_validator, model_validator

from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.config.loading import Change, Override, as_yaml, assemble, open_source, validated
from auvid_cli.config.settings import Settings
from auvid_cli.config.source_positions import KeyPath, Mistake, Tree, dotted, mistakes_text
from auvid_cli.errors import ConfigError

# Value of any setting, from YAML; it is validated as part of the experiment.
AnyValue: TypeAlias = Any
Label: TypeAlias = str | float | int | bool  # of a choice, in the results
_Finite = Annotated[float, Field(ge=-1e20, le=1e20)]
_NAME = r"^[A-Za-z][A-Za-z0-9_.-]*$"


class Distribution(Settings):
    """Distribution of a setting, drawn once per seed, the same for all filters."""

    uniform: Annotated[tuple[_Finite, _Finite] | None, Field(description="[lowest, highest]")] = None
    log_uniform: Annotated[tuple[_Finite, _Finite] | None, Field(description="[lowest, highest], both above 0")] = None
    normal: Annotated[tuple[_Finite, _Finite] | None, Field(description="[mean, standard deviation]")] = None

    @model_validator(mode="after")
    def _valid_distribution(self) -> "Distribution":
        if len(self.model_fields_set) != 1:
            raise ValueError(f"expected one of {', '.join(type(self).model_fields)}")
        for name in ("uniform", "log_uniform"):
            interval = getattr(self, name)
            if interval is not None and not interval[0] < interval[1]:
                raise ValueError(f"{name}: the lowest must be less than the highest")
        if self.log_uniform is not None and not self.log_uniform[0] > 0.0:
            raise ValueError("log_uniform: the lowest must be greater than 0")
        if self.normal is not None and not self.normal[1] > 0.0:
            raise ValueError("normal: the standard deviation must be greater than 0")
        return self


class CampaignAxis(Settings):
    """One axis of a campaign: values of a setting, levels of several settings, or a draw per seed of either."""

    setting: Annotated[str | None, Field(description="dotted key of a setting of the experiment")] = None
    values: Annotated[tuple[AnyValue, ...] | None, Field(min_length=1, description="values of the setting")] = None
    draw: Annotated[Distribution | None, Field(description="distribution of the setting, in SI")] = None
    relative: Annotated[bool, Field(strict=True, description="whether values and draws are factors")] = False
    name: Annotated[str | None, Field(pattern=_NAME, description="column in the results; default: the setting")] = None
    levels: Annotated[
        dict[str, dict[str, AnyValue]] | None,
        Field(min_length=1, description="levels by label, each with the values of its settings by dotted key"),
    ] = None
    drawn_levels: Annotated[
        tuple[Annotated[int, Field(ge=0, strict=True)], Annotated[int, Field(ge=1, strict=True)]] | None,
        Field(description="[fewest, most] levels that each seed draws at random; default: each level by itself"),
    ] = None
    known: Annotated[
        bool,
        Field(
            strict=True,
            description="whether filters also use the value; otherwise they use the value in the experiment",
        ),
    ] = True

    @model_validator(mode="after")
    def _valid_axis(self) -> "CampaignAxis":
        given = [name for name in ("values", "draw", "levels") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError("expected exactly one of `values` or `draw` of a `setting`, or `levels`")
        if (self.setting is None) != (self.levels is not None):
            raise ValueError("`values` and `draw` need the key of a `setting`; `levels` have their own keys")
        if self.levels is not None and self.name is None:
            raise ValueError("`levels` need a `name`, the column in the results")
        if self.levels is not None and self.relative:
            raise ValueError("`relative` is only possible with `values` or `draw`")
        if self.drawn_levels is not None:
            fewest, most = self.drawn_levels
            if self.levels is None or not fewest <= most <= len(self.levels):
                raise ValueError("`drawn_levels` needs `levels`, and [fewest, most] of them")
        for key in self.keys:
            if key in ("seed", "name", "identification.filters"):
                raise ValueError(f"`{key}` cannot vary; set `seeds` and `filters` of the campaign instead")
            if not self.known and not key.startswith(("vehicle.", "sensors.", "manoeuvre.")):
                raise ValueError(
                    f"`known: false` is only possible for settings of vehicle, sensors or manoeuvre, not for {key!r}"
                )
        return self

    @property
    def keys(self) -> set[str]:
        """Return the dotted keys of the settings that vary."""
        return {str(self.setting)} if self.levels is None else {key for level in self.levels.values() for key in level}

    @property
    def column(self) -> str:
        """Return the name of the column in the results."""
        return self.name or str(self.setting)

    @property
    def is_drawn(self) -> bool:
        """Whether each seed draws its own value."""
        return self.draw is not None or self.drawn_levels is not None

    @property
    def size(self) -> int:
        """Return the number of combinations along the axis, 1 for a draw."""
        return 1 if self.is_drawn else len(self.values or self.levels or ())


class FilterVariant(Settings):
    """A filter with its own settings."""

    filter: Annotated[FilterName, Field(description="filter to run")]
    name: Annotated[str, Field(pattern=_NAME, description="name in the results; default: that of the filter")]
    settings: Annotated[
        dict[str, AnyValue], Field(description="settings of the filter by dotted key, in identification or vehicle")
    ] = Field(default_factory=dict)
    fit: Annotated[
        bool, Field(strict=True, description="whether `auvid fit` searches for a model, beginning with these settings")
    ] = False

    @model_validator(mode="after")
    def _fits_with_the_smoother(self) -> "FilterVariant":
        if self.fit and self.filter is not JUDGE:
            raise ValueError(f"`fit: true` needs `filter: {JUDGE.value}`, which `auvid fit` uses")
        return self

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_filter(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"filter": data, "name": data}
        return {"name": data.get("filter"), **data} if isinstance(data, dict) else data

    @field_validator("settings")
    @classmethod
    def _only_filter_settings(cls, settings: dict[str, AnyValue]) -> dict[str, AnyValue]:
        for key in settings:
            if key == "identification.filters":
                raise ValueError(f"{key!r}: not possible here, since each filter runs alone")
            if not key.startswith(("identification.", "vehicle.")):
                raise ValueError(f"{key!r}: not possible here, since all filters share the data; use `vary`")
        return settings


class Campaign(Settings):
    """A campaign file."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", description="folder under results/campaigns/")]
    experiment: Annotated[str, Field(description="experiment file, relative to this file, or shipped name")] = "spiral"
    settings: Annotated[dict[str, AnyValue], Field(description="common settings, by dotted key")] = Field(
        default_factory=dict
    )
    seeds: Annotated[
        Annotated[int, Field(ge=1, strict=True)]
        | Annotated[tuple[Annotated[int, Field(ge=0, lt=2**63, strict=True)], ...], Field(min_length=1)],
        Field(description="number of seeds, which count from 1, or a list of seeds"),
    ] = 20
    filters: Annotated[tuple[FilterVariant, ...], Field(min_length=1, description="names, or names with settings")] = ()
    vary: Annotated[tuple[CampaignAxis, ...], Field(description="axes; all combinations run")] = ()

    @field_validator("settings")
    @classmethod
    def _no_seed_or_name(cls, settings: dict[str, AnyValue]) -> dict[str, AnyValue]:
        for key, instead in (("seed", "`seeds`"), ("name", "the campaign's own `name`")):
            if key in settings:
                raise ValueError(f"`{key}` has no effect in a campaign; use {instead}, outside of `settings`")
        return settings

    @field_validator("seeds")
    @classmethod
    def _distinct_seeds(cls, seeds: int | tuple[int, ...]) -> int | tuple[int, ...]:
        if not isinstance(seeds, int) and len(set(seeds)) < len(seeds):
            raise ValueError("duplicate seed")
        return seeds

    @model_validator(mode="after")
    def _distinct_names(self) -> "Campaign":
        for key, names in (
            ("filters", [variant.name for variant in self.filters]),
            ("vary", [axis.column for axis in self.vary]),
        ):
            duplicate = next((name for name in names if names.count(name) > 1), None)
            if duplicate is not None:
                raise ValueError(f"{key}: duplicate name {duplicate!r}; give one of them another `name`")
        return self

    @property
    def seed_list(self) -> Sequence[int]:
        """Return all seeds; use `n_seeds` for their number, because `len` of a range is limited to 2^63."""
        return range(1, self.seeds + 1) if isinstance(self.seeds, int) else self.seeds

    @property
    def n_seeds(self) -> int:
        """Return the number of seeds."""
        return self.seeds if isinstance(self.seeds, int) else len(self.seeds)

    @property
    def n_cells(self) -> int:
        """Return the number of combinations of settings."""
        return prod(axis.size for axis in self.vary)


def dump_campaign(campaign: Campaign) -> str:
    """Return the given settings as YAML, which `load_campaign` reads back to an equal object."""
    return as_yaml(campaign.model_dump(mode="json", by_alias=True, exclude_unset=True))


def load_campaign(path: Path, overrides: Sequence[str] = ()) -> tuple[Campaign, Tree]:
    """Read and validate a campaign file; also return its tree with positions. ConfigError with all mistakes."""
    tree, mistakes = assemble(open_source(path))
    for override in map(Override.parse, overrides):
        mistakes += override.mistakes
        for key, value in override.changes:
            # Keys in `settings` contain dots: `settings.manoeuvre.duration=60 s` sets `manoeuvre.duration`.
            place = (key[0], dotted(key[1:])) if key[0] == "settings" and len(key) > 1 else key
            try:
                tree = tree.put(place, value)
            except ValueError as error:
                mistakes.append(Mistake(value.at, key, str(error)))
    return validated(Campaign, tree, mistakes), tree


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
