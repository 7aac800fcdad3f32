"""Settings of a campaign: an experiment over seeds, filters and any settings."""

from collections.abc import Sequence
from math import prod
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import Field, field_validator, model_validator

from auvid_cli.config.enums import FilterName
from auvid_cli.config.loading import Override, as_yaml, assemble, open_source, validated
from auvid_cli.config.settings import Settings
from auvid_cli.config.source_positions import Mistake, Tree, dotted

# A value of any setting, as YAML gives it; the experiment judges it.
AnyValue: TypeAlias = Any
_Finite = Annotated[float, Field(ge=-1e20, le=1e20)]
_NAME = r"^[A-Za-z][A-Za-z0-9_.-]*$"


class Distribution(Settings):
    """Distribution from which a setting is drawn, once for each seed, the same for all filters."""

    uniform: Annotated[tuple[_Finite, _Finite] | None, Field(description="[lowest, highest]")] = None
    log_uniform: Annotated[tuple[_Finite, _Finite] | None, Field(description="[lowest, highest], both above 0")] = None
    normal: Annotated[tuple[_Finite, _Finite] | None, Field(description="[mean, standard deviation]")] = None

    @model_validator(mode="after")
    def _is_one(self) -> "Distribution":
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
    """One thing that varies: by values of a setting, by levels that set several, or by a draw for each seed."""

    setting: Annotated[str | None, Field(description="dotted key of the experiment")] = None
    values: Annotated[
        tuple[AnyValue, ...] | None, Field(min_length=1, description="of the setting, one after the other")
    ] = None
    draw: Annotated[Distribution | None, Field(description="of the setting, in SI")] = None
    relative: Annotated[
        bool, Field(strict=True, description="whether values and draws multiply what the experiment states")
    ] = False
    name: Annotated[str | None, Field(pattern=_NAME, description="column in the results; default: the setting")] = None
    levels: Annotated[
        dict[str, dict[str, AnyValue]] | None,
        Field(min_length=1, description="by label, the settings of each level by their dotted keys"),
    ] = None
    known: Annotated[
        bool,
        Field(
            strict=True,
            description="whether filters use the value, too; otherwise they use the value of the experiment",
        ),
    ] = True

    @model_validator(mode="after")
    def _is_one_kind(self) -> "CampaignAxis":
        given = [name for name in ("values", "draw", "levels") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError("expected `values` or `draw` of a `setting`, or `levels`, and only one of them")
        if (self.setting is None) != (self.levels is not None):
            raise ValueError("`values` and `draw` need the key of their `setting`; `levels` name their own")
        if self.levels is not None and self.name is None:
            raise ValueError("`levels` need a `name` for their column in the results")
        if self.levels is not None and self.relative:
            raise ValueError("`relative` goes with `values` or `draw`")
        for key in self.keys:
            if key in ("seed", "name", "identification.filters"):
                raise ValueError(f"`{key}` does not vary: seeds and filters have lists of their own")
            if not self.known and not key.startswith(("vehicle.", "sensors.")):
                raise ValueError(f"`known: false` is for settings of vehicle or sensors, not for {key!r}")
        return self

    @property
    def keys(self) -> set[str]:
        """Return the dotted keys of all settings that it touches."""
        return {str(self.setting)} if self.levels is None else {key for level in self.levels.values() for key in level}

    @property
    def column(self) -> str:
        """Return what the axis is called in results."""
        return self.name or str(self.setting)

    @property
    def size(self) -> int:
        """Return how many settings it leads to; a draw adds none."""
        return len(self.values or self.levels or (None,))


class FilterVariant(Settings):
    """A filter, with settings of its own."""

    filter: FilterName
    name: Annotated[str, Field(pattern=_NAME, description="in the results; default: the filter")]
    settings: Annotated[
        dict[str, AnyValue],
        Field(description="settings of the filter by dotted key, below identification or vehicle"),
    ] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_filter(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"filter": data, "name": data}
        return {"name": data.get("filter"), **data} if isinstance(data, dict) else data

    @field_validator("settings")
    @classmethod
    def _concerns_the_filter(cls, settings: dict[str, AnyValue]) -> dict[str, AnyValue]:
        for key in settings:
            if key == "identification.filters":
                raise ValueError(f"{key!r} has no effect here: each filter runs alone")
            if not key.startswith(("identification.", "vehicle.")):
                raise ValueError(f"{key!r} concerns the data, which all filters share: vary it instead")
        return settings


class Campaign(Settings):
    """A campaign file."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", description="folder under results/campaigns/")]
    experiment: Annotated[str, Field(description="file, relative to this one, or the name of one that ships")] = (
        "spiral"
    )
    settings: Annotated[dict[str, AnyValue], Field(description="of every run, by dotted key")] = Field(
        default_factory=dict
    )
    seeds: Annotated[
        Annotated[int, Field(ge=1, strict=True)]
        | Annotated[tuple[Annotated[int, Field(ge=0, lt=2**63, strict=True)], ...], Field(min_length=1)],
        Field(description="a number of seeds, which count from 1, or a list"),
    ] = 20
    filters: Annotated[tuple[FilterVariant, ...], Field(min_length=1, description="names, or names with settings")] = ()
    vary: Annotated[tuple[CampaignAxis, ...], Field(description="every combination is run")] = ()

    @field_validator("settings")
    @classmethod
    def _have_an_effect(cls, settings: dict[str, AnyValue]) -> dict[str, AnyValue]:
        for key, instead in (("seed", "`seeds`"), ("name", "the campaign's own `name`")):
            if key in settings:
                raise ValueError(f"`{key}` has no effect in a campaign: say {instead}, outside of `settings`")
        return settings

    @field_validator("seeds")
    @classmethod
    def _each_once(cls, seeds: int | tuple[int, ...]) -> int | tuple[int, ...]:
        if not isinstance(seeds, int) and len(set(seeds)) < len(seeds):
            raise ValueError("a seed stands twice")
        return seeds

    @model_validator(mode="after")
    def _names_are_told_apart(self) -> "Campaign":
        for what, names in (
            ("filters", [variant.name for variant in self.filters]),
            ("vary", [axis.column for axis in self.vary]),
        ):
            twice = next((name for name in names if names.count(name) > 1), None)
            if twice is not None:
                raise ValueError(f"{what}: {twice!r} stands twice; give one of them another `name`")
        return self

    @property
    def seed_list(self) -> Sequence[int]:
        """Return all seeds; of more than 2^63 Python cannot say how many there are, `n_seeds` can."""
        return range(1, self.seeds + 1) if isinstance(self.seeds, int) else self.seeds

    @property
    def n_seeds(self) -> int:
        """Return how many seeds there are."""
        return self.seeds if isinstance(self.seeds, int) else len(self.seeds)

    @property
    def n_cells(self) -> int:
        """Return how many combinations of settings there are."""
        return prod(axis.size for axis in self.vary)


def dump_campaign(campaign: Campaign) -> str:
    """Write what a campaign's file and overrides say as YAML, which `load_campaign` reads back to an equal object."""
    return as_yaml(campaign.model_dump(mode="json", by_alias=True, exclude_unset=True))


def load_campaign(path: Path, overrides: Sequence[str] = ()) -> tuple[Campaign, Tree]:
    """Read and validate a campaign file.

    Returns
    -------
    Campaign
    Tree
        The settings with the position of each value.

    Raises
    ------
    ConfigError
        With every mistake at once, each at its file, line and column.
    """
    tree, mistakes = assemble(open_source(path))
    for override in map(Override.parse, overrides):
        mistakes += override.mistakes
        for key, value in override.changes:
            # Keys of the experiment have dots of their own: `settings.manoeuvre.duration=60 s` sets one of them.
            place = (key[0], dotted(key[1:])) if key[0] == "settings" and len(key) > 1 else key
            try:
                tree = tree.put(place, value)
            except ValueError as error:
                mistakes.append(Mistake(value.at, key, str(error)))
    return validated(Campaign, tree, mistakes), tree
