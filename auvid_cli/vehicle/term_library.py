"""Products of velocities and fins that a hydrodynamic force may be made of, besides the 22.

A steady force on a body is a pressure, quadratic in the velocities, times an area; a fin's is that times its angle; at
low Reynolds numbers, and for what waves and appendages leave, a part is linear (Fossen 2011, sections 6.4 and 7.3.2).
A hull whose port side is the mirror image of its starboard side allows only some: in a mirror, Y, K and N change their
signs, and so do v, p, r and the rudder.
"""

from collections.abc import Iterator
from itertools import combinations_with_replacement

from auvid_cli.vehicle.coefficients import COEFFICIENTS, EQUATION_ROWS, Coefficient, Regressor, unit_of
from auvid_cli.vehicle.parameters import PARAMETER_SYMBOLS

_VELOCITIES, _FINS = ("u", "v", "w", "p", "q", "r"), ("rudder", "elevator")
# What changes its sign in a mirror from port to starboard.
_MIRRORED = frozenset(("Y", "K", "N", "v", "p", "r", "rudder"))
# Of each name in code that is taken, whose it is: a product that would be called so gets a name of its own.
TAKEN = {c.identifier: c.symbol for c in COEFFICIENTS} | {symbol: symbol for symbol in PARAMETER_SYMBOLS}


def admissible_terms(any_symmetry: bool = False) -> tuple[Coefficient, ...]:
    """Return all that a force may be made of, less what the 22 are.

    Parameters
    ----------
    any_symmetry : bool
        Whether those too that a vehicle has only if port and starboard differ.
    """
    there = {regressor_ahead(c) for c in COEFFICIENTS}
    terms = (term(row, factors) for row in range(len(EQUATION_ROWS)) for factors in _factors())
    return tuple(t for t in terms if regressor_ahead(t) not in there and (any_symmetry or is_mirror_image(t)))


def term(row: int, factors: tuple[str, ...]) -> Coefficient:
    """Return a product by its usual name, for example ``N_|v|r``.

    Parameters
    ----------
    row : int
        0..5 for X, Y, Z, K, M, N.
    factors : tuple of str
        See `Coefficient`.
    """
    name = f"{EQUATION_ROWS[row]}_{''.join(factors)}"
    if name.replace("|", "") in TAKEN:
        name += "_even"
    return Coefficient(name, unit_of(row, factors), f"missing term {' '.join(factors)}", row, factors, "term")


def is_mirror_image(coefficient: Coefficient) -> bool:
    """Say whether a term is the same on a vehicle whose port side is the mirror image of its starboard side."""
    changes = sum(factor in _MIRRORED for factor in coefficient.factors)
    return changes % 2 == (EQUATION_ROWS[coefficient.row] in _MIRRORED)


def regressor_ahead(coefficient: Coefficient) -> Regressor:
    """Return what two terms share that are the same for a vehicle that goes ahead, so that u is its modulus."""
    row, factors = coefficient.regressor
    return row, frozenset((signal, n, odd and signal != "u") for signal, n, odd in factors)


def _factors() -> Iterator[tuple[str, ...]]:
    """Yield each velocity, each product of two, with and without a modulus, and u u times a fin and its modulus."""
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
