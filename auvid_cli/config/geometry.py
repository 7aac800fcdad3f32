"""Settings of a vehicle's shape, as distances from the nose."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from auvid_cli.config.settings import Settings
from auvid_cli.config.units import Amount, Unit
from auvid_cli.vehicle.hull import (
    Appendage,
    Geometry,
    Hull,
    MyringLengths,
    TailFins,
    hull_of_radii,
    myring_hull,
    nose_cylinder_tail_hull,
)

# The added-mass factors of spheroids are inaccurate outside these limits.
_MIN_SLENDERNESS = 1.1  # length per diameter
_MAX_SLENDERNESS = 1e3  # length per diameter
# Fins outside these limits have a wrong unit; published vehicles have spans of 0.4 to 0.6 and areas of 0.015 to 0.04.
_MIN_SPAN = 0.02  # hull diameters
_MAX_SPAN = 3.0  # hull diameters
_MIN_AREA = 5e-4  # hull length times diameter
_MAX_AREA = 0.3  # hull length times diameter

PositiveLength = Annotated[float, Amount("m"), Field(gt=0, le=1e3)]
Distance = Annotated[float, Amount("m"), Field(ge=0, le=1e3)]


class MyringShape(Settings):
    """Myring hull, with the parameters of Prestero (2001) for the REMUS."""

    type: Literal["myring"]
    nose: Annotated[PositiveLength, Field(description="a, length of the nose")]
    nose_offset: Annotated[Distance, Field(description="a_0, length cut off the nose")] = 0.0
    middle: Annotated[Distance, Field(description="b, length of the cylinder")]
    tail: Annotated[PositiveLength, Field(description="c, length of the tail")]
    tail_offset: Annotated[Distance, Field(description="c_0, length cut off the tail")] = 0.0
    exponent: Annotated[float, Field(ge=0.5, le=20, description="n, exponent of the nose; 2: ellipse")] = 2.0
    tail_angle: Annotated[float, Amount("rad"), Field(gt=0, lt=1.5, description="theta, contour angle at the end")]

    @model_validator(mode="after")
    def _valid_offsets(self) -> "MyringShape":
        if self.nose_offset >= self.nose or self.tail_offset >= self.tail:
            raise ValueError("nose_offset and tail_offset must be less than nose and tail")
        return self

    def hull(self, length: float, diameter: float) -> Hull:
        """Return the contour, m; its length is the sum of the parts."""
        settings = self.model_dump(exclude={"type"})
        return myring_hull(MyringLengths(diameter=diameter, **settings))


class NoseCylinderTail(Settings):
    """Hull with an elliptic nose, a cylinder and a parabolic tail."""

    type: Literal["nose_cylinder_tail"]
    nose: Annotated[PositiveLength, Field(description="length of the nose")]
    tail: Annotated[PositiveLength, Field(description="length of the tail")]

    def hull(self, length: float, diameter: float) -> Hull:
        """Return the contour, m."""
        if self.nose + self.tail > length:
            raise ValueError(f"nose and tail: together {self.nose + self.tail:g} m, longer than the {length:g} m hull")
        return nose_cylinder_tail_hull(length, diameter, self.nose, self.tail)


class TableOfRadii(Settings):
    """Hull as a table of radii along its axis, with linear interpolation."""

    type: Literal["table"]
    station: Annotated[tuple[Distance, ...], Field(min_length=3, description="distances from the nose, from 0, m")]
    radius: Annotated[tuple[Distance, ...], Field(min_length=3, description="radii at the stations, m")]

    @model_validator(mode="after")
    def _valid_table(self) -> "TableOfRadii":
        if len(self.station) != len(self.radius):
            raise ValueError(f"{len(self.station)} stations and {len(self.radius)} radii; expected the same number")
        if self.station[0] != 0.0 or any(b <= a for a, b in zip(self.station, self.station[1:], strict=False)):
            raise ValueError("the stations must increase from 0, the nose")
        if not max(self.radius) > 0.0:
            raise ValueError("at least one radius must be greater than 0")
        return self

    def hull(self, length: float, diameter: float) -> Hull:
        """Return the contour, m, with the length and diameter of the table."""
        return hull_of_radii(self.station, self.radius)


AnyHull = Annotated[MyringShape | NoseCylinderTail | TableOfRadii, Field(discriminator="type")]


class FinSettings(Settings):
    """Equal fins around the tail."""

    position: Annotated[PositiveLength, Field(description="distance of the hinges from the nose")]
    span: Annotated[PositiveLength, Field(description="span of one fin, from root to tip")]
    area: Annotated[float, Amount("m^2"), Field(gt=0, le=1e4, description="area of one fin")]
    number: Annotated[int, Field(ge=3, le=12, strict=True, description="number of evenly spaced fins")] = 4
    tail: Annotated[
        Literal["+", "x"],
        Field(description="+: vertical rudders and horizontal stern planes; x: all fins turn for both inputs"),
    ] = "+"
    taper: Annotated[float, Field(ge=0, le=1, description="taper ratio: tip chord divided by root chord")] = 1.0
    chord: Annotated[PositiveLength | None, Field(description="mean chord, m; default: area divided by span")] = None
    tip_radius: Annotated[
        PositiveLength | None,
        Field(description="radius of the tips from the axis, m; default: hull radius at the hinges plus span"),
    ] = None

    @model_validator(mode="after")
    def _valid_tail(self) -> "FinSettings":
        if self.tail == "x" and self.number != 4:
            raise ValueError(f"number: an x tail has 4 fins, got {self.number}")
        if self.tip_radius is not None and self.tip_radius < self.span:
            raise ValueError(f"tip_radius must be at least the span of {self.span:g} m")
        return self

    def fins(self, hull: Hull) -> TailFins:
        """Return the fins on a hull; ValueError if they do not match its size."""
        if self.position > 1.2 * hull.length:
            raise ValueError(f"fins.position is {self.position:g} m, but the hull is {hull.length:g} m long")
        diameter, outline = hull.diameter, hull.length * hull.diameter
        if not _MIN_SPAN * diameter <= self.span <= _MAX_SPAN * diameter:
            limits = f"{_MIN_SPAN * diameter:.2g} to {_MAX_SPAN * diameter:.2g} m"
            raise ValueError(f"fins.span is {self.span:g} m; expected {limits} for a diameter of {diameter:g} m")
        if not _MIN_AREA * outline <= self.area <= _MAX_AREA * outline:
            limits = f"{_MIN_AREA * outline:.2g} to {_MAX_AREA * outline:.2g} m^2"
            size = f"{hull.length:g} m by {diameter:g} m"
            raise ValueError(f"fins.area is {self.area:g} m^2; expected {limits} for a hull of {size}")
        chord = self.area / self.span if self.chord is None else self.chord
        tip = float(hull.radius_at(self.position)) + self.span if self.tip_radius is None else self.tip_radius
        return TailFins(self.position, self.span, self.area, self.number, self.tail, self.taper, chord, tip)


class AppendageSettings(Settings):
    """Appendage of the hull."""

    name: Annotated[str, Field(description="name of the appendage")] = ""
    area: Annotated[float, Amount("m^2"), Field(gt=0, le=1e4, description="reference area of its drag coefficient")]
    drag_coefficient: Annotated[float, Field(ge=0, le=10, description="drag coefficient along the axis")]


class GeometrySettings(Settings):
    """Shape of a vehicle, from which means and standard deviations of its coefficients follow."""

    hull: AnyHull
    fins: FinSettings
    appendages: Annotated[
        tuple[AppendageSettings, ...],
        Field(description="all appendages, including fins; if empty, the drag of the bare hull is multiplied by 2.2"),
    ] = ()
    centre_of_buoyancy: Annotated[
        PositiveLength | None,
        Field(description="distance of the origin from the nose, m; default: centre of the hull's volume"),
    ] = None
    speed: Annotated[float, Unit("m/s"), Field(ge=0.05, le=50, description="speed for the skin friction")] = 1.5

    def shape(self, length: float, diameter: float, density: float) -> Geometry:
        """Return the shape in body axes; ValueError if the parts do not match.

        Parameters
        ----------
        length, diameter : float
            Size of the hull, m, unless its own settings determine it.
        density : float
            Density of the water, kg/m^3.
        """
        hull = self.hull.hull(length, diameter)
        if not _MIN_SLENDERNESS <= hull.slenderness <= _MAX_SLENDERNESS:
            limits = f"{_MIN_SLENDERNESS:g} to {_MAX_SLENDERNESS:g}"
            raise ValueError(f"length divided by diameter of the hull is {hull.slenderness:.3g}; expected {limits}")
        centre = hull.centre if self.centre_of_buoyancy is None else self.centre_of_buoyancy
        if centre > hull.length:
            raise ValueError(f"centre_of_buoyancy is {centre:g} m, but the hull is {hull.length:g} m long")
        if self.fins.position <= centre:
            raise ValueError(
                f"fins.position is {self.fins.position:g} m, ahead of the centre of buoyancy at {centre:.4g} m; "
                "expected fins at the tail"
            )
        appendages = tuple(Appendage(part.area, part.drag_coefficient) for part in self.appendages)
        return Geometry(hull, self.fins.fins(hull), centre, appendages, density)
