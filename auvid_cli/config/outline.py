"""A first vehicle: the few numbers that `auvid init` asks for, and the vehicle file that follows from a drawing."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import yaml
from pydantic import Field, model_validator

from auvid_cli.config.geometry import FinSettings, GeometrySettings, NoseCylinderTail, PositiveLength
from auvid_cli.config.loading import validated
from auvid_cli.config.settings import Settings
from auvid_cli.config.source_positions import ConfigSource, Position, Tree
from auvid_cli.config.units import Amount, Unit
from auvid_cli.config.vehicle import Drawing, Size
from auvid_cli.vehicle.coefficients import COEFFICIENTS, EQUATION_ROWS, Coefficient
from auvid_cli.vehicle.geometry import DERIVED_TERMS, DerivedValue, coefficients_from_geometry
from auvid_cli.vehicle.parameters import PARAMETERS
from auvid_cli.vehicle.rigid_body import GRAVITY

# A mass outside these limits has a wrong unit.
MIN_MASS_SHARE = 0.5  # share of the mass of water that the hull displaces
MAX_MASS_SHARE = 1.5  # share of the mass of water that the hull displaces
# Defaults of the shape; the hinges are at about the same place as on the REMUS.
_NOSE = 1.0  # diameters
_TAIL = 2.5  # diameters
_MAX_NOSE = 0.2  # share of the length
_MAX_TAIL = 0.4  # share of the length
_HINGES = 0.94  # share of the length, from the nose

# Distance of the centre of gravity below that of buoyancy, as a share of the diameter: mean of four published vehicles.
_BOTTOM_HEAVINESS = 0.06
_HEAVINESS_DEVIATION = 0.03
# Standard deviation of the buoyancy of a vehicle that is ballasted to float just so, as a share of the weight.
_BUOYANCY_DEVIATION = 0.005
_UNITS = {quantity.symbol: quantity.unit for quantity in (*PARAMETERS, *COEFFICIENTS)}

_OptionalLength = Annotated[float | None, Amount("m"), Field(gt=0, le=1e3)]


class Outline(Settings):
    """Outline of a vehicle; the keys are the options of `auvid init`."""

    length: Annotated[PositiveLength, Field(description="hull length")]
    diameter: Annotated[PositiveLength, Field(description="hull diameter")]
    mass: Annotated[float, Amount("kg"), Field(gt=0, description="mass, including all water inside")]
    fin_span: Annotated[PositiveLength, Field(description="span of one fin, from root to tip")]
    fin_area: Annotated[float, Amount("m^2"), Field(gt=0, le=1e4, description="area of one fin")]
    fin_position: Annotated[
        _OptionalLength, Field(description="distance of the fins' hinges from the nose; default: 94 % of the length")
    ] = None
    fins: Annotated[int, Field(ge=3, le=12, description="number of fins")] = 4
    tail: Annotated[Literal["+", "x"], Field(description="arrangement of the fins")] = "+"
    nose: Annotated[_OptionalLength, Field(description="length of the nose; default: about a diameter")] = None
    tail_length: Annotated[_OptionalLength, Field(description="length of the tail; default: 2.5 diameters")] = None
    speed: Annotated[float, Amount("m/s"), Field(ge=0.05, le=50, description="cruising speed")] = 1.5
    density: Annotated[float, Amount("kg/m^3"), Field(ge=1, le=2e4, description="density of the water")] = 1025.0

    @model_validator(mode="after")
    def _plausible_mass(self) -> "Outline":
        hull = self.geometry().shape(self.length, self.diameter, self.density).hull
        displaced = self.density * hull.volume
        if not MIN_MASS_SHARE <= self.mass / displaced <= MAX_MASS_SHARE:
            raise ValueError(
                f"mass: {self.mass:.4g} kg is {self.mass / displaced:.2g} times the {displaced:.4g} kg of water that a "
                f"hull of {self.length:g} m by {self.diameter:g} m displaces; expected {MIN_MASS_SHARE:g} to "
                f"{MAX_MASS_SHARE:g} times; check mass (including all water inside), length, diameter and units"
            )
        return self

    def geometry(self) -> GeometrySettings:
        """Return hull and fins, with defaults for missing settings."""
        nose, tail = self._ends()
        position = self.fin_position or _HINGES * self.length
        return GeometrySettings(
            hull=NoseCylinderTail(type="nose_cylinder_tail", nose=nose, tail=tail),
            fins=FinSettings(
                position=_short(position), span=self.fin_span, area=self.fin_area, number=self.fins, tail=self.tail
            ),
            speed=self.speed,
        )

    def _ends(self) -> tuple[float, float]:
        """Return the lengths of nose and tail, m."""
        nose = self.nose or min(_NOSE * self.diameter, _MAX_NOSE * self.length)
        tail = self.tail_length or min(_TAIL * self.diameter, _MAX_TAIL * self.length)
        return _short(nose), _short(tail)

    def assumed(self) -> tuple[str, ...]:
        """Return the defaults in use, each as an option with its value."""
        nose, tail = self._ends()
        values = {
            "fin_position": f"{self.geometry().fins.position:g} m",
            "fins": f"{self.fins}",
            "tail": self.tail,
            "nose": f"{nose:g} m",
            "tail_length": f"{tail:g} m",
            "speed": f"{self.speed:g} m/s",
            "density": f"{self.density:g} kg/m^3",
        }
        return tuple(f"{option(key)} {value}" for key, value in values.items() if key not in self.model_fields_set)

    def drawing(self, name: str) -> Drawing:
        """Return the drawing for a vehicle file of that name."""
        size = Size(length=self.length, diameter=self.diameter, density=self.density)
        return Drawing(name=name, mass=self.mass, size=size, geometry=self.geometry())


def _short(length: float) -> float:
    """Round a default to four digits."""
    return float(f"{length:.4g}")


def units() -> dict[str, str]:
    """Return the SI unit of each key that is a quantity."""
    return {
        key: item.unit
        for key, field in Outline.model_fields.items()
        for item in field.metadata
        if isinstance(item, Unit)
    }


def missing_keys(given: Collection[str]) -> list[str]:
    """Return the required keys that are missing."""
    return [key for key, field in Outline.model_fields.items() if field.is_required() and key not in given]


def option(key: str) -> str:
    """Return the option of a key."""
    return f"--{key.replace('_', '-')}"


def outline_of_options(options: Mapping[str, str | int]) -> Outline:
    """Validate the options of a command line, by the keys of `Outline`; ConfigError with all mistakes."""
    whole = Position(ConfigSource("outline", Path()))
    content = {}
    for key, value in options.items():
        at = Position(ConfigSource(f"{option(key)} {value}", Path()))
        content[key] = Tree(value, at, at)
    return validated(Outline, Tree(content, whole), [])


def derived_vehicle_yaml(drawing: Drawing) -> str:
    """Return the vehicle file of a drawing: each number with its standard deviation, formula and source.

    The vehicle is assumed to be neutrally buoyant and in trim.
    """
    mass, size, geometry = drawing.mass, drawing.size, drawing.geometry
    shape = geometry.shape(size.length, size.diameter, size.density)
    derived = {each.name: each for each in coefficients_from_geometry(shape, mass, geometry.speed)}
    drag, weight = -derived["X_u|u|"].mean, mass * GRAVITY
    heaviness, heaviness_deviation = (share * size.diameter for share in (_BOTTOM_HEAVINESS, _HEAVINESS_DEVIATION))
    assumed = {
        "m": _entry("m", mass, "read"),
        "W": _entry("W", weight, "derived: m times gravity"),
        "B": _entry("B", weight, "assumed: as W", _BUOYANCY_DEVIATION * weight),
        "zG": _entry("zG", heaviness, f"assumed: {_BOTTOM_HEAVINESS:g} of the diameter", heaviness_deviation),
        "X_prop": _entry("X_prop", drag * geometry.speed**2, f"derived: -X_u|u| u^2 at {geometry.speed:g} m/s"),
    }
    zeros = {quantity.symbol: _entry(quantity.symbol, 0.0, "assumed") for quantity in PARAMETERS}
    entries = zeros | assumed | {symbol: _derived_entry(each) for symbol, each in derived.items()}
    vehicle = {
        "name": drawing.name,
        "source": "hull, fins and mass alone; formulas by their numbers in auvid's theory",
        "size": _with_units(size),
        "geometry": _with_units(geometry),
        "parameters": {quantity.symbol: entries[quantity.symbol] for quantity in PARAMETERS},
        "coefficients": {coefficient.symbol: entries[coefficient.symbol] for coefficient in COEFFICIENTS},
        "terms": [_term(each) | _derived_entry(derived[each.symbol]) for each in DERIVED_TERMS],
    }
    # One line for each entry.
    return yaml.safe_dump(vehicle, sort_keys=False, width=10**6, default_flow_style=None, allow_unicode=True)


def _with_units(settings: Settings) -> dict[str, Any]:
    """Return settings with the unit of each number."""
    units = {name: _unit_in(field.rebuild_annotation()) for name, field in type(settings).model_fields.items()}
    return {name: _written(value, units[name]) for name, value in settings if value is not None}


def _written(value: Any, unit: str) -> Any:
    if isinstance(value, Settings):
        return _with_units(value)
    if isinstance(value, tuple):
        return [_written(each, unit) for each in value]
    return f"{value!r} {unit}" if unit else value


def _unit_in(annotation: Any) -> str:
    """Return the unit in a type at any depth, otherwise an empty text."""
    if isinstance(annotation, Unit):
        return annotation.unit
    return next(filter(None, map(_unit_in, get_args(annotation))), "")


def _entry(symbol: str, value: float, status: str, deviation: float | None = None) -> dict[str, Any]:
    stated = {} if deviation is None else {"standard_deviation": f"{deviation:.3g} {_UNITS[symbol]}"}
    return {"value": f"{value:.6g} {_UNITS[symbol]}", **stated, "status": status}


def _derived_entry(value: DerivedValue) -> dict[str, Any]:
    return {
        "value": f"{value.mean!r} {value.unit}",
        "standard_deviation": f"{value.standard_deviation!r} {value.unit}",
        "status": f"derived: {value.formula}",
        "source": value.source,
    }


def _term(coefficient: Coefficient) -> dict[str, Any]:
    row = EQUATION_ROWS[coefficient.row]
    return {"name": coefficient.symbol, "row": row, "factors": list(coefficient.factors)}
