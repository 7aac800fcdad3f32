"""Excitation of inputs and motion, sensor rates, sizes of inputs, and actuators at their limits."""

from collections.abc import Collection

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset, InputRecord
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_relations import Signals, derivative
from auvid_cli.inspection.timing import new_measurement_rate
from auvid_cli.text import degrees_for
from auvid_cli.vehicle.coefficients import CoefficientSet
from auvid_cli.vehicle.parameters import IDEAL, INPUTS, MOTION, SENSORS, Actuator, Actuators, Quantity

_MIN_FIN = np.deg2rad(1.0)  # rad, RMS
_ROUNDING = 1e-9  # ratio of a deviation to the peak below which it is rounding
_MIN_THRUST_SHARE = 0.02  # RMS as a share of the mean
_MIN_THRUST = 1e-3  # N, RMS
_MIN_ROLL_MOMENT = 1e-3  # N m, RMS
_MIN_NOISE_RATIO = 3.0  # ratio of a motion to the noise of its sensor
_MOVING_SHARE = 0.2  # share of the usual speed from which the vehicle is under way
_MIN_MOVING_TIME = 0.5  # share of the time
# By input: velocity whose damping balances it in steady motion, and the coefficient.
_BALANCED = {"surge_force": ("u", "X_u|u|"), "roll_moment": ("p", "K_p|p|")}
_MIN_MEASUREMENTS = 1.0  # measurements per time constant of the vehicle; fewer fail
_GOOD_MEASUREMENTS = 2.0  # measurements per time constant of the vehicle; fewer are noted
# Ratio of an input to a reference. Thrust: the drag of a disc of the hull's diameter (a streamlined hull has about a
# tenth of it) plus the inertia. Roll moment: weight times radius.
_USUAL_RATIO = (3e-3, 10.0)
_POSSIBLE_RATIO = (1e-4, 100.0)
_REACHED_QUANTILE = 0.9
_MIN_SPEED = 0.05  # m/s
_MIN_DRIVEN_SPEED = 0.3  # m/s; a slower vehicle may drift
_KEPT_SPEED = 0.5  # ratio of the mean speeds of both halves; a vehicle without thrust is slower in the second
_MAX_THRUST_CORRELATION = 0.95  # with n |n|; a higher one means that thrust was computed from revolutions
_MAX_FIN = 0.5 * np.pi
_MAX_LIMITED_TIME = 0.01  # share of the time


def excitation_checks(dataset: Dataset, signals: Signals) -> list[Check]:
    """Check RMS and peak of each input, velocity and rate, and the share of time under way."""
    coefficients = dataset.experiment.vehicle.coefficient_set
    noise = {
        quantity.symbol: record.standard_deviation[component]
        for name, record in dataset.sensors.items()
        for component, quantity in enumerate(SENSORS[name])
    }
    motions = [
        _motion(q, signals.values[q.symbol], noise[q.symbol], coefficients) for q in MOTION[:6] if signals.has(q.symbol)
    ]
    moving = {motion.subject for motion in motions if motion.passed}
    checks = [_input(quantity, signals.values[quantity.symbol], moving, coefficients) for quantity in INPUTS]
    checks += motions
    if signals.has("u"):
        checks.append(_under_way(signals.values["u"]))
    return checks


def _input(quantity: Quantity, values: Array, moving: Collection[str], coefficients: CoefficientSet) -> Check:
    finite, symbol = values[np.isfinite(values)], quantity.symbol
    least = _MIN_FIN
    if symbol == "surge_force":
        least = max(_MIN_THRUST_SHARE * abs(float(finite.mean())), _MIN_THRUST)
    elif symbol == "roll_moment":
        least = _MIN_ROLL_MOMENT
    velocity, coefficient = _BALANCED.get(symbol, ("", ""))
    affected = _affected(symbol, coefficients, coefficient)
    if abs(float(finite.mean())) >= least:
        source = f"{affected} only from the steady motion, as accurately as the other forces in it are known"
    elif velocity in moving:
        source = f"{coefficient} only from the free change of {velocity}"
    else:
        return _channel(quantity, finite, least, f"{symbol} hardly moves: {_unobservable(affected)}")
    advice = f"{symbol} hardly moves: these data show {source}. Run `auvid identifiability` to see how well."
    return _channel(quantity, finite, least, advice)


def _motion(quantity: Quantity, values: Array, noise: float, coefficients: CoefficientSet) -> Check:
    consequence = (
        "drag, lift and fin forces will be known for one speed only. If you need others, vary it in the next log."
        if quantity.symbol == "u"
        else _unobservable(_affected(quantity.symbol, coefficients))
    )
    advice = f"{quantity.symbol} is hardly larger than its noise: {consequence}"
    return _channel(quantity, values[np.isfinite(values)], _MIN_NOISE_RATIO * noise, advice)


def _channel(quantity: Quantity, values: Array, least: float, advice: str) -> Check:
    scale, unit = degrees_for(quantity.unit)
    deviation = values - values.mean()
    size, peak = float(np.sqrt(np.mean(deviation**2))), float(np.abs(values).max())
    # The mean of equal numbers is rounded.
    size = size if size > _ROUNDING * peak else 0.0
    return judged(
        quantity.symbol,
        "excitation",
        statistic=f"RMS {size * scale:.3g} {unit} about the mean, peak {peak * scale:.3g} {unit}",
        threshold=f">= {least * scale:.2g} {unit}",
        passed=True if size >= least else None,
        advice=advice,
    )


def _affected(symbol: str, coefficients: CoefficientSet, *others: str) -> str:
    """Return the coefficients that depend on a velocity or an input, after `others`."""
    name = "thrust" if symbol == "surge_force" else symbol
    return ", ".join(filter(None, (*others, *(c.symbol for c in coefficients if name in c.signals))))


def _unobservable(coefficients: str) -> str:
    return (
        f"these data may not determine {coefficients}. Run `auvid identifiability`; leave those that are not "
        "identified out of `identification.coefficients` (they stay at the values of the vehicle file), or move it "
        "more in the next log."
    )


def _under_way(values: Array) -> Check:
    u = np.abs(values[np.isfinite(values)])
    usual = float(np.quantile(u, 0.9))
    share = float((u >= _MOVING_SHARE * usual).mean())
    return judged(
        "u",
        "under way",
        statistic=f"{share:.0%} of the time",
        threshold=f">= {_MIN_MOVING_TIME:.0%} of the time faster than {_MOVING_SHARE:.0%} of the usual speed",
        passed=True if share >= _MIN_MOVING_TIME else None,
        advice="The vehicle rests or drifts for much of the time. Leave that time out (`--use`): the model is that of "
        "a vehicle under way.",
    )


def fitness_checks(dataset: Dataset, time_constant: float | None) -> list[Check]:
    """Check that each motion sensor is fast enough for the vehicle; none without a known time constant, s."""
    if time_constant is None:
        return []
    checks = []
    symbols = {quantity.symbol for quantity in MOTION}
    for name, record in dataset.sensors.items():
        if symbols & {quantity.symbol for quantity in SENSORS[name]} and record.time.size > 1:
            measurements = new_measurement_rate(record) * time_constant
            passed = None if measurements >= _MIN_MEASUREMENTS else False
            checks.append(
                judged(
                    name,
                    "fast enough",
                    statistic=f"{measurements:.3g} measurements in {time_constant:.3g} s, the vehicle's time constant",
                    threshold=f">= {_GOOD_MEASUREMENTS:g}; fails below {_MIN_MEASUREMENTS:g}",
                    passed=True if measurements >= _GOOD_MEASUREMENTS else passed,
                    advice=f"The vehicle responds within its time constant (length over speed), and {name} measures "
                    "too little of that: very different coefficients fit equally well. In the next log, record it "
                    "faster or go slower.",
                )
            )
    return checks


def force_checks(signals: Signals, vehicle: VehicleSettings) -> list[Check]:
    """Check the sizes of fin angles, thrust and roll moment, unless they are always zero."""
    parameters, size = vehicle.known_parameters(), vehicle.size
    checks = [_fin(signals, symbol) for symbol in ("rudder", "elevator")]
    if signals.has("u") and _reached(signals.values["u"]) > _MIN_SPEED:
        u = signals.values["u"]
        resistance = 0.5 * size.density * 0.25 * np.pi * size.diameter**2 * _reached(u) ** 2
        inertia = parameters["m"] * _reached(derivative(u, signals.grid.step))
        reference = "drag of a disc of the hull's diameter plus inertia"
        checks.append(_size(signals, "surge_force", "N", resistance + inertia, reference))
    weight = 0.5 * parameters["W"] * size.diameter
    checks.append(_size(signals, "roll_moment", "N m", weight, "weight times radius", 0.0))
    return [check for check in checks if check is not None]


def missing_thrust_check(signals: Signals, coefficients: CoefficientSet) -> list[Check]:
    """Check that a vehicle without thrust slows down, unless terms of its own drive it."""
    if _largest(signals, "surge_force") or not signals.has("u") or any(t.row == 0 for t in coefficients.of_propulsion):
        return []
    u = np.abs(signals.values["u"])
    u = u[np.isfinite(u)]
    first, second = (float(half.mean()) for half in np.array_split(u, 2)) if u.size > 1 else (0.0, 0.0)
    if first < _MIN_DRIVEN_SPEED:
        return []
    return [
        judged(
            "surge_force",
            "thrust",
            statistic=f"always zero, but {first:.3g} m/s in the first half and {second:.3g} m/s in the second",
            threshold=f"not zero, or at most {_KEPT_SPEED:.0%} of the speed in the second half",
            passed=second <= _KEPT_SPEED * first,
            advice="No thrust is recorded, but the vehicle keeps its speed: the drag would be wrong. State the thrust, "
            "even a guess, in the map (`inputs: {surge_force: {constant: 10 N}}`), and estimate its error "
            "(`identification: {estimate: {biases: [thrust]}}`). Ignore this for a vehicle that has no propeller.",
        )
    ]


def doubled_thrust_check(inputs: InputRecord, coefficients: CoefficientSet) -> list[Check]:
    """Check that thrust computed from revolutions does not act next to terms of the revolutions."""
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
            threshold=f"<= {_MAX_THRUST_CORRELATION:g}",
            passed=None if alike > _MAX_THRUST_CORRELATION else True,
            advice=f"The thrust was computed from the revolutions, and the terms {', '.join(names)} add a force from "
            "them: it counts twice, and neither part is observable. Remove the thrust from the map or these terms from "
            "`vehicle.terms`.",
        )
    ]


def _fin(signals: Signals, symbol: str) -> Check | None:
    largest = _largest(signals, symbol)
    if not largest:
        return None
    return judged(
        symbol,
        "deflection",
        statistic=f"up to {np.rad2deg(largest):.3g} deg",
        threshold="<= 90 deg",
        passed=largest <= _MAX_FIN,
        advice="No fin turns that far: check its `unit`, or `centre` and `scale`, in the map.",
    )


def _size(
    signals: Signals, symbol: str, unit: str, usual: float, reference: str, least: float | None = None
) -> Check | None:
    """Check an input against a reference, `usual`, in its unit; `least` replaces the lower limits of the ratio."""
    if not _largest(signals, symbol):
        return None
    reached = _reached(signals.values[symbol])
    ratio = reached / usual

    def within(limits: tuple[float, float]) -> bool:
        return (limits[0] if least is None else least) <= ratio <= limits[1]

    passed = True if within(_USUAL_RATIO) else None if within(_POSSIBLE_RATIO) else False
    low, high = (limit * usual for limit in _USUAL_RATIO)
    return judged(
        symbol,
        "size",
        statistic=f"{reached:.3g} {unit}",
        threshold=f"{low if least is None else least:.2g} to {high:.2g} {unit}; {reference}: {usual:.2g} {unit}",
        passed=passed,
        advice=f"{symbol} is {ratio:.2g} times the {reference}. Check its unit, and how it was computed from the "
        "propeller (revolutions in rpm, percent, N or kgf).",
    )


def _largest(signals: Signals, symbol: str) -> float:
    return float(np.nanmax(np.abs(signals.values[symbol]), initial=0.0))


def _reached(values: Array) -> float:
    """Return the size that is exceeded in a tenth of the time."""
    sizes = np.abs(values[np.isfinite(values)])
    return float(np.quantile(sizes, _REACHED_QUANTILE)) if sizes.size else 0.0


def actuator_checks(inputs: InputRecord, actuators: Actuators) -> list[Check]:
    """Check how often commands are beyond the limits of the actuators."""
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
    limited = any(share > _MAX_LIMITED_TIME for share in shares.values())
    return judged(
        quantity.symbol,
        "actuator limits",
        statistic=", ".join(f"{share:.1%} of the time {what}" for what, share in shares.items()) or "never reached",
        threshold=f"<= {_MAX_LIMITED_TIME:.0%} of the time each",
        passed=None if limited else True,
        advice="At these times the actuator does not follow its command, and coefficients depend on its limits: check "
        "them (`vehicle.actuators`).",
    )
