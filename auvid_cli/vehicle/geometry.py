"""Coefficients from a vehicle's shape: added mass by slender-body theory, lift and drag of hull and fins."""

from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.vehicle.coefficients import COEFFICIENTS, EQUATION_ROWS, term
from auvid_cli.vehicle.hull import Geometry
from auvid_cli.vehicle.parameters import PARAMETERS

_N_STRIPS_OF_FINS = 201
VISCOSITY = 1.19e-6  # m^2/s, kinematic, of sea water at 15 degrees Celsius
# Drag coefficient of a cylinder across the flow: Hoerner, as in Prestero (2001), ch. 4.
_CYLINDER_DRAG = 1.1
# Distance of the centre of lift of a hull from the nose, as a share of the length: Hoerner's 0.6 to 0.7.
_CENTRE_OF_LIFT = 0.65
# Ratio of the drag of a vehicle with unknown appendages to that of its bare hull.
_WITH_UNKNOWN_APPENDAGES = 2.2
# Standard deviation of a difference of large integrals, as a share of the integral of absolute values.
_RELATIVE_TO_GROSS = 0.3
_SIGNIFICANT_DIGITS = 4
# Terms beyond the 22 coefficients.
DERIVED_TERMS = (term(EQUATION_ROWS.index("K"), ("u", "p")),)
_UNITS = {quantity.symbol: quantity.unit for quantity in (*PARAMETERS, *COEFFICIENTS, *DERIVED_TERMS)}


class SpheroidFactors(NamedTuple):
    """Lamb's k1, k2 and k': added mass or inertia of a prolate spheroid divided by that of the displaced water."""

    surge: float
    sway: float
    turn: float


def spheroid_factors(slenderness: float) -> SpheroidFactors:
    """Return Lamb's factors for a ratio of length to diameter greater than 1, in the form of Imlay (1961)."""
    squared = 1.0 - slenderness**-2
    e = np.sqrt(squared)
    logarithm = np.log((1.0 + e) / (1.0 - e))
    along = 2.0 * (1.0 - squared) / e**3 * (0.5 * logarithm - e)
    across = 1.0 / squared - (1.0 - squared) / (2.0 * e**3) * logarithm
    turn = squared**2 * (across - along) / ((2.0 - squared) * (2.0 * squared - (2.0 - squared) * (across - along)))
    return SpheroidFactors(along / (2.0 - along), across / (2.0 - across), turn)


class StripMoments(NamedTuple):
    """Added mass across the axis by strips, and its moments along the axis."""

    mass: float  # integral of the added mass per length, kg
    first: float  # integral times x, kg m
    gross: float  # integral times ``|x|``, kg m
    second: float  # integral times x^2, kg m^2


def strip_added_mass(geometry: Geometry) -> StripMoments:
    """Return the added mass across the axis by strip theory without end losses, as in Prestero (2001), ch. 4.

    The added mass of a strip of the bare hull of radius R is ``pi rho R^2``. With fins up to radius a it is
    ``pi rho (a^2 - R^2 + R^4 / a^2)``, an increase of ``pi rho (a^2 - R^2)^2 / a^2``.
    """
    fins, x = geometry.fins, geometry.x
    hull = np.pi * geometry.density * geometry.hull.radius**2
    station = np.linspace(*fins.extent, _N_STRIPS_OF_FINS)
    tip, radius = fins.tip_radius**2, np.minimum(geometry.hull.radius_at(station), fins.tip_radius) ** 2
    fins_mass = np.pi * geometry.density * (tip - radius) ** 2 / tip
    fin_x = geometry.centre_of_buoyancy - station

    def moment(of_hull: Array, of_fins: Array) -> float:
        return geometry.along_hull(hull * of_hull) + float(np.trapezoid(fins_mass * of_fins, station))

    return StripMoments(
        moment(np.ones_like(x), np.ones_like(fin_x)),
        moment(x, fin_x),
        moment(np.abs(x), np.abs(fin_x)),
        moment(x**2, fin_x**2),
    )


def surge_added_mass(geometry: Geometry) -> float:
    """Return the added mass in surge of a spheroid of the hull's length and diameter, kg, with Lamb's k1."""
    hull = geometry.hull
    displaced = geometry.density * np.pi / 6.0 * hull.length * hull.diameter**2
    return float(spheroid_factors(hull.slenderness).surge * displaced)


def roll_added_inertia(geometry: Geometry) -> float:
    """Return the added inertia of four fins in roll, kg m^2: ``2/pi rho a^4`` per length of the fins."""
    fins = geometry.fins
    return 2.0 / np.pi * geometry.density * fins.tip_radius**4 * fins.chord


def bare_hull_drag(geometry: Geometry, speed: float) -> float:
    """Return the axial drag of the bare hull as ``rho/2 c_d A``, kg/m: friction by ITTC (1957), form by Hoerner."""
    hull = geometry.hull
    friction = 0.075 / (np.log10(speed * hull.length / VISCOSITY) - 2.0) ** 2
    form = 1.0 + 1.5 * hull.slenderness**-1.5 + 7.0 * hull.slenderness**-3
    return float(0.5 * geometry.density * friction * form * hull.wetted_area)


def appendage_drag(geometry: Geometry) -> float:
    """Return the axial drag of all appendages as ``rho/2 c_d A``, kg/m."""
    return 0.5 * geometry.density * sum(part.area * part.drag_coefficient for part in geometry.appendages)


class CrossFlow(NamedTuple):
    """Integrals along the axis of the drag of strips across the flow."""

    force: float  # drag, kg/m
    moment: float  # drag times x, kg
    gross_moment: float  # drag of the hull times ``|x|``, kg
    force_of_turn: float  # drag times ``x |x|``, kg m
    gross_force_of_turn: float  # drag of the hull times x^2, kg m
    moment_of_turn: float  # drag times ``|x|^3``, kg m^2


def cross_flow(geometry: Geometry) -> CrossFlow:
    """Return the cross-flow drag of strips as cylinders, as in Prestero (2001) with the sign in eq. (4.8) corrected."""
    x, at_fins = geometry.x, geometry.fin_x
    hull = 0.5 * geometry.density * _CYLINDER_DRAG * 2.0 * geometry.hull.radius
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
    """Return the lift slope of one fin as ``rho/2 c_L S``, kg/m per radian."""
    return 0.5 * geometry.density * geometry.fins.area * geometry.fins.lift_slope


class HullLift(NamedTuple):
    """Lift slope of the hull as ``rho/2 c d^2``, kg/m per radian, and its moment, kg per radian (negative: aft)."""

    force: float
    moment: float


def hull_lift(geometry: Geometry) -> HullLift:
    """Return the lift of the hull: Hoerner's ``0.003 l/d`` per degree, Prestero (2001), eqs. (4.27) to (4.36)."""
    hull = geometry.hull
    slope = 0.003 * hull.slenderness * 180.0 / np.pi
    force = 0.5 * geometry.density * hull.diameter**2 * slope
    return HullLift(float(force), float(force * (geometry.centre_of_buoyancy - _CENTRE_OF_LIFT * hull.length)))


class DerivedValue(NamedTuple):
    """A parameter or coefficient derived from the shape, SI."""

    name: str  # symbol, such as ``Y_v|v|``
    unit: str
    mean: float  # rounded to four digits, as in a vehicle file
    standard_deviation: float  # rounded to four digits
    formula: str  # number of the formula in docs/theory.md, such as ``G8``, and its description
    source: str  # publication of the formula


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
    """Return inertia, added mass, the 22 coefficients and those of `DERIVED_TERMS` from shape and mass.

    Parameters
    ----------
    geometry : Geometry
    mass : float
        kg.
    speed : float, default 1.5
        Cruising speed for the skin friction, m/s.
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
    return float(f"{number:.{_SIGNIFICANT_DIGITS}g}")


def _share(name: str, mean: float, share: float, formula: _Formula) -> _Derived:
    """Return a value whose standard deviation is `share` times its size."""
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
    deviation = _RELATIVE_TO_GROSS * strips.gross
    yield _share("X_udot", -1.5 * surge_added_mass(geometry), 0.7, _SURGE)
    yield _share("Y_vdot", -across, 0.2, _SWAY)
    yield _share("Z_wdot", -across, 0.2, _SWAY)
    yield _Derived("Y_rdot", -strips.first, deviation, _COUPLED)
    yield _Derived("Z_qdot", strips.first, deviation, _COUPLED)
    yield _share("K_pdot", -roll_added_inertia(geometry), 2.0, _ROLL_MASS)
    yield _share("M_qdot", -turn, 0.4, _TURN)
    yield _share("N_rdot", -turn, 0.4, _TURN)
    yield _Derived("M_wdot", strips.first, deviation, _COUPLED)
    yield _Derived("N_vdot", -strips.first, deviation, _COUPLED)


def _damping(geometry: Geometry, speed: float) -> Iterator[_Derived]:
    flow, bare = cross_flow(geometry), bare_hull_drag(geometry, speed)
    axial = bare + appendage_drag(geometry) if geometry.appendages else _WITH_UNKNOWN_APPENDAGES * bare
    roll = geometry.fins.number * fin_drag(geometry) * geometry.fins.mean_radius**3
    of_moment, of_force = (_RELATIVE_TO_GROSS * gross for gross in (flow.gross_moment, flow.gross_force_of_turn))
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
    # Relative to the absolute values, because the moments of hull and fins may cancel.
    deviation = 0.8 * 0.6 * (abs(of_hull.moment) + abs(x * of_fins))
    yield _share("Y_url", -x * of_fins, 0.8, _RATE)
    yield _share("Y_uvl", -force, 0.4, _LIFT)
    yield _share("Z_uql", x * of_fins, 0.8, _RATE)
    yield _share("Z_uwl", -force, 0.4, _LIFT)
    yield _share("M_uql", -(x**2) * of_fins, 0.8, _RATE)
    yield _Derived("M_uwl", moment, deviation, _LIFT_MOMENT)
    yield _share("N_url", -(x**2) * of_fins, 0.8, _RATE)
    yield _Derived("N_uvl", -moment, deviation, _LIFT_MOMENT)


def _control(geometry: Geometry) -> Iterator[_Derived]:
    force = 0.6 * geometry.fins.turning * fin_lift(geometry)
    yield _share("Y_uudr", force, 0.5, _CONTROL)
    yield _share("Z_uude", -force, 0.5, _CONTROL)
    yield _share("M_uude", geometry.fin_x * force, 0.5, _CONTROL)
    yield _share("N_uudr", geometry.fin_x * force, 0.5, _CONTROL)


def _roll_by_speed(geometry: Geometry) -> Iterator[_Derived]:
    fins = geometry.fins
    yield _share("K_up", -fins.number * fin_lift(geometry) * fins.mean_radius**2, 0.5, _ROLL_LIFT)
