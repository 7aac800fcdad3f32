"""The 22 hydrodynamic coefficients of Sabet et al. 2018, Table II, and further terms of a vehicle."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import combinations_with_replacement
from typing import Literal, NamedTuple

from auvid_cli.vehicle.parameters import PARAMETER_SYMBOLS

CoefficientGroup = Literal["damping", "lift", "control", "term"]
# Surge, sway and heave forces; roll, pitch and yaw moments.
EQUATION_ROWS = "XYZKMN"
# Possible factors of a term, with or without a modulus: body velocities and rates, fins, propeller thrust, propeller
# revolutions per second (n), battery voltage.
SIGNALS = ("u", "v", "w", "p", "q", "r", "rudder", "elevator", "thrust", "n", "voltage")
# Signals that not every dataset has, with the names of these inputs.
PROPULSION_SIGNALS = {"n": "revolutions", "voltage": "voltage"}
MAX_FACTORS = 6
# Exponents of kg, m, s, rad and V in SI units.
_VELOCITY = (0, 1, -1, 0, 0)
_RATE = (0, 0, -1, 1, 0)
_ANGLE = (0, 0, 0, 1, 0)
_FORCE = (1, 1, -2, 0, 0)
_TURNS = (0, 0, -1, 0, 0)
_VOLTAGE = (0, 0, 0, 0, 1)
_DIMENSIONS: dict[str, tuple[int, ...]] = dict(
    zip(SIGNALS, (*[_VELOCITY] * 3, *[_RATE] * 3, *[_ANGLE] * 2, _FORCE, _TURNS, _VOLTAGE), strict=True)
)
# Row, and for each signal its exponent and whether its sign matters. Two terms with the same regressor are the same.
Regressor = tuple[int, frozenset[tuple[str, int, bool]]]
# Valid name of a term: a row of the equations, an underscore, and a word.
TERM_NAME = rf"^[{EQUATION_ROWS}]_[A-Za-z0-9_|]{{1,40}}$"
_VELOCITIES = ("u", "v", "w", "p", "q", "r")
_FINS = ("rudder", "elevator")
# Rows and signals that change sign when port and starboard are exchanged.
_MIRRORED = frozenset(("Y", "K", "N", "v", "p", "r", "rudder"))


class Coefficient(NamedTuple):
    """One hydrodynamic coefficient: `force or moment = coefficient * product(factors)`."""

    symbol: str  # name in the notation of the paper, for example ``X_u|u|``
    unit: str  # SI unit in the syntax of pint
    meaning: str  # one phrase for tables and documentation
    row: int  # row of the equations of motion: 0..5 for X, Y, Z, K, M, N
    factors: tuple[str, ...]  # at most `MAX_FACTORS` of `SIGNALS`, a modulus as ``|v|``
    group: CoefficientGroup  # the paper's groups damping, lift and control, or ``term`` for a term of the vehicle's own

    @property
    def identifier(self) -> str:
        """Return the symbol as a name in code, for example ``X_uu``."""
        return self.symbol.replace("|", "")

    @property
    def signals(self) -> tuple[str, ...]:
        """Return the factors without their moduli."""
        return tuple(factor.strip("|") for factor in self.factors)

    @property
    def moduli(self) -> tuple[bool, ...]:
        """Return whether each factor is a modulus."""
        return tuple(factor != signal for factor, signal in zip(self.factors, self.signals, strict=True))

    @property
    def is_of_inputs(self) -> bool:
        """Whether a fin or the thrust is among the factors."""
        return bool({"rudder", "elevator", "thrust"} & {*self.signals})

    @property
    def regressor(self) -> Regressor:
        """Return the product of factors in a form that is equal for equal products: ``|v| |v|`` is ``v v``."""
        counts = Counter(self.signals)
        bare = Counter(s for s, modulus in zip(self.signals, self.moduli, strict=True) if not modulus)
        return self.row, frozenset((signal, n, bare[signal] % 2 == 1) for signal, n in counts.items())

    @property
    def equation(self) -> str:
        """Return the term as text, for example ``Y += Y_uudr u u rudder``."""
        return f"{EQUATION_ROWS[self.row]} += {self.symbol} {' '.join(self.factors)}"


class CoefficientSet(tuple[Coefficient, ...]):
    """The coefficients of one vehicle: the 22, then the terms of its own."""

    __slots__ = ()

    @property
    def symbols(self) -> tuple[str, ...]:
        """Return the symbols."""
        return tuple(coefficient.symbol for coefficient in self)

    @property
    def units(self) -> dict[str, str]:
        """Return the SI units by symbol."""
        return {coefficient.symbol: coefficient.unit for coefficient in self}

    @property
    def terms(self) -> tuple[Coefficient, ...]:
        """Return the terms beyond the 22."""
        return self[N_COEFFICIENTS:]

    @property
    def of_propulsion(self) -> tuple[Coefficient, ...]:
        """Return the terms with a factor that not every dataset has."""
        return tuple(term for term in self.terms if {*PROPULSION_SIGNALS} & {*term.signals})


COEFFICIENTS = CoefficientSet(
    (
        Coefficient("X_u|u|", "kg/m", "axial drag", 0, ("|u|", "u"), "damping"),
        Coefficient("Y_v|v|", "kg/m", "cross-flow drag in sway", 1, ("|v|", "v"), "damping"),
        Coefficient("Y_r|r|", "kg*m/rad^2", "sway force of yaw-rate cross-flow", 1, ("|r|", "r"), "damping"),
        Coefficient("Z_w|w|", "kg/m", "cross-flow drag in heave", 2, ("|w|", "w"), "damping"),
        Coefficient("Z_q|q|", "kg*m/rad^2", "heave force of pitch-rate cross-flow", 2, ("|q|", "q"), "damping"),
        Coefficient("K_p|p|", "kg*m^2/rad^2", "rolling resistance", 3, ("|p|", "p"), "damping"),
        Coefficient("M_q|q|", "kg*m^2/rad^2", "cross-flow drag moment in pitch", 4, ("|q|", "q"), "damping"),
        Coefficient("M_w|w|", "kg", "pitch moment of heave cross-flow", 4, ("|w|", "w"), "damping"),
        Coefficient("N_r|r|", "kg*m^2/rad^2", "cross-flow drag moment in yaw", 5, ("|r|", "r"), "damping"),
        Coefficient("N_v|v|", "kg", "yaw moment of sway cross-flow", 5, ("|v|", "v"), "damping"),
        Coefficient("Y_url", "kg/rad", "sway lift of yaw rate", 1, ("u", "r"), "lift"),
        Coefficient("Y_uvl", "kg/m", "sway lift of sideslip", 1, ("u", "v"), "lift"),
        Coefficient("Z_uql", "kg/rad", "heave lift of pitch rate", 2, ("u", "q"), "lift"),
        Coefficient("Z_uwl", "kg/m", "heave lift of angle of attack", 2, ("u", "w"), "lift"),
        Coefficient("M_uql", "kg*m/rad", "pitch lift moment of pitch rate", 4, ("u", "q"), "lift"),
        Coefficient("M_uwl", "kg", "pitch lift moment of angle of attack", 4, ("u", "w"), "lift"),
        Coefficient("N_url", "kg*m/rad", "yaw lift moment of yaw rate", 5, ("u", "r"), "lift"),
        Coefficient("N_uvl", "kg", "yaw lift moment of sideslip", 5, ("u", "v"), "lift"),
        Coefficient("Y_uudr", "kg/(m*rad)", "sway force of the rudder", 1, ("u", "u", "rudder"), "control"),
        Coefficient("Z_uude", "kg/(m*rad)", "heave force of the elevator", 2, ("u", "u", "elevator"), "control"),
        Coefficient("M_uude", "kg/rad", "pitch moment of the elevator", 4, ("u", "u", "elevator"), "control"),
        Coefficient("N_uudr", "kg/rad", "yaw moment of the rudder", 5, ("u", "u", "rudder"), "control"),
    )
)


def is_name_of_term(name: str) -> bool:
    """Whether a name is valid for a term of the vehicle's own."""
    return re.fullmatch(TERM_NAME, name) is not None


def unit_of(row: int, factors: Iterable[str]) -> str:
    """Return the SI unit of a coefficient with these factors, in the syntax of pint."""
    exponents = [*_FORCE]
    exponents[1] += row >= 3
    for factor in factors:
        exponents = [a - b for a, b in zip(exponents, _DIMENSIONS[factor.strip("|")], strict=True)]
    powers = dict(zip(("kg", "m", "s", "rad", "V"), exponents, strict=True))
    above, below = ([_power(u, sign * n) for u, n in powers.items() if sign * n > 0] for sign in (1, -1))
    over = f"({'*'.join(below)})" if len(below) > 1 else "".join(below)
    return ("*".join(above) or "1") + (f"/{over}" if over else "")


def _power(unit: str, exponent: int) -> str:
    return unit if exponent == 1 else f"{unit}^{exponent}"


SYMBOLS: tuple[str, ...] = COEFFICIENTS.symbols
# Damping of a motion by its own velocity. It dissipates energy, so its sign is certain.
DRAG_SYMBOLS = tuple(c.symbol for c in COEFFICIENTS if c.group == "damping" and SIGNALS.index(c.signals[0]) == c.row)
N_COEFFICIENTS = len(COEFFICIENTS)
# Identifiers that an own term of a vehicle must not have, with the symbols that use them.
RESERVED_NAMES = {c.identifier: c.symbol for c in COEFFICIENTS} | {symbol: symbol for symbol in PARAMETER_SYMBOLS}


def admissible_terms(any_symmetry: bool = False) -> tuple[Coefficient, ...]:
    """Return the candidates for missing terms: products of velocities and fins that are not among the 22.

    Parameters
    ----------
    any_symmetry : bool
        Whether to include terms of a vehicle whose port and starboard sides differ.
    """
    present = {regressor_ahead(c) for c in COEFFICIENTS}
    terms = (term(row, factors) for row in range(len(EQUATION_ROWS)) for factors in _factors())
    return tuple(t for t in terms if regressor_ahead(t) not in present and (any_symmetry or respects_symmetry(t)))


def term(row: int, factors: tuple[str, ...]) -> Coefficient:
    """Return a term with its usual name, for example ``N_|v|r``; row and factors as in `Coefficient`."""
    name = f"{EQUATION_ROWS[row]}_{''.join(factors)}"
    if name.replace("|", "") in RESERVED_NAMES:
        name += "_even"
    return Coefficient(name, unit_of(row, factors), f"missing term {' '.join(factors)}", row, factors, "term")


def respects_symmetry(coefficient: Coefficient) -> bool:
    """Whether a vehicle with port and starboard symmetry can have a term."""
    changes = sum(factor in _MIRRORED for factor in coefficient.factors)
    return changes % 2 == (EQUATION_ROWS[coefficient.row] in _MIRRORED)


def regressor_ahead(coefficient: Coefficient) -> Regressor:
    """Return the regressor for forward motion, where u equals its modulus."""
    row, factors = coefficient.regressor
    return row, frozenset((signal, n, odd and signal != "u") for signal, n, odd in factors)


def _factors() -> Iterator[tuple[str, ...]]:
    """Yield each velocity, products of two with and without a modulus, and u u times a fin and its modulus."""
    for velocity in _VELOCITIES:
        yield (velocity,)
    for first, second in combinations_with_replacement(_VELOCITIES, 2):
        if first == second == "u":
            yield "u", "u"
        elif first == "u":
            yield "u", second
            yield "u", f"|{second}|"
        else:
            yield first, second
            yield f"|{first}|", second
            if first != second:
                yield f"|{second}|", first
                yield f"|{first}|", f"|{second}|"
    for fin in _FINS:
        yield "u", "u", fin
        yield "u", "u", f"|{fin}|"
