"""Base class of all settings, and types that several settings share: positions, axes and spans of time."""

import sys
from collections.abc import Callable
from itertools import pairwise
from math import inf, isfinite
from typing import Annotated, Any, TypeVar

from pydantic import AllowInfNan, BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer, create_model

from auvid_cli.config.units import parse_components, parse_quantity

Positive = tuple[Annotated[float, Field(gt=0)], ...]


class Settings(BaseModel):
    """Immutable settings; an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True, allow_inf_nan=False)

    def given(self) -> dict[str, Any]:
        """Return the settings that are not None, by name."""
        return {name: value for name, value in self if value is not None}


_Settings = TypeVar("_Settings", bound=Settings)


def make_settings(name: str, module: str, base: type[_Settings], meaning: str | None, **fields: Any) -> type[_Settings]:
    """Return a new settings class; `name` must be new in the module, because pickle finds the class there."""
    made = create_model(name, __base__=base, __module__=module, __doc__=meaning, **fields)
    setattr(sys.modules[module], name, made)
    return made


def with_fields(**fields: Any) -> Callable[[type[_Settings]], type[_Settings]]:
    """Return a decorator that adds fields from a table, each as type and default, to a settings class."""

    def extended(base: type[_Settings]) -> type[_Settings]:
        return create_model(base.__name__, __base__=base, __module__=base.__module__, __doc__=base.__doc__, **fields)

    return extended


def _three_lengths(value: Any) -> Any:
    if isinstance(value, list | tuple) and len(value) == 3:
        return parse_components(value, "m", 3)
    raise ValueError("expected [forward, starboard, down], such as [0.4 m, 0 m, 0.1 m]")


Lever = Annotated[tuple[float, float, float], BeforeValidator(_three_lengths)]


def three(values: tuple[float, ...]) -> tuple[float, ...]:
    """Return one number for each of three axes; a single number is repeated."""
    return values if len(values) == 3 else values * 3


def parse_spans(value: Any) -> tuple[tuple[float, float], ...]:
    """Read spans, s, from a list of ``[begin, end]`` or a single one; null means the start or end of the data."""
    if not isinstance(value, list | tuple):
        raise ValueError("expected a list of [begin, end]")
    if len(value) == 2 and not any(isinstance(end, list | tuple) for end in value):
        value = (value,)
    parsed = []
    for span in value:
        if not isinstance(span, list | tuple) or len(span) != 2:
            raise ValueError("expected [begin, end] for each span")
        begin, end = (
            open_end if bound is None else parse_quantity(bound, "s")
            for bound, open_end in zip(span, (-inf, inf), strict=True)
        )
        if not begin < end:
            raise ValueError(f"span [{begin:g}, {end:g}] s: the end must be later than the begin")
        parsed.append((begin, end))
    return tuple(parsed)


def parse_separate_spans(value: Any) -> tuple[tuple[float, float], ...]:
    """Read spans as `parse_spans` does; ValueError also if two of them overlap."""
    parsed = parse_spans(value)
    for (_, end), (begin, _) in pairwise(sorted(parsed)):
        if begin < end:
            raise ValueError(f"two spans overlap from {begin:g} s to {end:g} s")
    return parsed


# An open end is written as null.
_Serializer = PlainSerializer(lambda end: end if isfinite(end) else None, return_type=float | None)
_End = Annotated[float, AllowInfNan(True), _Serializer]
Spans = Annotated[tuple[tuple[_End, _End], ...], BeforeValidator(parse_spans)]
SeparateSpans = Annotated[tuple[tuple[_End, _End], ...], BeforeValidator(parse_separate_spans)]
