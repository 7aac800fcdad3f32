"""Settings of the columns of a log: units, times and valid rows of its signals, and the inputs of the model."""

from difflib import get_close_matches
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, create_model, field_validator, model_validator

from auvid_cli.config.settings import Settings
from auvid_cli.config.units import EXAMPLES, Amount, Unit, check_size, describe, parse_quantity
from auvid_cli.vehicle.parameters import ALL_INPUTS

# Spellings of units that pint does not know.
_ALIASES = {"%": "percent", "1": "dimensionless", "rev/s": "turn/s", "rpm": "turn/min", "RPM": "turn/min"}
# Usual spellings by SI unit, for suggestions in messages.
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


@lru_cache(maxsize=1024)
def unit_factor(name: str, unit: str) -> float:
    """Return the size of a unit such as ``deg`` or ``Kn`` in an SI unit; an unknown unit is tried in lower case.

    Raises
    ------
    ValueError
        If it is unknown or of another dimension.
    """
    name = _ALIASES.get(name, name)
    try:
        return parse_quantity(f"1 {name}", unit)
    except ValueError:
        return parse_quantity(f"1 {name.lower()}", unit)


def factor_if_known(name: str, unit: str) -> float | None:
    """Return `unit_factor`; None if the unit is unknown or of another dimension."""
    try:
        return unit_factor(name, unit)
    except ValueError:
        return None


def check_unit(name: str | None, unit: str) -> str | None:
    """Return the unit of a log unchanged; ValueError if it is not of the dimension of the SI unit `unit`."""
    usual = _SPELLINGS.get(unit, (unit,))
    # Validators do not see the default; a null is a question that a suggested map leaves open.
    if name is None:
        raise ValueError(f"got nothing; fill in the unit of the log's numbers, such as {', '.join(usual)}")
    if factor_if_known(name, unit) is None:
        near = get_close_matches(name.lower(), usual, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"expected a unit such as {', '.join(usual)}"
        raise ValueError(f"{name!r}: not a unit of {EXAMPLES.get(unit, ('this signal', ''))[0]}; {hint}")
    return name


class NamedColumn(Settings):
    """A column of a log; the bare name is enough."""

    column: Annotated[str, Field(min_length=1, description="name of the column in the log")]

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_name(cls, data: Any) -> Any:
        return {"column": data} if isinstance(data, str) else data


class LogSignal(NamedColumn):
    """A column, or a field of a message; its SI value is sign x (raw - centre) x scale + offset.

    The bare name of the column is enough.
    """

    si: ClassVar[str] = ""

    def __init_subclass__(cls, si: str = "", **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.si = si or cls.si

    unit: Annotated[str | None, Field(description="unit in the log; default: that in its header, else SI")]
    unit = None
    sign: Annotated[Literal[1, -1], Field(description="-1 if the log has the opposite sign")] = 1
    centre: Annotated[float, Field(ge=-1e12, le=1e12, description="number in the log that means zero")] = 0.0
    scale: Annotated[float | None, Field(description="size of one count of the log, such as 0.35 deg")]
    scale = None
    offset: Annotated[float, Field(description="offset, added last")] = 0.0
    limits: Annotated[tuple[float, float] | None, Field(description="[lowest, highest] valid value")] = None

    @field_validator("unit", mode="before")
    @classmethod
    def _accept_the_number_one(cls, value: Any) -> Any:
        return "1" if type(value) is int and value == 1 else value

    @field_validator("unit", mode="after")
    @classmethod
    def _known_unit(cls, unit: str | None) -> str | None:
        return check_unit(unit, cls.si)

    # Only inputs have a `constant`.
    @field_validator("scale", "offset", "constant", mode="before", check_fields=False)
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
    """Times of the rows of a table; the bare name of a column is enough."""

    column: Annotated[str, Field(min_length=1, description="column, `@log_time` or `@header_stamp`")]
    table: Annotated[str | None, Field(description="table of the times, one row for each row of this table")] = None
    unit: Annotated[str | None, Field(description="unit; default: that in the log's header, else s")] = None
    offset: Annotated[float, Unit("s"), Field(description="offset, added to the times")] = 0.0
    nanoseconds: Annotated[
        str | None, Field(min_length=1, description="column with the nanoseconds, if `column` has whole seconds")
    ] = None
    format: Annotated[
        str | None, Field(min_length=1, description="format of dates as text, such as '%d/%m/%Y %H:%M:%S.%f'")
    ] = None
    run: Annotated[
        int | None, Field(ge=1, strict=True, description="run to use if the clock starts again in the log; first: 1")
    ] = None

    @field_validator("unit", mode="after")
    @classmethod
    def _known_unit(cls, unit: str | None) -> str | None:
        return check_unit(unit, "s")

    @field_validator("format", "run", mode="before")
    @classmethod
    def _answered(cls, value: Any) -> Any:
        if value is None:
            raise ValueError("got nothing; fill it in")
        return value


class RowChoice(Settings):
    """Column that selects rows, and its values in the rows to use."""

    column: Annotated[str, Field(min_length=1, description="name of the column in the log")]
    values: Annotated[tuple[bool | int | float | str, ...], Field(min_length=1, description="values of valid rows")] = (
        True,
        1,
    )


class LogRows(Settings):
    """Table of the columns, with its times and rows."""

    log: Annotated[str | None, Field(description="name in `logs`; not needed if there is only one")] = None
    table: Annotated[str | None, Field(description="topic or kind of message; not needed for a CSV file")] = None
    time: Annotated[TimeSource | None, Field(description="times of the rows")] = None
    rows: Annotated[RowChoice | None, Field(description="rows to use, by an id; default: all")] = None


class PlacedSignal(LogSignal, LogRows):
    """A signal that may be in another table, with its own times."""


class Number(LogSignal, si="dimensionless"):
    """A signal of a pure number."""


_MEANINGS = {
    "rad": "an angle",
    "rad/s": "an angular rate",
    "m/s": "a velocity",
    "m/s^2": "a specific force",
    "T": "a magnetic flux density",
    "m": "a length; for the depth also a pressure, with a scale in metres",
}
# Settings class of a component of a sensor, by its SI unit.
LOG_SIGNALS: dict[str, type[PlacedSignal]] = {
    unit: create_model("Signal", __base__=PlacedSignal, __doc__=f"A signal of {meaning}.", __cls_kwargs__={"si": unit})
    for unit, meaning in _MEANINGS.items()
}


class InputSignal(PlacedSignal):
    """A signal of an input, or a constant; a bare number is a constant in SI units."""

    column: Annotated[str, Field(description="name of the column in the log")] = ""
    constant: Annotated[float | None, Field(description="constant value such as 10.9 N, instead of a column")] = None

    @model_validator(mode="before")
    @classmethod
    def _accept_a_number(cls, data: Any) -> Any:
        return {"constant": data} if isinstance(data, int | float) and not isinstance(data, bool) else data

    @model_validator(mode="after")
    def _one_source(self) -> "InputSignal":
        if bool(self.column) == (self.constant is not None):
            raise ValueError("expected either 'column' or 'constant'")
        return self


class Fin(InputSignal, si="rad"):
    """Angle of a fin, or of all fins of one input."""


class Force(InputSignal, si="N"):
    """A force."""


class Moment(InputSignal, si="N*m"):
    """A moment."""


class Revolutions(InputSignal, si="turn/s"):
    """Revolutions per second of a propeller."""


class Voltage(InputSignal, si="V"):
    """Voltage of the battery."""


class Share(InputSignal, si="percent"):
    """A thruster's command in percent, or with the unit '1' as a fraction."""


class Fins(Settings):
    """Angles of single fins: any of top, bottom, right and left; or the four of an X tail.

    A fin angle is positive if it pushes the tail to starboard, or up for a horizontal fin; otherwise use sign: -1.
    """

    top: Annotated[Fin | None, Field(description="fin above the hull")] = None
    bottom: Annotated[Fin | None, Field(description="fin below the hull")] = None
    right: Annotated[Fin | None, Field(description="fin to starboard")] = None
    left: Annotated[Fin | None, Field(description="fin to port")] = None
    upper_right: Annotated[Fin | None, Field(description="fin of an X tail")] = None
    lower_right: Annotated[Fin | None, Field(description="fin of an X tail")] = None
    lower_left: Annotated[Fin | None, Field(description="fin of an X tail")] = None
    upper_left: Annotated[Fin | None, Field(description="fin of an X tail")] = None

    @model_validator(mode="after")
    def _one_tail(self) -> "Fins":
        names = set(self.given())
        diagonal = {name for name in names if "_" in name}
        if not names:
            raise ValueError(f"expected at least one of {', '.join(type(self).model_fields)}")
        if diagonal and (len(diagonal) < 4 or names - diagonal):
            raise ValueError("an X tail has upper_right, lower_right, lower_left and upper_left, and no other fins")
        return self


class Thrust(Settings):
    """Thrust by F = a n|n| + b |n| u of a propeller, or F = full x|x| of a command x from -100 to 100 percent."""

    revolutions: Annotated[Revolutions | None, Field(description="revolutions n, in turn/s or rpm")] = None
    a: Annotated[float | None, Amount("N*s^2"), Field(gt=0, description="force at zero speed per (turn/s)^2")] = None
    b: Annotated[float, Unit("N*s^2/m"), Field(le=0, description="loss of force with speed u")] = 0.0
    share: Annotated[Share | None, Field(description="command x in percent, or with unit '1' as a fraction")] = None
    full: Annotated[float | None, Amount("N"), Field(gt=0, description="force at 100 percent")] = None

    @model_validator(mode="after")
    def _one_law(self) -> "Thrust":
        by_revolutions = self.revolutions is not None and self.a is not None
        by_share = self.share is not None and self.full is not None
        mixed = (self.revolutions, self.a) != (None, None) and (self.share, self.full) != (None, None)
        if by_revolutions == by_share or mixed:
            raise ValueError("expected 'revolutions' with 'a', or 'share' with 'full'")
        if self.b and not by_revolutions:
            raise ValueError("'b' is only possible with 'revolutions'")
        return self


class InputsMap(LogRows):
    """Inputs of the model; missing inputs are zero. Log, table and time are the defaults of all signals."""

    rudder: Annotated[Fin | None, Field(description="rudder angle; positive pushes the tail to starboard")] = None
    elevator: Annotated[Fin | None, Field(description="elevator angle; positive pushes the tail up")] = None
    fins: Annotated[Fins | None, Field(description="single fins, instead of rudder and elevator")] = None
    surge_force: Annotated[Force | None, Field(description="thrust, if the log has it")] = None
    thrust: Annotated[Thrust | None, Field(description="thrust from revolutions or command")] = None
    roll_moment: Annotated[
        Moment | Literal["propeller"] | None,
        Field(description="roll moment, or 'propeller': thrust times the vehicle's K_prop / X_prop"),
    ] = None
    revolutions: Annotated[Revolutions | None, Field(description="revolutions, for own terms of the vehicle")] = None
    voltage: Annotated[Voltage | None, Field(description="voltage of the battery, for own terms of the vehicle")] = None

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_name(cls, data: Any) -> Any:
        moment = data.get("roll_moment") if isinstance(data, dict) else None
        if isinstance(moment, str) and moment != "propeller":
            return {**data, "roll_moment": {"column": moment}}
        return data

    @model_validator(mode="after")
    def _no_contradiction(self) -> "InputsMap":
        if self.fins is not None and (self.rudder is not None or self.elevator is not None):
            raise ValueError("expected 'fins', or 'rudder' and 'elevator', not both")
        if self.thrust is not None and self.surge_force is not None:
            raise ValueError("expected 'thrust' or 'surge_force', not both")
        if not self._signals():
            raise ValueError(f"expected at least one of {', '.join(InputsMap.model_fields)}")
        return self

    def channels(self) -> dict[tuple[str, ...], InputSignal]:
        """Return the signals in the log, by their path in the settings."""
        return {path: signal for path, signal in self._signals().items() if signal.constant is None}

    def constants(self) -> dict[tuple[str, ...], float]:
        """Return the constants, SI, by their path in the settings."""
        return {path: signal.constant for path, signal in self._signals().items() if signal.constant is not None}

    def _signals(self) -> dict[tuple[str, ...], InputSignal]:
        signals: dict[tuple[str, ...], Any] = {
            (quantity.symbol,): getattr(self, quantity.symbol) for quantity in ALL_INPUTS
        }
        if self.fins is not None:
            signals |= {("fins", name): fin for name, fin in self.fins.given().items()}
        if self.thrust is not None:
            signals |= {("thrust", name): getattr(self.thrust, name) for name in ("revolutions", "share")}
        return {path: signal for path, signal in signals.items() if isinstance(signal, InputSignal)}
