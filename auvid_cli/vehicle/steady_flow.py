"""Drag and lift of a hull with fins: skin friction, strips across the flow, and lift in proportion to the speed."""

from typing import NamedTuple

import numpy as np

from auvid_cli.vehicle.shape import Geometry

# Of sea water at 15 degrees, m^2/s.
VISCOSITY = 1.19e-6
# A cylinder across the flow: Hoerner, as in Prestero (2001), ch. 4.
_CYLINDER = 1.1
# The lift of a hull acts at this share of its length behind the nose: Hoerner's 0.6 to 0.7.
_CENTRE_OF_LIFT = 0.65


def bare_hull_drag(geometry: Geometry, speed: float) -> float:
    """Return the axial drag of the bare hull as ``rho/2 c_d A``, kg/m: friction by ITTC (1957), form by Hoerner."""
    hull = geometry.hull
    friction = 0.075 / (np.log10(speed * hull.length / VISCOSITY) - 2.0) ** 2
    form = 1.0 + 1.5 * hull.slenderness**-1.5 + 7.0 * hull.slenderness**-3
    return float(0.5 * geometry.density * friction * form * hull.wetted_area)


def appendage_drag(geometry: Geometry) -> float:
    """Return the axial drag of all appendages as ``rho/2 c_d A``, kg/m."""
    return 0.5 * geometry.density * sum(each.area * each.drag_coefficient for each in geometry.appendages)


class CrossFlow(NamedTuple):
    """Drag across the axis by strips, and its moments along the axis.

    Attributes
    ----------
    force : float
        kg/m.
    moment, gross_moment : float
        Of force times x, of hull and fins, and times ``|x|``, of the hull alone, kg.
    force_of_turn, gross_force_of_turn : float
        Of force times ``x |x|``, of hull and fins, and times x^2, of the hull alone, kg m.
    moment_of_turn : float
        Of force times ``|x|^3``, kg m^2.
    """

    force: float
    moment: float
    gross_moment: float
    force_of_turn: float
    gross_force_of_turn: float
    moment_of_turn: float


def cross_flow(geometry: Geometry) -> CrossFlow:
    """Return the integrals of strips that are cylinders across the flow, as Prestero (2001) but for a sign in (4.8)."""
    x, at_fins = geometry.x, geometry.fin_x
    hull = 0.5 * geometry.density * _CYLINDER * 2.0 * geometry.hull.radius
    fins = geometry.fins.per_plane * fin_drag(geometry)
    return CrossFlow(
        geometry.along_hull(hull) + fins,
        geometry.along_hull(hull * x) + fins * at_fins,
        geometry.along_hull(hull * np.abs(x)),
        geometry.along_hull(hull * x * np.abs(x)) + fins * at_fins * abs(at_fins),
        geometry.along_hull(hull * x**2),
        geometry.along_hull(hull * np.abs(x) ** 3) + fins * abs(at_fins) ** 3,
    )


def fin_drag(geometry: Geometry) -> float:
    """Return the drag of one fin across the flow as ``rho/2 c_d S``, kg/m."""
    return 0.5 * geometry.density * geometry.fins.area * geometry.fins.drag_coefficient


def fin_lift(geometry: Geometry) -> float:
    """Return the lift of one fin for each radian as ``rho/2 c_L S``, kg/m."""
    return 0.5 * geometry.density * geometry.fins.area * geometry.fins.lift_slope


class HullLift(NamedTuple):
    """Lift of the hull as ``rho/2 c d^2`` for each radian, kg/m, and its moment, kg, less than 0 behind the origin."""

    force: float
    moment: float


def hull_lift(geometry: Geometry) -> HullLift:
    """Return the lift of the hull: Hoerner's ``0.003 l/d`` for each degree, as Prestero (2001), (4.27) to (4.36)."""
    hull = geometry.hull
    slope = 0.003 * hull.slenderness * 180.0 / np.pi
    force = 0.5 * geometry.density * hull.diameter**2 * slope
    return HullLift(float(force), float(force * (geometry.centre_of_buoyancy - _CENTRE_OF_LIFT * hull.length)))
