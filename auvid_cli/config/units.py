"""Numbers with units (``7 Hz``, ``0.1 cm/s``, ``0.003 g`` or a bare SI number) to floats in SI, within plausible
limits.
"""

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeAlias

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

if TYPE_CHECKING:
    from pint import UnitRegistry

SizeCheck: TypeAlias = Callable[[float, str], float]
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
UNIT_TOKEN = re.compile(r"[^\W\d]\w*(?:(?:\^|\*\*)-?\d(?:\.\d+)?|[²³])?|°|1(?=\s*/)|[\s*/()·]")
_STANDARD_GRAVITY = re.compile(r"(?<!\w)([mµμu]?)g(?!\w)")
# Characters; pint takes the square of the length in time.
_LONGEST_UNIT = 100
EXAMPLES = {
    "Hz": ("a frequency", "7 Hz"),
    "s": ("a time", "10 s"),
    "m": ("a length", "0.2 m"),
    "m/s": ("a speed", "0.1 cm/s"),
    "m/s^2": ("an acceleration", "0.003 g"),
    "rad": ("an angle", "1.5 deg"),
    "rad/s": ("an angular rate", "0.2 deg/s"),
    "N": ("a force", "466 N"),
    "N*m": ("a moment", "2 N*m"),
    "J": ("an energy", "20 kJ"),
    "kg": ("a mass", "47.5 kg"),
    "kg/m^3": ("a density", "1025 kg/m^3"),
    "1": ("a share", "50 %"),
}


class Magnitude(NamedTuple):
    """Sizes that numbers of a unit may have: `smallest` binds amounts, such as a standard deviation, if they are not 0."""

    smallest: float
    largest: float


_BY_UNIT = {
    # Clocks count from 1970, some of them in nanoseconds.
    "s": Magnitude(1e-9, 1e20),
    "Hz": Magnitude(1e-6, 1e4),
    "m": Magnitude(1e-12, 1e6),
    "m/s": Magnitude(1e-12, 1e6),
    "m/s^2": Magnitude(1e-12, 1e6),
    "rad": Magnitude(1e-12, 1e6),
    "rad/s": Magnitude(1e-12, 1e6),
    "N": Magnitude(1e-9, 1e12),
    "N*m": Magnitude(1e-9, 1e15),
}


# Noise densities, random walks, and what a gain in a log map is.
_OTHERWISE = Magnitude(1e-12, 1e6)


# Mass, inertia and coefficients of hulls from a centimetre to a kilometre.
_OF_MASS = Magnitude(1e-15, 1e20)


def magnitude_of(unit: str) -> Magnitude:
    """Return the limits of a unit as the settings write it."""
    return _BY_UNIT.get(unit, _OF_MASS if "kg" in unit else _OTHERWISE)


def check_size(value: float, unit: str) -> float:
    """Return a number that may be so large in its unit.

    Raises
    ------
    ValueError
        If it may not be.
    """
    most = magnitude_of(unit).largest
    if abs(value) > most:
        raise ValueError(f"must be at most {_written(most, unit)} in size, got {value:g}")
    return value


def check_amount(value: float, unit: str) -> float:
    """Return a number that may be so large, and if it is not 0 so small, in its unit.

    Raises
    ------
    ValueError
        If it may not be.
    """
    least = magnitude_of(unit).smallest
    if 0.0 < abs(value) < least:
        raise ValueError(f"must be at least {_written(least, unit)} if it is not 0, got {value:g}")
    return check_size(value, unit)


def _written(limit: float, unit: str) -> str:
    return f"{limit:g} {unit}".strip()


# By `docs/make_reference.py`.
_USUAL = Path(__file__).with_name("usual_units.json")


def parse_quantity(value: Any, unit: str) -> float:
    """Read one quantity.

    Parameters
    ----------
    value : number or str
        A number, also as text, is in SI already; text such as ``"0.1 cm/s"`` is converted. A lone
        ``g`` is standard gravity where an acceleration is expected, and gram otherwise.
    unit : str
        SI unit of the result. A radian is a pure number, except that it tells ``rad/s`` from
        ``Hz``: neither is taken for the other.

    Returns
    -------
    float
        Finite magnitude in `unit`.

    Raises
    ------
    ValueError
        If it is not such a quantity; the message is one sentence.
    """
    try:
        if isinstance(value, Real) and not isinstance(value, bool):
            result = float(value)
        elif isinstance(value, str) and (number := NUMBER.match(value.strip())):
            unit_text = value.strip()[number.end() :].strip()
            result = float(number.group()) * (_factor(unit_text, unit) if unit_text else 1.0)
        else:
            raise ValueError("not a quantity")
        if not math.isfinite(result):
            raise ValueError("not finite")
    except (ValueError, OverflowError):
        raise ValueError(f"expected {expected(unit)}, got {describe(value)}") from None
    return result


def parse_number(text: str) -> float:
    """Read a bare number as programs write it: ASCII digits, perhaps a sign, a decimal point, an exponent.

    Raises
    ------
    ValueError
        If it is not a number, or too large; other notations of Python, such as ``5_0``, are refused.
    """
    if not NUMBER.fullmatch(text.strip()) or not math.isfinite(number := float(text)):
        raise ValueError(f"{describe(text)} is not a finite number")
    return number


def parse_components(value: Any, unit: str, n: int, check: SizeCheck = check_size) -> tuple[float, ...]:
    """Read one quantity for all components, or a list of 1 or `n` of them, each of a size that passes a check.

    Returns
    -------
    tuple of float
        Magnitudes in `unit`, of length 1 or `n`.

    Raises
    ------
    ValueError
        If the list is of another length or one of the quantities is wrong.
    """
    if not isinstance(value, list | tuple):
        return (check(parse_quantity(value, unit), unit),)
    if len(value) not in (1, n):
        counts = "1" if n == 1 else f"1 or {n}"
        raise ValueError(f"expected one quantity or a list of {counts}, got a list of {len(value)}")
    return tuple(_component(item, unit, index, check) for index, item in enumerate(value, start=1))


@dataclass(frozen=True)
class Unit:
    """SI unit of a field, ``Annotated[float, Unit("m/s")]``: the field takes any unit of that dimension."""

    unit: str
    check: ClassVar[SizeCheck] = staticmethod(check_size)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Parse the quantity before the field's own validation, and see whether it can be of that size."""

        def parse(value: Any) -> float:
            return type(self).check(parse_quantity(value, self.unit), self.unit)

        return core_schema.no_info_before_validator_function(parse, handler(source))


class Amount(Unit):
    """SI unit of a field that is not negative: values too small to compute with are refused, except 0."""

    check = staticmethod(check_amount)


class AmountPerAxis(Amount):
    """SI unit of a field of amounts along three axes: one for all of them or a list of one each."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Parse the quantities before the field's own validation."""

        def parse(value: Any) -> tuple[float, ...]:
            return parse_components(value, self.unit, 3, type(self).check)

        return core_schema.no_info_before_validator_function(parse, handler(source))


def expected(unit: str) -> str:
    """Return a phrase for messages with an example of a quantity of that unit."""
    kind, example = EXAMPLES.get(unit, ("a quantity", f"0.1 {unit}"))
    bare = "a bare number" if unit == "1" else f"a bare number in {unit}"
    return f"{kind} such as '{example}' or {bare}"


def describe(value: Any) -> str:
    """Describe a YAML value in a few words, for messages."""
    match value:
        case None:
            return "nothing"
        case bool():
            return str(value).lower()
        case int() if value.bit_length() > 64:
            return "a huge number"
        case dict():
            return "a mapping"
        case list() | tuple():
            return "a list"
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else f"{text[:56]} ..."


def _component(item: Any, unit: str, index: int, check: SizeCheck) -> float:
    try:
        return check(parse_quantity(item, unit), unit)
    except ValueError as error:
        raise ValueError(f"component {index}: {error}") from None


@cache
def _registry() -> "UnitRegistry":
    from pint import UnitRegistry

    return UnitRegistry()


@cache
def _factor(text: str, unit: str) -> float:
    """Return the size of the unit `text` in `unit`; ValueError if it is unknown or of another dimension."""
    if (text, unit) == ("%", "1"):
        return 0.01
    scale, dimension, angle = _base(unit)
    if dimension.get("meter") and not dimension.get("kilogram") and dimension.get("second", 0.0) < -1.0:
        text = with_standard_gravity(text)
    size, other_dimension, other_angle = _base(text)
    angle_tells = set(dimension) <= {"second"}
    if other_dimension != dimension or (angle_tells and other_angle != angle):
        raise ValueError("another dimension")
    return size / scale


@cache
def _usual_units() -> dict[str, list[Any]]:
    """Return what `size_of_unit` says of units that ship: with no others pint, a third of a second, is not loaded."""
    return json.loads(_USUAL.read_text(encoding="utf-8"))


def with_standard_gravity(unit: str) -> str:
    """Take every g of an acceleration's unit for standard gravity, and not for a gram."""
    return _STANDARD_GRAVITY.sub(r"\1g_0", unit)


@cache
def _base(unit: str) -> tuple[float, dict[str, float], float]:
    """Return what `size_of_unit` says; ValueError for an unknown unit."""
    if len(unit) > _LONGEST_UNIT or UNIT_TOKEN.sub("", unit):
        raise ValueError(f"{describe(unit)} is not a unit")
    if (known := _usual_units().get(unit)) is not None:
        size, exponents, angle = known
        return size, exponents, angle
    return size_of_unit(unit)


def size_of_unit(unit: str) -> tuple[float, dict[str, float], float]:
    """Return the size in SI base units, their exponents without the radian, and the exponent of the radian.

    Raises
    ------
    ValueError
        If it is none.
    """
    registry = _registry()
    try:
        base: Any = registry.Quantity(1.0, unit.replace("·", "*")).to_base_units()
        exponents = {name: float(power) for name, power in base.unit_items()}
    except Exception as error:  # pint lets errors of its tokenizer and of its arithmetic escape
        raise ValueError(f"{unit!r} is not a unit") from error
    return float(base.magnitude), exponents, exponents.pop("radian", 0.0)
