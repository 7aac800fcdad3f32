"""Convert quantities such as ``7 Hz``, ``0.1 cm/s`` or a bare SI number to plausible floats in SI."""

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
_MAX_UNIT_LENGTH = 100  # characters; the time of pint is proportional to the square of the length
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
    """Limits of numbers of a unit; `smallest` is for amounts such as a standard deviation, unless they are 0."""

    smallest: float
    largest: float


_MAGNITUDES = {
    # Some clocks count nanoseconds since 1970.
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
# Mass, inertia and coefficients, for hulls from a centimetre to a kilometre.
_MASS_MAGNITUDE = Magnitude(1e-15, 1e20)
# Noise densities, random walks and gains.
_OTHER_MAGNITUDE = Magnitude(1e-12, 1e6)


def magnitude_of(unit: str) -> Magnitude:
    """Return the limits of an SI unit of the settings."""
    return _MAGNITUDES.get(unit, _MASS_MAGNITUDE if "kg" in unit else _OTHER_MAGNITUDE)


def check_size(value: float, unit: str) -> float:
    """Return the number unchanged; ValueError if it is too large for its unit."""
    largest = magnitude_of(unit).largest
    if abs(value) > largest:
        raise ValueError(f"must be at most {largest:g} {unit}".rstrip() + f" in size, got {value:g}")
    return value


def check_amount(value: float, unit: str) -> float:
    """Return the number unchanged; ValueError if it is too large or, unless it is 0, too small for its unit."""
    smallest = magnitude_of(unit).smallest
    if 0.0 < abs(value) < smallest:
        raise ValueError(f"must be at least {smallest:g} {unit}".rstrip() + f" if it is not 0, got {value:g}")
    return check_size(value, unit)


# Written by `docs/make_reference.py`.
_USUAL_UNITS_FILE = Path(__file__).with_name("usual_units.json")


def parse_quantity(value: Any, unit: str) -> float:
    """Read one quantity.

    Parameters
    ----------
    value : number or str
        A bare number, also as text, is in SI; text such as ``"0.1 cm/s"`` is converted. ``g`` is standard
        gravity for an acceleration, and gram otherwise.
    unit : str
        SI unit of the result. A radian is a pure number, except that ``rad/s`` and ``Hz`` are different
        dimensions.

    Returns
    -------
    float
        Finite magnitude in `unit`.

    Raises
    ------
    ValueError
        If it is not a quantity of that dimension.
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
    """Read a bare decimal number in ASCII digits; ValueError for other notations, such as ``5_0``, and for infinity."""
    if not NUMBER.fullmatch(text.strip()) or not math.isfinite(number := float(text)):
        raise ValueError(f"{describe(text)} is not a finite number")
    return number


def parse_components(value: Any, unit: str, n: int, check: SizeCheck = check_size) -> tuple[float, ...]:
    """Read one quantity for all components, or a list of 1 or `n`; return 1 or `n` numbers in `unit`.

    Raises
    ------
    ValueError
        If the list has another length, or a quantity is invalid or fails `check`.
    """
    if not isinstance(value, list | tuple):
        return (check(parse_quantity(value, unit), unit),)
    if len(value) not in (1, n):
        counts = "1" if n == 1 else f"1 or {n}"
        raise ValueError(f"expected one quantity or a list of {counts}, got a list of {len(value)}")
    components = []
    for index, item in enumerate(value, start=1):
        try:
            components.append(check(parse_quantity(item, unit), unit))
        except ValueError as error:
            raise ValueError(f"component {index}: {error}") from None
    return tuple(components)


@dataclass(frozen=True)
class Unit:
    """SI unit of a field, ``Annotated[float, Unit("m/s")]``; users may write any unit of that dimension."""

    unit: str
    check: ClassVar[SizeCheck] = staticmethod(check_size)

    def parse(self, value: Any) -> Any:
        """Return a quantity, or several, as numbers in the unit; ValueError if it is invalid or fails `check`."""
        return type(self).check(parse_quantity(value, self.unit), self.unit)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Parse before the field's own validation."""
        return core_schema.no_info_before_validator_function(self.parse, handler(source))


class Amount(Unit):
    """SI unit of a field that is not negative; very small values, except 0, are refused."""

    check = staticmethod(check_amount)


class AmountPerAxis(Amount):
    """SI unit of a field of amounts along three axes: one for all axes or a list of one each."""

    def parse(self, value: Any) -> tuple[float, ...]:
        """Return one number for all axes or one for each."""
        return parse_components(value, self.unit, 3, type(self).check)


def expected(unit: str) -> str:
    """Return a phrase for messages, with an example of a quantity of that unit."""
    kind, example = EXAMPLES.get(unit, ("a quantity", f"0.1 {unit}"))
    bare = "a bare number" if unit == "1" else f"a bare number in {unit}"
    return f"{kind} such as '{example}' or {bare}"


def describe(value: Any) -> str:
    """Return a short description of a YAML value, for messages."""
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


_SIZES_OF_PERCENT = {"1": 0.01, "percent": 1.0}  # by the unit that is expected, because % is no part of other units


@cache
def _registry() -> "UnitRegistry":
    from pint import UnitRegistry

    return UnitRegistry()


@cache
def _factor(text: str, unit: str) -> float:
    """Return the size of the unit `text` in `unit`; ValueError if it is unknown or of another dimension."""
    if text == "%" and unit in _SIZES_OF_PERCENT:
        return _SIZES_OF_PERCENT[unit]
    scale, dimension, angle = _base(unit)
    if dimension.get("meter") and not dimension.get("kilogram") and dimension.get("second", 0.0) < -1.0:
        text = with_standard_gravity(text)
    size, other_dimension, other_angle = _base(text)
    # The radian distinguishes rad/s from Hz.
    angle_matters = set(dimension) <= {"second"}
    if other_dimension != dimension or (angle_matters and other_angle != angle):
        raise ValueError("another dimension")
    return size / scale


@cache
def _usual_units() -> dict[str, list[Any]]:
    """Return `size_of_unit` of the units in shipped files, so that these need no pint (0.3 s to import)."""
    return json.loads(_USUAL_UNITS_FILE.read_text(encoding="utf-8"))


def with_standard_gravity(unit: str) -> str:
    """Replace g by standard gravity: in the unit of an acceleration it is not a gram."""
    return _STANDARD_GRAVITY.sub(r"\1g_0", unit)


@cache
def _base(unit: str) -> tuple[float, dict[str, float], float]:
    """Return `size_of_unit` of any unit; ValueError for an unknown one."""
    if len(unit) > _MAX_UNIT_LENGTH or UNIT_TOKEN.sub("", unit):
        raise ValueError(f"{describe(unit)} is not a unit")
    if (usual := _usual_units().get(unit)) is not None:
        size, exponents, angle = usual
        return size, exponents, angle
    return size_of_unit(unit)


def size_of_unit(unit: str) -> tuple[float, dict[str, float], float]:
    """Return the size of a unit in SI base units, their exponents without the radian, and that of the radian.

    Raises
    ------
    ValueError
        If pint does not know the unit.
    """
    registry = _registry()
    try:
        base: Any = registry.Quantity(1.0, unit.replace("·", "*")).to_base_units()
        exponents = {name: float(power) for name, power in base.unit_items()}
    except Exception as error:  # pint raises errors of its tokenizer and of its arithmetic
        raise ValueError(f"{unit!r} is not a unit") from error
    return float(base.magnitude), exponents, exponents.pop("radian", 0.0)
