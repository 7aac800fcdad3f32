"""How lively the manoeuvre is, what it therefore cannot tell, and whether the sensors are fast enough to see it."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.check import Check
from auvid_cli.data.dataset import Dataset
from auvid_cli.inspection.grid import Signals
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.timing import new_measurement_rate
from auvid_cli.vehicle.coefficients import CoefficientSet
from auvid_cli.vehicle.parameters import INPUTS, MOTION, SENSORS, Quantity

Array = NDArray[np.float64]

_LEAST_FIN = np.deg2rad(1.0)
_LEAST_SHARE = 0.02
_LEAST_FORCE, _LEAST_ROLL_MOMENT = 1e-3, 1e-3
_TIMES_NOISE = 3.0
_MOVING = 0.2
_LEAST_MOVING = 0.5
# What balances an input in steady motion: of which velocity, and by which coefficient.
_BALANCED = {"surge_force": ("u", "X_u|u|"), "roll_moment": ("p", "K_p|p|")}
_LEAST_PER_TIME_CONSTANT, _GOOD_PER_TIME_CONSTANT = 1.0, 2.0


def excitation_checks(dataset: Dataset, signals: Signals) -> list[Check]:
    """Judge RMS and peak of each input, velocity and rate, about its mean; and the share of time under way."""
    of_vehicle = dataset.experiment.vehicle.coefficient_set
    noise = {
        quantity.symbol: record.standard_deviation[component]
        for name, record in dataset.sensors.items()
        for component, quantity in enumerate(SENSORS[name])
    }
    motions = [
        _motion(q, signals.values[q.symbol], noise[q.symbol], of_vehicle) for q in MOTION[:6] if signals.has(q.symbol)
    ]
    moving = {motion.subject for motion in motions if motion.passed}
    checks = [_input(quantity, signals.values[quantity.symbol], moving, of_vehicle) for quantity in INPUTS]
    checks += motions
    if signals.has("u"):
        checks.append(_under_way(signals.values["u"]))
    return checks


def _input(quantity: Quantity, values: Array, moving: Collection[str], of_vehicle: CoefficientSet) -> Check:
    finite, symbol = values[np.isfinite(values)], quantity.symbol
    least = _LEAST_FIN
    if symbol == "surge_force":
        least = max(_LEAST_SHARE * abs(float(finite.mean())), _LEAST_FORCE)
    elif symbol == "roll_moment":
        least = _LEAST_ROLL_MOMENT
    velocity, coefficient = _BALANCED.get(symbol, ("", ""))
    untold = _untold(symbol, of_vehicle, coefficient)
    if abs(float(finite.mean())) >= least:
        how = f"{untold} only by the steady motion that it holds, no better than it and the rest of that are known"
    elif velocity in moving:
        how = f"{coefficient} only by how {velocity} changes of itself"
    else:
        return _channel(quantity, finite, least, f"{symbol} hardly moves: {_cannot_tell(untold)}")
    advice = f"{symbol} hardly moves: these data tell {how} (`auvid identifiability` says how well)."
    return _channel(quantity, finite, least, advice)


def _motion(quantity: Quantity, values: Array, noise: float, of_vehicle: CoefficientSet) -> Check:
    finite = values[np.isfinite(values)]
    untold = (
        "drag, lift and fin forces at one speed only; that is no obstacle, but they are known for this speed."
        if quantity.symbol == "u"
        else _cannot_tell(_untold(quantity.symbol, of_vehicle))
    )
    advice = f"{quantity.symbol} hardly stands out of its noise: {untold}"
    return _channel(quantity, finite, _TIMES_NOISE * noise, advice)


def _channel(quantity: Quantity, values: Array, least: float, advice: str) -> Check:
    scale, unit = (
        (np.rad2deg(1.0), quantity.unit.replace("rad", "deg")) if "rad" in quantity.unit else (1.0, quantity.unit)
    )
    deviation = values - values.mean()
    size, peak = float(np.sqrt(np.mean(deviation**2))), float(np.abs(values).max())
    return judged(
        quantity.symbol,
        "excitation",
        statistic=f"RMS {size * scale:.3g} {unit} about the mean, peak {peak * scale:.3g} {unit}",
        threshold=f">= {least * scale:.2g} {unit}",
        passed=True if size >= least else None,
        advice=advice,
    )


def _untold(symbol: str, of_vehicle: CoefficientSet, *others: str) -> str:
    """Name the coefficients of what a velocity or an input does, and others."""
    name = "thrust" if symbol == "surge_force" else symbol
    return ", ".join(filter(None, (*others, *(c.symbol for c in of_vehicle if name in c.signals))))


def _cannot_tell(untold: str) -> str:
    return f"do not expect {untold} from these data; move it more, or hold them at known values."


def _under_way(values: Array) -> Check:
    u = np.abs(values[np.isfinite(values)])
    usual = float(np.quantile(u, 0.9))
    share = float((u >= _MOVING * usual).mean())
    return judged(
        "u",
        "under way",
        statistic=f"{share:.0%} of the time",
        threshold=f">= {_LEAST_MOVING:.0%} faster than {_MOVING:g} of the usual speed",
        passed=True if share >= _LEAST_MOVING else None,
        advice="For much of the time the vehicle lies still or drifts: cut that out, for the model is of a vehicle "
        "under way.",
    )


def fitness_checks(dataset: Dataset, time_constant: float | None) -> list[Check]:
    """Judge whether each sensor of the motion is fast enough for the vehicle; none if its speed is not known.

    Parameters
    ----------
    dataset : Dataset
    time_constant : float or None
        s, that of a hull: its length over its speed.
    """
    if time_constant is None:
        return []
    checks = []
    symbols = {quantity.symbol for quantity in MOTION}
    for name, record in dataset.sensors.items():
        if symbols & {quantity.symbol for quantity in SENSORS[name]} and record.time.size > 1:
            measurements = new_measurement_rate(record) * time_constant
            good = measurements >= _GOOD_PER_TIME_CONSTANT
            checks.append(
                judged(
                    name,
                    "fast enough",
                    statistic=f"{measurements:.3g} measurements in {time_constant:.3g} s, the vehicle's time constant",
                    threshold=f">= {_GOOD_PER_TIME_CONSTANT:g}; fails below {_LEAST_PER_TIME_CONSTANT:g}",
                    passed=True if good else None if measurements >= _LEAST_PER_TIME_CONSTANT else False,
                    advice=f"The vehicle turns and settles within its length over its speed, and {name} sees too "
                    "little of that: coefficients that differ much fit alike. Log faster, or fly slower.",
                )
            )
    return checks
