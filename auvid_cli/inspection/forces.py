"""Inputs against what moves a body of that size and mass so: in a mistaken unit they are far from that."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.check import Check
from auvid_cli.data.dataset import InputRecord
from auvid_cli.inspection.grid import Signals, derivative
from auvid_cli.inspection.inspection import judged
from auvid_cli.vehicle.coefficients import CoefficientSet

Array = NDArray[np.float64]

# Of the force that moves a disc of the hull's section, of which a streamlined hull needs about a tenth; of the moment
# that rolls the weight over. What is beyond the first may be, what is beyond the second cannot.
_DOUBTFUL, _IMPOSSIBLE = (3e-3, 10.0), (1e-4, 100.0)
_MOST_OF_THE_TIME = 0.9
_SLOWEST = 0.05
# Correlation of the thrust with the law of a propeller at which it was made by that.
_MADE_OF = 0.95
_LARGEST_FIN = 0.5 * np.pi
_UNIT = (
    "Look at the unit, and at the law by which it follows from the propeller: revolutions in rpm, percent, N or kgf."
)


def force_checks(signals: Signals, vehicle: VehicleSettings) -> list[Check]:
    """Judge fins, surge force and roll moment, as far as they are not zero all the time."""
    parameters, size = vehicle.known_parameters(), vehicle.size
    checks = [_fin(signals, symbol) for symbol in ("rudder", "elevator")]
    if signals.has("u") and _reached(signals.values["u"]) > _SLOWEST:
        u = signals.values["u"]
        resistance = 0.5 * size.density * 0.25 * np.pi * size.diameter**2 * _reached(u) ** 2
        inertia = parameters["m"] * _reached(derivative(u, signals.grid.step))
        what = "what moves a body of that size and mass so"
        checks.append(_against(signals, "surge_force", "N", resistance + inertia, what))
    checks.append(
        _against(signals, "roll_moment", "N m", 0.5 * parameters["W"] * size.diameter, "weight times radius", 0.0)
    )
    return [check for check in checks if check is not None]


def doubled_thrust_check(inputs: InputRecord, coefficients: CoefficientSet) -> list[Check]:
    """Say whether a thrust made of the revolutions stands beside terms of these: it would count twice."""
    names = [term.symbol for term in coefficients.of_propulsion if term.row == 0 and "n" in term.signals]
    symbols = [quantity.symbol for quantity in inputs.quantities]
    if not names or "revolutions" not in symbols:
        return []
    force, turns = (inputs.values[:, symbols.index(name)] for name in ("surge_force", "revolutions"))
    law, force = turns * np.abs(turns), force - force.mean()
    law = law - law.mean()
    sizes = float(np.linalg.norm(law) * np.linalg.norm(force))
    alike = float(law @ force) / sizes if sizes else 0.0
    return [
        judged(
            "surge_force",
            "made of revolutions",
            statistic=f"correlation {alike:.2f} with n |n|",
            threshold=f"<= {_MADE_OF:g}",
            passed=None if alike > _MADE_OF else True,
            advice=f"The thrust follows from the revolutions, of which {', '.join(names)} make a force as well: take "
            "the thrust or these terms out, else it counts twice and neither can be told.",
        )
    ]


def _fin(signals: Signals, symbol: str) -> Check | None:
    largest = _largest(signals, symbol)
    if not largest:
        return None
    advice = "No fin turns so far: look at its `unit`, or `centre` and `scale`, in the map."
    reached = f"up to {np.rad2deg(largest):.3g} deg"
    return judged(
        symbol, "deflection", statistic=reached, threshold="<= 90 deg", passed=largest <= _LARGEST_FIN, advice=advice
    )


def _against(
    signals: Signals, symbol: str, unit: str, usual: float, meaning: str, least: float | None = None
) -> Check | None:
    """Judge the size of an input; `least` stands for the lower limits where little is nothing doubtful."""
    if not _largest(signals, symbol):
        return None
    reached = _reached(signals.values[symbol])
    ratio = reached / usual

    def within(limits: tuple[float, float]) -> bool:
        return (limits[0] if least is None else least) <= ratio <= limits[1]

    passed = True if within(_DOUBTFUL) else None if within(_IMPOSSIBLE) else False
    low, high = (limit * usual for limit in _DOUBTFUL)
    return judged(
        symbol,
        "size",
        statistic=f"{reached:.3g} {unit}",
        threshold=f"{low if least is None else least:.2g} to {high:.2g} {unit}: {meaning} takes {usual:.2g} {unit} or "
        "less",
        passed=passed,
        advice=f"{ratio:.2g} times {meaning}. {_UNIT}",
    )


def _largest(signals: Signals, symbol: str) -> float:
    return float(np.nanmax(np.abs(signals.values[symbol]), initial=0.0))


def _reached(values: Array) -> float:
    """Return what is exceeded only for a tenth of the time."""
    sizes = np.abs(values[np.isfinite(values)])
    return float(np.quantile(sizes, _MOST_OF_THE_TIME)) if sizes.size else 0.0
