"""Whether the gyroscope turns as the attitude does: signs, axes, units and scales of both."""

import numpy as np

from auvid_cli.data.check import Check
from auvid_cli.inspection.grid import Signals
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_ties import attitude_rates, tied
from auvid_cli.inspection.mistaken_units import mistaken_units
from auvid_cli.inspection.regression import Regression
from auvid_cli.inspection.responses import AXES, RotationAxis, answers, response_check, response_fits

_TOLERANCE = 0.2
_LEAST_CORRELATION = 0.7
# rad/s, of a rate that attitude shows.
_LEAST_SPREAD = np.deg2rad(0.3)
_SIGMAS = 3.0


def rotation_checks(signals: Signals, time_constant: float | None) -> list[Check]:
    """Judge rates against angles about each axis, and the answer to each moment."""
    checks = []
    for axis in AXES:
        fits = response_fits(signals, axis, time_constant)
        for angle, subject in ((axis.angle, "attitude"), *([("heading", "magnetometer")] if axis.rate == "r" else [])):
            rates = attitude_rates(signals, "heading" if angle == "heading" else "psi")
            if rates and signals.has(axis.rate):
                tie = rates[axis.rate]
                window = signals.window(axis.rate, angle)
                fitted = tied(signals.values[axis.rate], tie.main, tie.others, window)
                checks.append(_agreement(axis, angle, subject, fitted, answers(axis, fits)))
        if fits:
            checks.append(response_check(axis, fits))
    return checks


def _agreement(axis: RotationAxis, angle: str, other: str, fitted: Regression | None, signs: dict[str, int]) -> Check:
    name, threshold = f"{axis.rate} against {angle}", f"gain 1 +- {_TOLERANCE}, correlation >= {_LEAST_CORRELATION}"
    if fitted is None or fitted.spread < _LEAST_SPREAD:
        turning = "too short" if fitted is None else f"{np.rad2deg(fitted.spread):.2g} deg/s"
        return judged(
            "gyroscope",
            name,
            statistic=f"not excited enough to tell: {turning}",
            threshold=threshold,
            passed=None,
            advice=f"The vehicle hardly turns about this axis: sign and scale of {axis.rate} and {angle} cannot be "
            "checked.",
        )
    statistic = f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}"
    agrees = fitted.correlation >= _LEAST_CORRELATION and abs(fitted.gain - 1.0) <= _TOLERANCE + _SIGMAS * fitted.error
    # Of two that contradict each other in sign, the one whose answer to the input is wrong as well.
    angle_is_wrong = angle == "heading" or (signs.get("attitude") == -1 and signs.get("gyroscope") == 1)
    subject = other if fitted.gain < 0.0 and angle_is_wrong and signs.get("gyroscope") != -1 else "gyroscope"
    return judged(
        subject,
        name,
        statistic=statistic,
        threshold=threshold,
        passed=agrees,
        advice=_advice(fitted, axis.rate, angle, subject),
    )


def _advice(fitted: Regression, rate: str, angle: str, subject: str) -> str:
    if abs(fitted.correlation) < _LEAST_CORRELATION:
        return (
            f"{rate} and {angle} do not belong together: axes are exchanged, one of them is delayed or smoothed, or it "
            "does not measure."
        )
    advice = []
    if fitted.gain < 0.0:
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
