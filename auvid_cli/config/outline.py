"""The few numbers from which `auvid init` makes a first vehicle, known before there is a drawing."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from auvid_cli.config.geometry import FinSettings, GeometrySettings, NoseCylinderTail, PositiveLength
from auvid_cli.config.loading import validated
from auvid_cli.config.settings import Settings
from auvid_cli.config.source_positions import ConfigSource, Position, Tree
from auvid_cli.config.units import Amount, Unit
from auvid_cli.config.vehicle import Drawing, Size

# A mass outside these limits has a wrong unit.
MIN_MASS_SHARE = 0.5  # of the mass of water that the hull displaces
MAX_MASS_SHARE = 1.5  # of the mass of water that the hull displaces
# Defaults of the shape; the hinges are about as far aft as those of the REMUS.
_NOSE = 1.0  # diameters
_TAIL = 2.5  # diameters
_MAX_NOSE = 0.2  # share of the length
_MAX_TAIL = 0.4  # share of the length
_HINGES = 0.94  # share of the length, from the nose

_MetresIfKnown = Annotated[float | None, Amount("m"), Field(gt=0, le=1e3)]


class Outline(Settings):
    """A vehicle in outline: the keys are the options of `auvid init`."""

    length: Annotated[PositiveLength, Field(description="of the hull")]
    diameter: Annotated[PositiveLength, Field(description="of the hull")]
    mass: Annotated[float, Amount("kg"), Field(gt=0, description="with all water inside")]
    fin_span: Annotated[PositiveLength, Field(description="of one fin, from root to tip")]
    fin_area: Annotated[float, Amount("m^2"), Field(gt=0, le=1e4, description="of one fin")]
    fin_position: Annotated[
        _MetresIfKnown, Field(description="of the fins' hinges, from the nose; else at 94 % of the length")
    ] = None
    fins: Annotated[int, Field(ge=3, le=12, description="their number")] = 4
    tail: Annotated[Literal["+", "x"], Field(description="arrangement")] = "+"
    nose: Annotated[_MetresIfKnown, Field(description="length of the nose; else about a diameter")] = None
    tail_length: Annotated[_MetresIfKnown, Field(description="of the tapering tail; else about 2.5 diameters")] = None
    speed: Annotated[float, Amount("m/s"), Field(ge=0.05, le=50, description="at which it travels")] = 1.5
    density: Annotated[float, Amount("kg/m^3"), Field(ge=1, le=2e4, description="of the water")] = 1025.0

    @model_validator(mode="after")
    def _one_body_in_water(self) -> "Outline":
        hull = self.geometry().shape(self.length, self.diameter, self.density).hull
        displaced = self.density * hull.volume
        if not MIN_MASS_SHARE <= self.mass / displaced <= MAX_MASS_SHARE:
            raise ValueError(
                f"a mass of {self.mass:.4g} kg is {self.mass / displaced:.2g} times the {displaced:.4g} kg of water "
                f"that a hull of {self.length:g} m by {self.diameter:g} m displaces; expected {MIN_MASS_SHARE:g} to "
                f"{MAX_MASS_SHARE:g} times: check mass (with all water inside), length and diameter, and their units"
            )
        return self

    def geometry(self) -> GeometrySettings:
        """Return hull and fins, with defaults for settings that are not given."""
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
        """Return the defaults used, each as its option with a value."""
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
        """Return the drawing of which a vehicle file of that name is made."""
        size = Size(length=self.length, diameter=self.diameter, density=self.density)
        return Drawing(name=name, mass=self.mass, size=size, geometry=self.geometry())


def _short(length: float) -> float:
    """Round a default to four digits."""
    return float(f"{length:.4g}")


def units() -> dict[str, str]:
    """Return the SI units of the keys of an outline that are quantities."""
    return {
        key: item.unit
        for key, field in Outline.model_fields.items()
        for item in field.metadata
        if isinstance(item, Unit)
    }


def missing_keys(given: Collection[str]) -> list[str]:
    """Return the required keys that are not given."""
    return [key for key, field in Outline.model_fields.items() if field.is_required() and key not in given]


def option(key: str) -> str:
    """Return the option of a key."""
    return f"--{key.replace('_', '-')}"


def outline_of_options(options: Mapping[str, str | int]) -> Outline:
    """Validate the options of a command line.

    Parameters
    ----------
    options : mapping
        Quantities as they were written, by the keys of `Outline`.

    Raises
    ------
    ConfigError
        With every mistake at once, each at its option.
    """
    whole = Position(ConfigSource("outline", Path()))
    content = {}
    for key, value in options.items():
        at = Position(ConfigSource(f"{option(key)} {value}", Path()))
        content[key] = Tree(value, at, at)
    return validated(Outline, Tree(content, whole), [])
