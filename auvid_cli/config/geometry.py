"""Settings of a vehicle's shape: what a drawing says, in distances from the nose."""

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

# The factors of spheroids are inaccurate outside these limits; those of 1 are those of a sphere.
_LEAST_SLENDERNESS = 1.1  # length per diameter
_LARGEST_SLENDERNESS = 1e3  # length per diameter
# Fins outside these limits have a wrong unit; published vehicles have spans of 0.4 to 0.6 and areas of 0.015 to 0.04.
_LEAST_SPAN = 0.02  # hull diameters
_LARGEST_SPAN = 3.0  # hull diameters
_LEAST_AREA = 5e-4  # hull length times diameter
_LARGEST_AREA = 0.3  # hull length times diameter

PositiveLength = Annotated[float, Amount("m"), Field(gt=0, le=1e3)]
Distance = Annotated[float, Amount("m"), Field(ge=0, le=1e3)]


class MyringShape(Settings):
    """A hull by Myring, as Prestero describes that of the REMUS."""

    type: Literal["myring"]
    nose: Annotated[PositiveLength, Field(description="a")]
    nose_offset: Annotated[Distance, Field(description="a_0, cut off the nose")] = 0.0
    middle: Annotated[Distance, Field(description="b, of the cylinder")]
    tail: Annotated[PositiveLength, Field(description="c")]
    tail_offset: Annotated[Distance, Field(description="c_0, cut off the tail")] = 0.0
    exponent: Annotated[float, Field(ge=0.5, le=20, description="n of the nose: 2 is an ellipse")] = 2.0
    tail_angle: Annotated[
        float, Amount("rad"), Field(gt=0, lt=1.5, description="theta, of the contour at the end of the tail")
    ]

    @model_validator(mode="after")
    def _something_left(self) -> "MyringShape":
        if self.nose_offset >= self.nose or self.tail_offset >= self.tail:
            raise ValueError("nose_offset and tail_offset must be less than nose and tail")
        return self

    def hull(self, length: float, diameter: float) -> Hull:
        """Return the contour, m; its length is that of its parts."""
        return myring_hull(
            MyringLengths(
                self.nose,
                self.nose_offset,
                self.middle,
                self.tail,
                self.tail_offset,
                diameter,
                self.exponent,
                self.tail_angle,
            )
        )


class NoseCylinderTail(Settings):
    """A hull of half an ellipse, a cylinder and a tail that narrows as a parabola to a point."""

    type: Literal["nose_cylinder_tail"]
    nose: Annotated[PositiveLength, Field(description="length of the nose")]
    tail: Annotated[PositiveLength, Field(description="length of the tail")]

    def hull(self, length: float, diameter: float) -> Hull:
        """Return the contour, m."""
        if self.nose + self.tail > length:
            ends = self.nose + self.tail
            raise ValueError(f"nose and tail are {ends:g} m of a length of {length:g} m")
        return nose_cylinder_tail_hull(length, diameter, self.nose, self.tail)


class TableOfRadii(Settings):
    """A hull by radii along its axis, straight between them."""

    type: Literal["table"]
    station: Annotated[
        tuple[Distance, ...], Field(min_length=3, description="distances from the nose, rising from 0, m")
    ]
    radius: Annotated[tuple[Distance, ...], Field(min_length=3, description="there, m")]

    @model_validator(mode="after")
    def _a_contour(self) -> "TableOfRadii":
        if len(self.station) != len(self.radius):
            raise ValueError(f"{len(self.station)} stations and {len(self.radius)} radii; expected as many of both")
        if self.station[0] != 0.0 or any(b <= a for a, b in zip(self.station, self.station[1:], strict=False)):
            raise ValueError("the stations must rise from 0, the nose")
        if not max(self.radius) > 0.0:
            raise ValueError("one radius must be greater than 0")
        return self

    def hull(self, length: float, diameter: float) -> Hull:
        """Return the contour, m; length and diameter are those of the table."""
        return hull_of_radii(self.station, self.radius)


AnyHull = Annotated[MyringShape | NoseCylinderTail | TableOfRadii, Field(discriminator="type")]


class FinSettings(Settings):
    """Equal fins around the tail."""

    position: Annotated[PositiveLength, Field(description="of their hinges, from the nose")]
    span: Annotated[PositiveLength, Field(description="from root to tip")]
    area: Annotated[float, Amount("m^2"), Field(gt=0, le=1e4, description="of one fin")]
    number: Annotated[int, Field(ge=3, le=12, strict=True, description="evenly around the hull")] = 4
    tail: Annotated[
        Literal["+", "x"], Field(description="+: rudders upright, stern planes level; x: all turn for either")
    ] = "+"
    taper: Annotated[float, Field(ge=0, le=1, description="chord at the tip by that at the root")] = 1.0
    chord: Annotated[PositiveLength | None, Field(description="mean, m; else area by span")] = None
    tip_radius: Annotated[
        PositiveLength | None, Field(description="of the tips, m; else the hull's at the hinges and span")
    ] = None

    @model_validator(mode="after")
    def _an_x_of_four(self) -> "FinSettings":
        if self.tail == "x" and self.number != 4:
            raise ValueError(f"a tail like an x has 4 fins, got {self.number}")
        if self.tip_radius is not None and self.tip_radius < self.span:
            raise ValueError(f"tip_radius, from the axis, must be at least the span of {self.span:g} m")
        return self

    def fins(self, hull: Hull) -> TailFins:
        """Return them on a hull."""
        if self.position > 1.2 * hull.length:
            raise ValueError(f"fins.position is {self.position:g} m, and the hull {hull.length:g} m long")
        diameter, outline = hull.diameter, hull.length * hull.diameter
        if not _LEAST_SPAN * diameter <= self.span <= _LARGEST_SPAN * diameter:
            limits = f"{_LEAST_SPAN * diameter:.2g} to {_LARGEST_SPAN * diameter:.2g} m"
            raise ValueError(f"fins.span is {self.span:g} m, on a hull {diameter:g} m wide; expected {limits}")
        if not _LEAST_AREA * outline <= self.area <= _LARGEST_AREA * outline:
            limits = f"{_LEAST_AREA * outline:.2g} to {_LARGEST_AREA * outline:.2g} m^2"
            size = f"{hull.length:g} m by {diameter:g} m"
            raise ValueError(f"fins.area is {self.area:g} m^2 each, on a hull of {size}; expected {limits}")
        chord = self.area / self.span if self.chord is None else self.chord
        tip = float(hull.radius_at(self.position)) + self.span if self.tip_radius is None else self.tip_radius
        return TailFins(self.position, self.span, self.area, self.number, self.tail, self.taper, chord, tip)


class AppendageSettings(Settings):
    """Something that sticks out of the hull."""

    name: str = ""
    area: Annotated[float, Amount("m^2"), Field(gt=0, le=1e4, description="to which its drag coefficient belongs")]
    drag_coefficient: Annotated[float, Field(ge=0, le=10, description="along the axis")]


class GeometrySettings(Settings):
    """A vehicle's shape, from which means and standard deviations of its coefficients follow."""

    hull: AnyHull
    fins: FinSettings
    appendages: Annotated[
        tuple[AppendageSettings, ...],
        Field(description="all of them, fins too; if none is named the bare hull's drag counts 2.2 times"),
    ] = ()
    centre_of_buoyancy: Annotated[
        PositiveLength | None, Field(description="from the nose, m: the origin; else the centre of the hull's volume")
    ] = None
    speed: Annotated[float, Unit("m/s"), Field(ge=0.05, le=50, description="at which skin friction is taken")] = 1.5

    def shape(self, length: float, diameter: float, density: float) -> Geometry:
        """Return it in body axes.

        Parameters
        ----------
        length, diameter : float
            Of the hull, m; as far as its own numbers leave them open.
        density : float
            Of the water, kg/m^3.

        Raises
        ------
        ValueError
            If the parts do not fit together.
        """
        hull = self.hull.hull(length, diameter)
        if not _LEAST_SLENDERNESS <= hull.slenderness <= _LARGEST_SLENDERNESS:
            limits = f"{_LEAST_SLENDERNESS:g} to {_LARGEST_SLENDERNESS:g} times"
            raise ValueError(f"the hull is {hull.slenderness:.3g} times as long as wide; expected {limits}")
        centre = hull.centre if self.centre_of_buoyancy is None else self.centre_of_buoyancy
        if centre > hull.length:
            raise ValueError(f"centre_of_buoyancy is {centre:g} m, and the hull {hull.length:g} m long")
        if self.fins.position <= centre:
            raise ValueError(
                f"fins.position is {self.fins.position:g} m, ahead of the centre of buoyancy at {centre:.4g} m: "
                "only fins at the tail have formulas"
            )
        appendages = tuple(Appendage(each.area, each.drag_coefficient) for each in self.appendages)
        return Geometry(hull, self.fins.fins(hull), centre, appendages, density)
