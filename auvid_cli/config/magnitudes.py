"""How large a number of the settings may be, and how small unless it is 0, by its unit.

The limits are far beyond what any vehicle, sensor or sea is; they are there because numbers beyond them overflow or
vanish in the computation, and are mistakes. Keys for which less is sensible have narrower limits of their own.
"""

from typing import NamedTuple


class Magnitude(NamedTuple):
    """Sizes that numbers of a unit may have: `least` binds amounts, such as a standard deviation, if they are not 0."""

    least: float
    most: float


_BY_UNIT = {
    # Clocks count from 1970, some of them in nanoseconds.
    "s": Magnitude(1e-9, 1e20),
    "Hz": Magnitude(1e-6, 1e4),
    "m": Magnitude(1e-12, 1e6),
    "m/s": Magnitude(1e-12, 1e6),
    "m/s^2": Magnitude(1e-12, 1e6),
    "rad": Magnitude(1e-12, 1e6),
    "rad/s": Magnitude(1e-12, 1e6),
    "N": Magnitude(1e-9, 1e12),
    "N*m": Magnitude(1e-9, 1e15),
}
# Noise densities, random walks, and what a gain in a log map is.
_OTHERWISE = Magnitude(1e-12, 1e6)
# Mass, inertia and coefficients of hulls from a centimetre to a kilometre.
_OF_MASS = Magnitude(1e-15, 1e20)


def magnitude_of(unit: str) -> Magnitude:
    """Return the limits of a unit as the settings write it."""
    return _BY_UNIT.get(unit, _OF_MASS if "kg" in unit else _OTHERWISE)


def check_size(value: float, unit: str) -> float:
    """Return a number that may be so large in its unit.

    Raises
    ------
    ValueError
        If it may not be.
    """
    most = magnitude_of(unit).most
    if abs(value) > most:
        raise ValueError(f"must be at most {_written(most, unit)} in size, got {value:g}")
    return value


def check_amount(value: float, unit: str) -> float:
    """Return a number that may be so large, and if it is not 0 so small, in its unit.

    Raises
    ------
    ValueError
        If it may not be.
    """
    least = magnitude_of(unit).least
    if 0.0 < abs(value) < least:
        raise ValueError(f"must be at least {_written(least, unit)} if it is not 0, got {value:g}")
    return check_size(value, unit)


def _written(limit: float, unit: str) -> str:
    return f"{limit:g} {unit}".strip()
