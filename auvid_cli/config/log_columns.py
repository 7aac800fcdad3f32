"""Settings of what is read from a log: columns with their units, times, spans, and which rows count."""

from difflib import get_close_matches
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, field_validator, model_validator

from auvid_cli.config.settings import Settings
from auvid_cli.config.units import EXAMPLES, Unit, check_size, describe, parse_quantity

# Units that logs write so and the registry of units does not know.
_WORDS = {"%": "percent", "1": "dimensionless", "rev/s": "turn/s", "rpm": "turn/min", "RPM": "turn/min"}
# How logs spell units, to name the one that was meant.
_SPELLINGS = {
    "s": ("s", "sec", "ms", "us", "ns", "min", "h"),
    "rad": ("rad", "deg", "degree", "degrees", "radian", "turn"),
    "rad/s": ("rad/s", "deg/s", "degree/s", "turn/s", "rpm"),
    "m/s": ("m/s", "cm/s", "mm/s", "km/h", "kn", "knot", "knots", "ft/s"),
    "m/s^2": ("m/s^2", "cm/s^2", "g", "mg"),
    "m": ("m", "cm", "mm", "ft", "feet", "meter"),
    "turn/s": ("turn/s", "rev/s", "rpm"),
    "percent": ("percent", "%", "1"),
    "N": ("N", "kN", "newton"),
    "N*m": ("N*m", "N*cm"),
}


def unit_factor(name: str, unit: str) -> float:
    """Return the size of a unit as logs write it, in an SI unit.

    Parameters
    ----------
    name : str
        ``deg``, ``Kn``, ``m/s``; capitals do not matter where the unit is not known otherwise.
    unit : str
        SI unit.

    Raises
    ------
    ValueError
        If it is no unit of that dimension.
    """
    name = _WORDS.get(name, name)
    try:
        return parse_quantity(f"1 {name}", unit)
    except ValueError:
        return parse_quantity(f"1 {name.lower()}", unit)


def check_unit(name: str | None, unit: str) -> str | None:
    """Return a unit as it is given.

    Raises
    ------
    ValueError
        If it is no unit that a map may state where `unit` is the SI unit; the message names those that it may.
    """
    if name is not None:
        try:
            unit_factor(name, unit)
        except ValueError:
            usual = _SPELLINGS.get(unit, (unit,))
            near = get_close_matches(name.lower(), usual, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"expected one such as {', '.join(usual)}"
            raise ValueError(f"{name!r} is no unit of {EXAMPLES.get(unit, ('this', ''))[0]}; {hint}") from None
    return name


class NamedColumn(Settings):
    """A column of a log; a bare name is one without further ado."""

    column: Annotated[str, Field(min_length=1, description="name in the log")]

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_name(cls, data: Any) -> Any:
        return {"column": data} if isinstance(data, str) else data


class LogSignal(NamedColumn):
    """A column, or a message's field, and how its numbers become SI: sign x (raw - centre) x scale + offset.

    A bare name is a column without further ado.
    """

    si: ClassVar[str] = ""

    unit: Annotated[str | None, Field(description="of the log's numbers; else as the log's header states it, else SI")]
    unit = None
    sign: Annotated[Literal[1, -1], Field(description="-1 where the log counts the other way")] = 1
    centre: Annotated[float, Field(ge=-1e12, le=1e12, description="the log's number that means zero")] = 0.0
    scale: Annotated[float | None, Field(description="one unit of the log's number, such as 0.35 deg; for counts")]
    scale = None
    offset: Annotated[float, Field(description="added at the end")] = 0.0
    limits: Annotated[
        tuple[float, float] | None, Field(description="[lowest, highest]; what is outside is missing")
    ] = None

    @field_validator("unit", mode="before")
    @classmethod
    def _accept_the_number_one(cls, value: Any) -> Any:
        return "1" if type(value) is int and value == 1 else value

    @field_validator("unit", mode="after")
    @classmethod
    def _known_unit(cls, unit: str | None) -> str | None:
        return check_unit(unit, cls.si)

    @field_validator("scale", "offset", mode="before")
    @classmethod
    def _quantity(cls, value: Any) -> Any:
        return value if value is None else check_size(parse_quantity(value, cls.si), cls.si)

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
    def _one_size(self) -> "LogSignal":
        if self.unit is not None and self.scale is not None:
            raise ValueError("expected 'unit' or 'scale', not both: a scale such as '0.35 deg' has its unit in it")
        return self


class TimeSource(NamedColumn):
    """When the rows of a table were measured; a bare name is a column without further ado."""

    column: Annotated[str, Field(min_length=1, description="a column, `@log_time` or `@header_stamp`")]
    table: Annotated[
        str | None, Field(description="another table that holds the times: its rows go with this one's one by one")
    ] = None
    unit: Annotated[str | None, Field(description="of numbers; else as the log's header states it, else s")] = None
    offset: Annotated[float, Unit("s"), Field(description="added, where the clock is late")] = 0.0

    @field_validator("unit", mode="after")
    @classmethod
    def _known_unit(cls, unit: str | None) -> str | None:
        return check_unit(unit, "s")


class RowChoice(Settings):
    """A column that tells rows apart, and what it holds in those that count."""

    column: Annotated[str, Field(min_length=1, description="name in the log")]
    values: Annotated[tuple[bool | int | float | str, ...], Field(min_length=1, description="in those that count")] = (
        True,
        1,
    )


class LogRows(Settings):
    """Where columns stand."""

    log: Annotated[str | None, Field(description="one of `logs`; may be left out if there is one")] = None
    table: Annotated[str | None, Field(description="topic or kind of message; of a CSV file left out")] = None
    time: Annotated[TimeSource | None, Field(description="when its rows were measured")] = None
    rows: Annotated[RowChoice | None, Field(description="which rows count, by an id; else all")] = None


class PlacedSignal(LogSignal, LogRows):
    """Signal that may be in another table, with its own times."""


class Angle(PlacedSignal):
    """A signal of an angle."""

    si = "rad"


class AngularRate(PlacedSignal):
    """A signal of an angular rate."""

    si = "rad/s"


class Speed(PlacedSignal):
    """A signal of a velocity."""

    si = "m/s"


class Acceleration(PlacedSignal):
    """A signal of a specific force."""

    si = "m/s^2"


class MagneticFlux(PlacedSignal):
    """Density of a magnetic flux."""

    si = "T"


class Length(PlacedSignal):
    """A signal of a length; of a depth also a pressure, by its scale in metres."""

    si = "m"


class Number(LogSignal):
    """A signal of a pure number."""

    si = "dimensionless"


LOG_SIGNALS: dict[str, type[PlacedSignal]] = {
    kind.si: kind for kind in (Angle, AngularRate, Speed, Acceleration, MagneticFlux, Length)
}
