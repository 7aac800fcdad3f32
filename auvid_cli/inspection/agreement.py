"""Whether the gyroscope turns as the attitude does: signs, axes, units and scales of both."""

from collections.abc import Mapping

import numpy as np

from auvid_cli.data.check import Check
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.rate_of_change import rate_noise
from auvid_cli.inspection.grid import Signals
from auvid_cli.inspection.inspection import cannot_tell, judged
from auvid_cli.inspection.kinematic_relations import attitude_rates, attitude_window, regress_relation
from auvid_cli.inspection.mistaken_units import mistaken_units
from auvid_cli.inspection.regression import Regression
from auvid_cli.inspection.responses import AXES, RotationAxis, answers, response_check, response_fits, sideslip
from auvid_cli.inspection.single_sensor import ENOUGH_FOR_NOISE, continuous, noise_floor
from auvid_cli.vehicle.parameters import SENSORS

_TOLERANCE = 0.2
_LEAST_CORRELATION = 0.7
# rad/s, of a rate that attitude shows.
_LEAST_SPREAD = np.deg2rad(0.3)
_SIGMAS = 3.0
# How many times what the noise of an angle makes of it a rate must be for that not to hide it.
_TIMES_NOISE = 3.0
_THRESHOLD = f"gain 1 +- {_TOLERANCE}, correlation >= {_LEAST_CORRELATION}"


def rotation_checks(signals: Signals, sensors: Mapping[str, SensorRecord], time_constant: float | None) -> list[Check]:
    """Judge rates against angles about each axis, and the answer to each moment.

    Parameters
    ----------
    signals : Signals
    sensors : mapping of str to SensorRecord
        What they are made of.
    time_constant : float or None
        s, of the vehicle, if it is known.
    """
    checks = []
    for axis in AXES:
        fits = response_fits(signals, axis, time_constant)
        for angle, subject in ((axis.angle, "attitude"), *([("heading", "magnetometer")] if axis.rate == "r" else [])):
            relation = attitude_rates(signals, "heading" if angle == "heading" else "psi").get(axis.rate)
            if relation is not None and signals.has(axis.rate):
                window = signals.window(axis.rate, angle)
                fitted = regress_relation(signals.values[axis.rate], relation.main, relation.others, window)
                noise = _noise_of_rate(signals, sensors, angle, window)
                checks.append(_agreement(axis, angle, subject, fitted, noise, _votes(signals, axis, fits)))
            elif signals.has(axis.rate) or signals.has(angle):
                lacking, known = (axis.rate, subject) if signals.has(angle) else (angle, "gyroscope")
                if lacking != "heading":
                    reason = f"{lacking} is not measured"
                    checks.append(cannot_tell(known, f"{axis.rate} against {angle}", reason, _THRESHOLD))
        checks.append(response_check(signals, axis, fits))
    return checks


def _noise_of_rate(signals: Signals, sensors: Mapping[str, SensorRecord], angle: str, window: int) -> float:
    """Return the standard deviation, rad/s, of what noise of an angle makes of its change, averaged over a window."""
    floor, step = _noise_floor(sensors, angle), signals.grid.step
    half = attitude_window(signals, "heading" if angle == "heading" else "psi") // 2
    return floor * float(np.sqrt(signals.interval[angle] / step)) * rate_noise(step, half, window)


def _noise_floor(sensors: Mapping[str, SensorRecord], symbol: str) -> float:
    """Return the scatter of the first sensor of an angle, rad, as far as it is enough to tell."""
    columns = (
        continuous(record.values[:, component], quantity)
        for name, record in sensors.items()
        for component, quantity in enumerate(SENSORS[name])
        if quantity.symbol == symbol
    )
    values = next(columns)
    return noise_floor(values) if values.size > ENOUGH_FOR_NOISE else 0.0


def _votes(signals: Signals, axis: RotationAxis, fits: dict[str, Regression | None]) -> dict[str, tuple[int, ...]]:
    """Return by sensor what speaks for the sign of its rate, 1, or against it, -1: the answer to the fin, the slip."""
    sideways = {"q": "w", "r": "v"}.get(axis.rate)
    told = [answers(axis, fits)]
    if sideways is not None and signals.has("u", sideways):
        told.append({name: 1 if ahead > 0.0 else -1 for name, ahead in sideslip(signals, sideways).items()})
    return {name: tuple(signs[name] for signs in told if name in signs) for name in fits}


def _agreement(
    axis: RotationAxis,
    angle: str,
    other: str,
    fitted: Regression | None,
    noise: float,
    votes: dict[str, tuple[int, ...]],
) -> Check:
    name = f"{axis.rate} against {angle}"
    if fitted is None or fitted.spread < _LEAST_SPREAD or _is_hidden(fitted, noise):
        turning = "too short" if fitted is None else f"{np.rad2deg(fitted.spread):.2g} deg/s"
        if fitted is not None and fitted.spread >= _LEAST_SPREAD:
            turning += f", of which noise of {angle} makes {np.rad2deg(noise):.2g}"
        return judged(
            "gyroscope",
            name,
            statistic=f"not excited enough to tell: {turning}",
            threshold=_THRESHOLD,
            passed=None,
            advice=f"The vehicle hardly turns about this axis: sign and scale of {axis.rate} and {angle} cannot be "
            "checked.",
        )
    statistic = f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}"
    agrees = fitted.correlation >= _LEAST_CORRELATION and abs(fitted.gain - 1.0) <= _TOLERANCE + _SIGMAS * fitted.error
    # Of two that contradict each other in sign, the one that what the vehicle does contradicts as well.
    by_gyroscope, by_angle = votes.get("gyroscope", ()), votes.get("attitude", ())
    undecided = {*by_gyroscope} == {-1, 1}
    angle_is_wrong = angle == "heading" or (sum(by_angle) < 0 and sum(by_gyroscope) > 0)
    subject = other if fitted.gain < 0.0 and angle_is_wrong and not sum(by_gyroscope) < 0 else "gyroscope"
    return judged(
        subject,
        name,
        statistic=statistic,
        threshold=_THRESHOLD,
        passed=agrees,
        advice=_advice(fitted, axis.rate, angle, "" if undecided else subject),
    )


def _is_hidden(fitted: Regression, noise: float) -> bool:
    """Say whether noise of the angle may be all that makes a gain too small, or hides that the two belong together."""
    by_noise = abs(fitted.correlation) < _LEAST_CORRELATION or 0.0 < fitted.gain < 1.0
    return by_noise and fitted.spread < _TIMES_NOISE * noise


def _advice(fitted: Regression, rate: str, angle: str, subject: str) -> str:
    if abs(fitted.correlation) < _LEAST_CORRELATION:
        return (
            f"{rate} and {angle} do not belong together: axes are exchanged, one of them is delayed or smoothed, or it "
            "does not measure."
        )
    advice = []
    if fitted.gain < 0.0 and not subject:
        advice.append(
            f"The sign of {rate} or that of {angle} is turned. The fin speaks for one and the slip in turns for the "
            "other, so that another sign is turned, too: only what the makers say of their frames tells the vehicle "
            "from its mirror image."
        )
    elif fitted.gain < 0.0:
        wrong = rate if subject == "gyroscope" else angle
        advice.append(
            f"The sign of {wrong} is turned, or its axes are those of another frame (x forward, y starboard, z down)."
        )
    size = abs(fitted.gain)
    if abs(size - 1.0) > _TOLERANCE:
        advice.append(
            mistaken_units(size, (rate, "rad/s"), (angle, "rad"))
            or f"{rate} is {size:.3g} times what {angle} says: look at units and scales, and whether one axis is meant."
        )
    return " ".join(advice) or "Do not use both before it is clear which is right."
