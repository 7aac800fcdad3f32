"""Added mass of a hull with fins: Lamb's spheroid and strip theory."""

from typing import NamedTuple

import numpy as np

from auvid_cli.vehicle.hull import Array
from auvid_cli.vehicle.shape import Geometry

_N_STRIPS_OF_FINS = 201


class SpheroidFactors(NamedTuple):
    """Added mass of a prolate spheroid as shares of the mass or inertia of the water that it displaces.

    Attributes
    ----------
    surge, sway, turn : float
        k1, k2 and k' of Lamb: along the axis, across it, and turning about an axis across.
    """

    surge: float
    sway: float
    turn: float


def spheroid_factors(slenderness: float) -> SpheroidFactors:
    """Return Lamb's factors, in the form of Imlay (1961).

    Parameters
    ----------
    slenderness : float
        Length in diameters, greater than 1.
    """
    squared = 1.0 - slenderness**-2
    e = np.sqrt(squared)
    logarithm = np.log((1.0 + e) / (1.0 - e))
    along = 2.0 * (1.0 - squared) / e**3 * (0.5 * logarithm - e)
    across = 1.0 / squared - (1.0 - squared) / (2.0 * e**3) * logarithm
    turn = squared**2 * (across - along) / ((2.0 - squared) * (2.0 * squared - (2.0 - squared) * (across - along)))
    return SpheroidFactors(along / (2.0 - along), across / (2.0 - across), turn)


class StripMoments(NamedTuple):
    """Added mass across the axis by strips, and its moments along the axis.

    Attributes
    ----------
    mass : float
        kg.
    first, gross : float
        Integral of mass times x, and times ``|x|``, kg m.
    second : float
        Integral of mass times x^2, kg m^2.
    """

    mass: float
    first: float
    gross: float
    second: float


def strip_added_mass(geometry: Geometry) -> StripMoments:
    """Return the added mass across the axis by strips without loss at the ends, as in Prestero (2001), ch. 4.

    A strip of the bare hull moves the mass of the water that it displaces. Fins with tips at `a` on a hull of radius R
    make of it ``pi rho (a^2 - R^2 + R^4 / a^2)``, that is ``pi rho (a^2 - R^2)^2 / a^2`` more.
    """
    fins, x = geometry.fins, geometry.x
    hull = np.pi * geometry.density * geometry.hull.radius**2
    station = np.linspace(*fins.extent, _N_STRIPS_OF_FINS)
    tip, radius = fins.tip_radius**2, np.minimum(geometry.hull.radius_at(station), fins.tip_radius) ** 2
    more, fin_x = np.pi * geometry.density * (tip - radius) ** 2 / tip, geometry.centre_of_buoyancy - station

    def moment(of_hull: Array, of_fins: Array) -> float:
        return geometry.along_hull(hull * of_hull) + float(np.trapezoid(more * of_fins, station))

    return StripMoments(
        moment(np.ones_like(x), np.ones_like(fin_x)),
        moment(x, fin_x),
        moment(np.abs(x), np.abs(fin_x)),
        moment(x**2, fin_x**2),
    )


def surge_added_mass(geometry: Geometry) -> float:
    """Return the added mass along the axis of a spheroid of the hull's length and diameter, kg: Lamb's k1."""
    hull = geometry.hull
    displaced = geometry.density * np.pi / 6.0 * hull.length * hull.diameter**2
    return float(spheroid_factors(hull.slenderness).surge * displaced)


def roll_added_inertia(geometry: Geometry) -> float:
    """Return the added inertia of four fins that turn about the axis, kg m^2: ``2/pi rho a^4`` for each length."""
    fins = geometry.fins
    return 2.0 / np.pi * geometry.density * fins.tip_radius**4 * fins.chord
