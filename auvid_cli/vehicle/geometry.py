"""Inertia, added mass and coefficients from a vehicle's shape, each with mean, standard deviation, formula and source.

Means and standard deviations are such that four published vehicles scatter by about as much (see docs/theory.md).
"""

from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np

from auvid_cli.vehicle.added_mass import roll_added_inertia, spheroid_factors, strip_added_mass, surge_added_mass
from auvid_cli.vehicle.coefficients import COEFFICIENTS, EQUATION_ROWS
from auvid_cli.vehicle.parameters import PARAMETERS
from auvid_cli.vehicle.shape import Geometry
from auvid_cli.vehicle.steady_flow import (
    appendage_drag,
    bare_hull_drag,
    cross_flow,
    fin_drag,
    fin_lift,
    hull_lift,
)
from auvid_cli.vehicle.term_library import term

# Times the drag of the bare hull, where nobody says what sticks out of it.
_WITH_UNKNOWN_APPENDAGES = 2.2
# Of differences of large integrals: of the integral of the sizes.
_OF_GROSS = 0.3
_DIGITS = 4
# Beyond the 22 coefficients: terms of a vehicle's own.
DERIVED_TERMS = (term(EQUATION_ROWS.index("K"), ("u", "p")),)
_UNITS = {quantity.symbol: quantity.unit for quantity in (*PARAMETERS, *COEFFICIENTS, *DERIVED_TERMS)}


class DerivedValue(NamedTuple):
    """A number of a vehicle that follows from its shape, SI.

    Attributes
    ----------
    name : str
        Symbol, such as ``Y_v|v|``.
    unit : str
    mean, standard_deviation : float
        To four digits, so that a file holds the same number.
    formula : str
        Its number in the theory, such as ``G8``, and what it is.
    source : str
        Where the formula is from.
    """

    name: str
    unit: str
    mean: float
    standard_deviation: float
    formula: str
    source: str


class _Formula(NamedTuple):
    text: str
    source: str


_INERTIA = _Formula("G1, uniform solid of the hull", "mechanics")
_SURGE = _Formula("G2, 1.5 times a spheroid", "Lamb; Imlay 1961")
_SWAY = _Formula("G3, strips with fins times k2 of a spheroid", "Prestero 2001, ch. 4; Imlay 1961")
_TURN = _Formula("G4, strips with fins times k' of a spheroid", "Prestero 2001, ch. 4; Imlay 1961")
_COUPLED = _Formula("G5, strips with fins", "Prestero 2001, ch. 4")
_ROLL_MASS = _Formula("G6, four fins about their axis", "Prestero 2001, ch. 4")
_AXIAL = _Formula("G7, skin friction, form and appendages", "ITTC 1957; Hoerner 1965; Prestero 2001, eqs. 4.6-4.7")
_ACROSS = _Formula("G8, cross-flow of hull and fins", "Prestero 2001, ch. 4; Hoerner 1965; Whicker and Fehlner 1958")
_ASKEW = _Formula("G9, cross-flow ahead less cross-flow behind", "Prestero 2001, eq. 4.8, sign corrected")
_TURNING = _Formula("G10, cross-flow of turning", "Prestero 2001, ch. 4")
_ROLLING = _Formula("G11, cross-flow of the fins in roll", "Prestero 2001, ch. 4")
_LIFT = _Formula("G12, 0.7 times lift of hull and fins", "Hoerner 1985; Prestero 2001, eqs. 4.27-4.38")
_LIFT_MOMENT = _Formula("G13, 0.6 times moment of that lift", "Hoerner 1985; Prestero 2001, eqs. 4.27-4.44")
_RATE = _Formula("G14, lift of the fins as the tail swings", "Prestero 2001, eq. 4.44")
_CONTROL = _Formula("G15, 0.6 times lift of the fins that turn", "Hoerner 1985; Prestero 2001, eqs. 4.38-4.44")
_ROLL_LIFT = _Formula("G16, lift of the fins in roll", "strip theory of the fins")


class _Derived(NamedTuple):
    name: str
    mean: float
    standard_deviation: float
    formula: _Formula


def coefficients_from_geometry(geometry: Geometry, mass: float, speed: float = 1.5) -> tuple[DerivedValue, ...]:
    """Return what follows of a vehicle from its shape and mass, each number with how sure it is and where it is from.

    Parameters
    ----------
    geometry : Geometry
    mass : float
        kg.
    speed : float, default 1.5
        At which it travels, m/s; skin friction hangs on it a little.

    Returns
    -------
    tuple of DerivedValue
        Inertia and added mass, the 22 coefficients, and the coefficients of `DERIVED_TERMS`.
    """
    groups = (
        _inertia(geometry, mass),
        _added_mass(geometry),
        _damping(geometry, speed),
        _lift(geometry),
        _control(geometry),
        _roll_by_speed(geometry),
    )
    return tuple(
        DerivedValue(name, _UNITS[name], _rounded(mean), _rounded(deviation), *formula)
        for name, mean, deviation, formula in chain(*groups)
    )


def _rounded(number: float) -> float:
    return float(f"{number:.{_DIGITS}g}")


def _share(name: str, mean: float, share: float, formula: _Formula) -> _Derived:
    """Give a number a standard deviation that is a share of it."""
    return _Derived(name, mean, share * abs(mean), formula)


def _inertia(geometry: Geometry, mass: float) -> Iterator[_Derived]:
    hull = geometry.hull
    area = np.pi * hull.radius**2
    about_axis = geometry.along_hull(0.5 * area * hull.radius**2) / hull.volume
    along = geometry.along_hull(area * (hull.station - hull.centre) ** 2) / hull.volume
    yield _share("Ixx", mass * about_axis, 0.2, _INERTIA)
    yield _share("Iyy", mass * (along + 0.5 * about_axis), 0.2, _INERTIA)
    yield _share("Izz", mass * (along + 0.5 * about_axis), 0.2, _INERTIA)


def _added_mass(geometry: Geometry) -> Iterator[_Derived]:
    factors, strips = spheroid_factors(geometry.hull.slenderness), strip_added_mass(geometry)
    across, turn = factors.sway * strips.mass, factors.turn * strips.second
    unsure = _OF_GROSS * strips.gross
    yield _share("X_udot", -1.5 * surge_added_mass(geometry), 0.7, _SURGE)
    yield _share("Y_vdot", -across, 0.2, _SWAY)
    yield _share("Z_wdot", -across, 0.2, _SWAY)
    yield _Derived("Y_rdot", -strips.first, unsure, _COUPLED)
    yield _Derived("Z_qdot", strips.first, unsure, _COUPLED)
    yield _share("K_pdot", -roll_added_inertia(geometry), 2.0, _ROLL_MASS)
    yield _share("M_qdot", -turn, 0.4, _TURN)
    yield _share("N_rdot", -turn, 0.4, _TURN)
    yield _Derived("M_wdot", strips.first, unsure, _COUPLED)
    yield _Derived("N_vdot", -strips.first, unsure, _COUPLED)


def _damping(geometry: Geometry, speed: float) -> Iterator[_Derived]:
    flow, bare = cross_flow(geometry), bare_hull_drag(geometry, speed)
    axial = bare + appendage_drag(geometry) if geometry.appendages else _WITH_UNKNOWN_APPENDAGES * bare
    roll = geometry.fins.number * fin_drag(geometry) * geometry.fins.mean_radius**3
    of_moment, of_force = _OF_GROSS * flow.gross_moment, _OF_GROSS * flow.gross_force_of_turn
    yield _share("X_u|u|", -axial, 0.4, _AXIAL)
    yield _share("Y_v|v|", -flow.force, 0.7, _ACROSS)
    yield _Derived("Y_r|r|", -flow.force_of_turn, of_force, _TURNING)
    yield _share("Z_w|w|", -flow.force, 0.7, _ACROSS)
    yield _Derived("Z_q|q|", flow.force_of_turn, of_force, _TURNING)
    yield _share("K_p|p|", -roll, 10.0, _ROLLING)
    yield _share("M_q|q|", -flow.moment_of_turn, 2.0, _TURNING)
    yield _Derived("M_w|w|", flow.moment, of_moment, _ASKEW)
    yield _share("N_r|r|", -flow.moment_of_turn, 2.0, _TURNING)
    yield _Derived("N_v|v|", -flow.moment, of_moment, _ASKEW)


def _lift(geometry: Geometry) -> Iterator[_Derived]:
    of_hull, of_fins, x = hull_lift(geometry), geometry.fins.per_plane * fin_lift(geometry), geometry.fin_x
    force, moment = 0.7 * (of_hull.force + of_fins), 0.6 * (of_hull.moment + x * of_fins)
    # As moments may cancel, of their sizes.
    unsure = 0.8 * 0.6 * (abs(of_hull.moment) + abs(x * of_fins))
    yield _share("Y_url", -x * of_fins, 0.8, _RATE)
    yield _share("Y_uvl", -force, 0.4, _LIFT)
    yield _share("Z_uql", x * of_fins, 0.8, _RATE)
    yield _share("Z_uwl", -force, 0.4, _LIFT)
    yield _share("M_uql", -(x**2) * of_fins, 0.8, _RATE)
    yield _Derived("M_uwl", moment, unsure, _LIFT_MOMENT)
    yield _share("N_url", -(x**2) * of_fins, 0.8, _RATE)
    yield _Derived("N_uvl", -moment, unsure, _LIFT_MOMENT)


def _control(geometry: Geometry) -> Iterator[_Derived]:
    force = 0.6 * geometry.fins.turning * fin_lift(geometry)
    yield _share("Y_uudr", force, 0.5, _CONTROL)
    yield _share("Z_uude", -force, 0.5, _CONTROL)
    yield _share("M_uude", geometry.fin_x * force, 0.5, _CONTROL)
    yield _share("N_uudr", geometry.fin_x * force, 0.5, _CONTROL)


def _roll_by_speed(geometry: Geometry) -> Iterator[_Derived]:
    fins = geometry.fins
    yield _share("K_up", -fins.number * fin_lift(geometry) * fins.mean_radius**2, 0.5, _ROLL_LIFT)
