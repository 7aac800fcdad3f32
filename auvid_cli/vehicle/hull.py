"""Shape of a vehicle: hull contour, tail fins, appendages, and their volumes, areas and centres."""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from auvid_cli.arrays import Array

# Enough for integrals accurate to 1e-4 in spite of the square root in the radius of a round nose.
_N_STATIONS = 2001
# Lift-curve slope of a fin of infinite span, per radian: 2 pi, times 0.9 for the boundary layer (Hoerner).
_SECTION_SLOPE = 0.9 * 2.0 * np.pi
# Distance of the hinge of a REMUS fin from the leading edge, as a share of the chord.
_HINGE = 0.36


class Hull(NamedTuple):
    """The contour of a hull."""

    station: Array  # shape (n,); distances from the nose, rising from 0 to the length, m
    radius: Array  # shape (n,); radius at each station, m

    @property
    def length(self) -> float:
        """Return the length, m."""
        return float(self.station[-1])

    @property
    def diameter(self) -> float:
        """Return the largest diameter, m."""
        return float(2.0 * self.radius.max())

    @property
    def slenderness(self) -> float:
        """Return the length over the diameter."""
        return self.length / self.diameter

    @property
    def volume(self) -> float:
        """Return the volume, m^3."""
        return float(np.trapezoid(np.pi * self.radius**2, self.station))

    @property
    def centre(self) -> float:
        """Return the distance of the centre of volume from the nose, m."""
        return float(np.trapezoid(np.pi * self.radius**2 * self.station, self.station) / self.volume)

    @property
    def wetted_area(self) -> float:
        """Return the wetted area without flat ends, m^2, by cone frustums between the stations."""
        slant = np.hypot(np.diff(self.station), np.diff(self.radius))
        return float(np.pi * np.sum((self.radius[:-1] + self.radius[1:]) * slant))

    def radius_at(self, station: Array | float) -> Array:
        """Return the radius, m, at distances from the nose, m; 0 beyond the hull."""
        return np.asarray(np.interp(station, self.station, self.radius, left=0.0, right=0.0))


class MyringLengths(NamedTuple):
    """Parameters of a Myring contour, with Prestero's symbols."""

    nose: float  # a, m
    nose_offset: float  # a_0, length cut off at the nose, m
    middle: float  # b, m
    tail: float  # c, m
    tail_offset: float  # c_0, length cut off at the tail, m
    diameter: float  # d, m
    exponent: float  # n of the nose; 2 gives an ellipse
    tail_angle: float  # half angle at the uncut end of the tail, rad


def myring_hull(shape: MyringLengths) -> Hull:
    """Return the contour of Myring (1976), Prestero (2001), eqs. (2.1) to (2.3)."""
    a, offset, b, c, cut, d, exponent, angle = shape
    begin_of_tail = a + b - offset
    station = np.linspace(0.0, begin_of_tail + c - cut, _N_STATIONS)
    nose = 0.5 * d * (1.0 - np.minimum((station + offset - a) / a, 0.0) ** 2) ** (1.0 / exponent)
    aft = np.maximum(station - begin_of_tail, 0.0)
    tangent = np.tan(angle)
    tail = (1.5 * d / c**2 - tangent / c) * aft**2 - (d / c**3 - tangent / c**2) * aft**3
    return Hull(station, np.maximum(nose - tail, 0.0))


def nose_cylinder_tail_hull(length: float, diameter: float, nose: float, tail: float) -> Hull:
    """Return the contour of an elliptic nose, a cylinder and a parabolic tail that ends in a point.

    Parameters
    ----------
    length, diameter, nose, tail : float
        m; nose and tail together are at most `length`.
    """
    station = np.linspace(0.0, length, _N_STATIONS)
    ahead = np.minimum((station - nose) / nose, 0.0)
    aft = np.maximum((station - length + tail) / tail, 0.0)
    return Hull(station, 0.5 * diameter * (np.sqrt(np.maximum(1.0 - ahead**2, 0.0)) - aft**2))


def hull_of_radii(station: Sequence[float], radius: Sequence[float]) -> Hull:
    """Return the piecewise linear contour through radii, m, at rising distances from the nose, m, from 0 on."""
    between = np.linspace(0.0, station[-1], _N_STATIONS)
    everywhere = np.union1d(between, np.asarray(station, dtype=np.float64))
    return Hull(everywhere, np.interp(everywhere, station, radius))


class TailFins(NamedTuple):
    """Equal fins around the tail."""

    position: float  # distance of the hinge, where the force acts, from the nose, m
    span: float  # from root to tip, m
    area: float  # area of one fin, m^2
    number: int  # at least three, evenly around the hull
    # ``+``: vertical rudders and horizontal elevators. ``x``: all fins turn for rudder and elevator.
    tail: Literal["+", "x"]
    taper: float  # chord at the tip over chord at the root
    chord: float  # mean chord, m
    tip_radius: float  # distance of the tips from the axis, m

    @property
    def extent(self) -> tuple[float, float]:
        """Return the distances of leading and trailing edge from the nose, m."""
        begin = self.position - _HINGE * self.chord
        return begin, begin + self.chord

    @property
    def aspect_ratio(self) -> float:
        """Return the effective aspect ratio, twice that of one fin because the hull acts as a mirror."""
        return 2.0 * self.span**2 / self.area

    @property
    def lift_slope(self) -> float:
        """Return the lift-curve slope per radian, Prestero (2001), eq. (4.38), after Hoerner."""
        return 1.0 / (1.0 / _SECTION_SLOPE + 1.0 / (np.pi * self.aspect_ratio))

    @property
    def drag_coefficient(self) -> float:
        """Return the cross-flow drag coefficient of Whicker and Fehlner (1958), as in Prestero (2001)."""
        return 0.1 + 0.7 * self.taper

    @property
    def mean_radius(self) -> float:
        """Return the distance of the middle of a fin from the axis, m."""
        return self.tip_radius - 0.5 * self.span

    @property
    def per_plane(self) -> float:
        """Return the effective number of fins that act along y, or along z: half of all."""
        return 0.5 * self.number

    @property
    def turning(self) -> float:
        """Return the effective number of vertical fins of the rudder; all fins of an X turn, at 45 degrees."""
        return self.per_plane * (np.sqrt(2.0) if self.tail == "x" else 1.0)


class Appendage(NamedTuple):
    """A part outside the hull."""

    area: float  # m^2
    drag_coefficient: float  # relative to `area`


class Geometry(NamedTuple):
    """The shape of a vehicle, with the origin of the body axes at the centre of buoyancy."""

    hull: Hull
    fins: TailFins
    centre_of_buoyancy: float  # distance from the nose, m
    appendages: tuple[Appendage, ...]  # empty if unknown
    density: float  # density of the water, kg/m^3

    @property
    def x(self) -> Array:
        """Return the x coordinates of the stations, m."""
        return self.centre_of_buoyancy - self.hull.station

    @property
    def fin_x(self) -> float:
        """Return the x coordinate of the force of the fins, m; negative at the tail."""
        return self.centre_of_buoyancy - self.fins.position

    def along_hull(self, per_length: Array) -> float:
        """Return the integral of a quantity per length along the hull."""
        return float(np.trapezoid(per_length, self.hull.station))
