"""Excitation of the coefficients, forces in the record, and actuators at their limits."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset, InputRecord
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_relations import Signals, derivative
from auvid_cli.inspection.timing import new_measurement_rate
from auvid_cli.vehicle.actuators import IDEAL, Actuator, Actuators
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
# Of the time, above which what is lost of the commands is worth a note.
_WORTH_A_NOTE = 0.01


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
    """Judge the size of an input; `smallest` stands for the lower limits where little is nothing doubtful."""
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


def actuator_checks(inputs: InputRecord, actuators: Actuators) -> list[Check]:
    """Say for how long commands are within a dead band, saturate, outrun a rate limit or stall a fin."""
    return [
        _limits(INPUTS[column], inputs.time, inputs.values[:, column], actuator)
        for column, actuator in enumerate(actuators)
        if actuator != IDEAL
    ]


def _limits(quantity: Quantity, time: Array, commands: Array, actuator: Actuator) -> Check:
    lengths = np.diff(time, append=time[-1] + (time[-1] - time[-2] if time.size > 1 else 1.0))
    size = np.abs(commands)
    steps = np.abs(np.diff(commands, append=commands[-1]))
    times = {
        "beyond the saturation": size > actuator.saturation,
        "faster than the rate limit": steps > actuator.rate_limit * lengths,
        "beyond the stall": np.minimum(size, actuator.saturation) - actuator.dead_band > actuator.stall,
        "within the dead band": (size > 0.0) & (size <= actuator.dead_band),
    }
    shares = {what: float(lengths[when].sum() / lengths.sum()) for what, when in times.items() if when.any()}
    much = any(share > _WORTH_A_NOTE for share in shares.values())
    return judged(
        quantity.symbol,
        "actuator limits",
        statistic=", ".join(f"{share:.1%} of the time {what}" for what, share in shares.items()) or "never reached",
        threshold=f"<= {_WORTH_A_NOTE:.0%} of the time each",
        passed=None if much else True,
        advice="What is commanded there does not act as it is commanded (`vehicle.actuators`): such times tell "
        "coefficients only as far as those limits are right.",
    )
