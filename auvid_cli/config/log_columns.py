"""Settings of what is read from a log: columns with their units, times, spans, and which rows count."""

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_validator

from auvid_cli.config.model import Settings
from auvid_cli.config.quantity import Unit, describe, parse_quantity

Seconds = Annotated[float, Unit("s")]
# Units that logs write so and the registry of units does not know.
_WORDS = {"%": "percent", "rev/s": "turn/s", "rpm": "turn/min", "RPM": "turn/min"}


def unit_factor(stated: str, unit: str) -> float:
    """Size of a unit as logs write it, in an SI unit.

    Parameters
    ----------
    stated : str
        ``deg``, ``Kn``, ``m/s``; capitals do not matter where the unit is not known otherwise.
    unit : str
        SI unit.

    Raises
    ------
    ValueError
        If it is no unit of that dimension.
    """
    stated = _WORDS.get(stated, stated)
    try:
        return parse_quantity(f"1 {stated}", unit)
    except ValueError:
        return parse_quantity(f"1 {stated.lower()}", unit)


class Reading(Settings):
    """A column, or a message's field, and how its numbers become SI: sign x (raw - centre) x scale + offset.

    A bare name is a column without further ado.
    """

    si: ClassVar[str] = ""

    column: Annotated[str, Field(min_length=1, description="name in the log")]
    unit: Annotated[str | None, Field(description="of the log's numbers; else as the log's header states it, else SI")]
    unit = None
    sign: Annotated[Literal[1, -1], Field(description="-1 where the log counts the other way")] = 1
    centre: Annotated[float, Field(description="the log's number that means zero")] = 0.0
    scale: Annotated[float | None, Field(description="one unit of the log's number, such as 0.35 deg; for counts")]
    scale = None
    offset: Annotated[float, Field(description="added at the end")] = 0.0
    limits: Annotated[
        tuple[float, float] | None, Field(description="[lowest, highest]; what is outside is missing")
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_name(cls, data: Any) -> Any:
        return {"column": data} if isinstance(data, str) else data

    @field_validator("unit", mode="after")
    @classmethod
    def _known_unit(cls, stated: str | None) -> str | None:
        if stated is not None:
            unit_factor(stated, cls.si)
        return stated

    @field_validator("scale", "offset", mode="before")
    @classmethod
    def _quantity(cls, value: Any) -> Any:
        return value if value is None else parse_quantity(value, cls.si)

    @field_validator("limits", mode="before")
    @classmethod
    def _two_quantities(cls, value: Any) -> Any:
        if value is None:
            return value
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise ValueError(f"expected [lowest, highest], got {describe(value)}")
        low, high = (parse_quantity(limit, cls.si) for limit in value)
        if not low < high:
            raise ValueError("the lowest must be less than the highest")
        return low, high

    @model_validator(mode="after")
    def _one_size(self) -> "Reading":
        if self.unit is not None and self.scale is not None:
            raise ValueError("expected 'unit' or 'scale', not both: a scale such as '0.35 deg' has its unit in it")
        return self


class Angle(Reading):
    """A reading of an angle."""

    si = "rad"


class AngularRate(Reading):
    """A reading of an angular rate."""

    si = "rad/s"


class Speed(Reading):
    """A reading of a velocity."""

    si = "m/s"


class Acceleration(Reading):
    """A reading of a specific force."""

    si = "m/s^2"


class Length(Reading):
    """A reading of a length; of a depth also a pressure, by its scale in metres."""

    si = "m"


class Number(Reading):
    """A reading of a pure number."""

    si = "dimensionless"


READINGS: dict[str, type[Reading]] = {kind.si: kind for kind in (Angle, AngularRate, Speed, Acceleration, Length)}


class TimeSource(Settings):
    """When the rows of a table were measured; a bare name is a column without further ado."""

    column: Annotated[str, Field(min_length=1, description="a column, `@log_time` or `@header_stamp`")]
    table: Annotated[
        str | None, Field(description="another table that holds the times: its rows go with this one's one by one")
    ] = None
    unit: Annotated[str | None, Field(description="of numbers; else as the log's header states it, else s")] = None
    offset: Annotated[Seconds, Field(description="added, where the clock is late")] = 0.0

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_name(cls, data: Any) -> Any:
        return {"column": data} if isinstance(data, str) else data

    @field_validator("unit", mode="after")
    @classmethod
    def _known_unit(cls, stated: str | None) -> str | None:
        if stated is not None:
            unit_factor(stated, "s")
        return stated


class Rows(Settings):
    """Where columns stand."""

    log: Annotated[str | None, Field(description="one of `logs`; may be left out if there is one")] = None
    table: Annotated[str | None, Field(description="topic or kind of message; of a CSV file left out")] = None
    time: Annotated[TimeSource | None, Field(description="when its rows were measured")] = None


class Validity(Settings):
    """A column that says which rows are valid."""

    column: Annotated[str, Field(min_length=1, description="name in the log")]
    values: Annotated[tuple[bool | int | float | str, ...], Field(min_length=1, description="that mean valid")] = (
        True,
        1,
    )


def _spans(value: Any) -> Any:
    """Accept one span for a list of one."""
    if isinstance(value, list | tuple) and len(value) == 2 and not any(isinstance(end, list | tuple) for end in value):
        return (value,)
    return value


def _ends_after_it_begins(spans: Sequence[tuple[float, float]]) -> Sequence[tuple[float, float]]:
    for begin, end in spans:
        if not begin < end:
            raise ValueError(f"a span must end after it begins, unlike [{begin:g} s, {end:g} s]")
    return spans


Spans = Annotated[
    tuple[tuple[Seconds, Seconds], ...],
    BeforeValidator(_spans),
    AfterValidator(_ends_after_it_begins),
]
