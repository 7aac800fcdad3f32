"""What an identified coefficient cannot be, or what contradicts the vehicle file: data with another sign or unit."""

from collections.abc import Mapping

from auvid_cli.config.plausibility import STRONGEST_FINS, WEAKEST_FINS
from auvid_cli.data.estimate import Estimate
from auvid_cli.vehicle.coefficients import DRAG_SYMBOLS

# Drag along each axis takes energy. Positive rudder pushes the stern to starboard, a positive stern plane pushes it up.
DRAG = dict.fromkeys(DRAG_SYMBOLS, -1)
FINS = {"Y_uudr": 1, "N_uudr": -1, "Z_uude": -1, "M_uude": -1}

# Moments of fins.
_MOMENTS = ("N_uudr", "M_uude")


def pushing_drag(estimate: Estimate, sigmas: float) -> list[str]:
    """Return the symbols of drag that pushes, by more than so many of its standard deviations."""
    return _contradicting(estimate, DRAG, sigmas)


def reversed_fins(estimate: Estimate, sigmas: float) -> list[str]:
    """Return those of fins that count the other way round than in the shipped vehicles."""
    return _contradicting(estimate, FINS, sigmas)


def unlike_the_vehicle_file(estimate: Estimate, sigmas: float) -> list[str]:
    """Return those of fins that have another sign than the vehicle file states."""
    stated = estimate.experiment.vehicle.coefficients.by_symbol()
    return _contradicting(estimate, {symbol: stated[symbol] for symbol in FINS if symbol in stated}, sigmas)


def out_of_proportion(estimate: Estimate, sigmas: float) -> dict[str, float]:
    """Return moments of fins that are surely far from those of the vehicle file, as multiples of these."""
    stated = estimate.experiment.vehicle.coefficients.by_symbol()
    values, deviations = estimate.final_coefficients(), estimate.final_deviations()
    found = {}
    for symbol in _MOMENTS:
        if symbol in deviations and stated.get(symbol):
            times, unsure = abs(values[symbol] / stated[symbol]), sigmas * deviations[symbol] / abs(stated[symbol])
            if times - unsure > STRONGEST_FINS or times + unsure < WEAKEST_FINS:
                found[symbol] = times
    return found


def _contradicting(estimate: Estimate, signs: Mapping[str, float], sigmas: float) -> list[str]:
    values, deviations = estimate.final_coefficients(), estimate.final_deviations()
    return [
        symbol
        for symbol, sign in signs.items()
        if symbol in deviations and values[symbol] * sign < 0.0 and abs(values[symbol]) > sigmas * deviations[symbol]
    ]
