"""A vehicle's shape: hull, fins, appendages, and where its centre of buoyancy is."""

from typing import Literal, NamedTuple

import numpy as np

from auvid_cli.vehicle.hull import Array, Hull

# Lift-curve slope of a fin of endless span by Hoerner: 2 pi, of which 0.9 is left by the boundary layer.
_SECTION_SLOPE = 0.9 * 2.0 * np.pi
# Where a fin is hinged, of its chord: that of the REMUS.
_HINGE = 0.36


class TailFins(NamedTuple):
    """Equal fins around the tail.

    Attributes
    ----------
    position : float
        Distance of their hinge, at which their force acts, from the nose, m.
    span : float
        From root to tip, m.
    area : float
        Of one fin, m^2.
    number : int
        Three or more, evenly around the hull.
    tail : str
        ``+``: rudders are upright, stern planes level. ``x``: all turn for either.
    taper : float
        Chord at the tip by that at the root.
    chord : float
        Mean, m.
    tip_radius : float
        Distance of the tips from the axis, m.
    """

    position: float
    span: float
    area: float
    number: int
    tail: Literal["+", "x"]
    taper: float
    chord: float
    tip_radius: float

    @property
    def extent(self) -> tuple[float, float]:
        """Return where they begin and end, m from the nose."""
        begin = self.position - _HINGE * self.chord
        return begin, begin + self.chord

    @property
    def aspect_ratio(self) -> float:
        """Return the effective aspect ratio: the hull mirrors a fin."""
        return 2.0 * self.span**2 / self.area

    @property
    def lift_slope(self) -> float:
        """Return the lift-curve slope per radian: Hoerner, as Prestero (2001), eq. (4.38)."""
        return 1.0 / (1.0 / _SECTION_SLOPE + 1.0 / (np.pi * self.aspect_ratio))

    @property
    def drag_coefficient(self) -> float:
        """Return the drag coefficient across the flow: Whicker and Fehlner (1958), as Prestero (2001)."""
        return 0.1 + 0.7 * self.taper

    @property
    def mean_radius(self) -> float:
        """Return the distance of the middle of a fin from the axis, m."""
        return self.tip_radius - 0.5 * self.span

    @property
    def per_plane(self) -> float:
        """Return how many fins act along y, and as many along z: half of them, whichever way they are turned."""
        return 0.5 * self.number

    @property
    def turning(self) -> float:
        """Return how many fins as one upright one would do what a rudder does.

        Those of an X all turn by its angle, at 45 degrees.
        """
        return self.per_plane * (np.sqrt(2.0) if self.tail == "x" else 1.0)


class Appendage(NamedTuple):
    """Something that sticks out of the hull: its area, m^2, and its drag coefficient on it."""

    area: float
    drag_coefficient: float


class Geometry(NamedTuple):
    """The shape of a vehicle; body axes have their origin at the centre of buoyancy.

    Attributes
    ----------
    hull : Hull
    fins : TailFins
    centre_of_buoyancy : float
        Distance from the nose, m.
    appendages : tuple of Appendage
        Empty where they are not known.
    density : float
        Of the water, kg/m^3.
    """

    hull: Hull
    fins: TailFins
    centre_of_buoyancy: float
    appendages: tuple[Appendage, ...]
    density: float

    @property
    def x(self) -> Array:
        """Return the stations of the hull in body axes, m, falling."""
        return self.centre_of_buoyancy - self.hull.station

    @property
    def fin_x(self) -> float:
        """Return where the fins' force acts in body axes, m: less than 0 at the tail."""
        return self.centre_of_buoyancy - self.fins.position

    def along_hull(self, per_length: Array) -> float:
        """Return the integral of something along the hull."""
        return float(np.trapezoid(per_length, self.hull.station))
