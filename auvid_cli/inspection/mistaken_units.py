"""Which mistaken unit a factor between two signals points to."""

from math import log

from auvid_cli.vehicle.kinematics import GRAVITY

# How much a unit is in SI units, turned over: the factor by which numbers in it are too large.
_FACTORS = {
    "m": {"feet": 1.0 / 0.3048, "mm": 1000.0, "cm": 100.0},
    "m/s": {"knots": 3600.0 / 1852.0, "ft/s": 1.0 / 0.3048, "km/h": 3.6, "mm/s": 1000.0, "cm/s": 100.0},
    "m/s^2": {"g": 1.0 / GRAVITY, "mg": 1000.0 / GRAVITY},
    "rad": {"degrees": 57.29577951308232, "mrad": 1000.0},
    "rad/s": {"deg/s": 57.29577951308232, "rad/min": 60.0, "revolutions per minute": 9.549296585513721},
}
_NEAR = log(1.1)


def mistaken_unit(symbol: str, unit: str, times: float) -> str:
    """Name the unit that explains why a signal is so many times too large; empty if no usual one does.

    Parameters
    ----------
    symbol : str
    unit : str
        SI unit for which it was taken.
    times : float
        Positive.
    """
    candidates = []
    for name, factor in _FACTORS[unit].items():
        candidates.append((abs(log(times / factor)), f"{symbol} is in {name}, taken for {unit}."))
        candidates.append(
            (abs(log(times * factor)), f"{symbol} was in {unit} and was converted as if it were in {name}.")
        )
    nearest, words = min(candidates)
    return words if nearest < _NEAR else ""


def mistaken_units(factor: float, above: tuple[str, str], below: tuple[str, str]) -> str:
    """Do the same where a gain may be that of either of two signals, each a symbol and its SI unit, or of both."""
    if factor == 0.0:
        return ""
    size = abs(factor)
    return " Or: ".join(words for words in (mistaken_unit(*above, size), mistaken_unit(*below, 1.0 / size)) if words)
