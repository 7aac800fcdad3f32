"""Where the rudder stands on a straight course: by what a log has of it, off the middle where its zero is."""

from typing import NamedTuple

import numpy as np

from auvid_cli.data.check import Check
from auvid_cli.data.rate_of_change import response_to_rates
from auvid_cli.inspection.fin_answers import answer_by_steps, by_steps
from auvid_cli.inspection.grid import Signals, change
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_relations import attitude_window, rates_by_sensor
from auvid_cli.inspection.regression import fit
from auvid_cli.inspection.responses import AXES, answer_window, moment
from auvid_cli.inspection.small_motion import SmallMotion

# rad, of a fin in the middle; standard deviations by which it is off that.
_USUAL, _SIGMAS = np.deg2rad(0.5), 5.0
# Share of what a constant rudder would do that must go with no turning: less is of a course that is hardly ever
# straight, or turns to one side only.
_LEAST_SHARE = 0.9
# rad: where the vehicle lies over by more, as by the torque of its propeller, its elevator turns it as well.
_LEVEL = np.deg2rad(2.0)
_YAW = AXES[2]


class RudderTrim(NamedTuple):
    """What the rudder stands on a straight course, rad, and its standard error."""

    angle: float
    error: float

    @property
    def is_off(self) -> bool:
        """Say whether it is off the middle beyond doubt, and by more than a little."""
        return abs(self.angle) > _USUAL + _SIGMAS * self.error


def rudder_trim(signals: Signals, motion: SmallMotion | None, time_constant: float | None) -> RudderTrim | None:
    """Find what of the rudder goes with no turning: the vehicle and its mirror image turn alike.

    Parameters
    ----------
    signals : Signals
        With inputs where they belong in time.
    motion : SmallMotion or None
        Of the vehicle file, by which the rudder is averaged over the time in which it acts.
    time_constant : float or None
        s, of the vehicle.

    Returns
    -------
    RudderTrim or None
        None where the rudder does not move, the vehicle lies over, or the data hardly have a straight course or turns
        to either side. The turning is that of the heading: a gyroscope's bias would be taken for a turn.
    """
    turns = moment(signals, _YAW)
    rates = {name: rate for name, rate in rates_by_sensor(signals, _YAW.rate).items() if name != "gyroscope"}
    if turns is None or not rates or _lies_over(signals):
        return None
    ((name, rate),) = rates.items()
    window = answer_window(signals, _YAW, time_constant)
    half = attitude_window(signals, "psi" if name == "attitude" else "heading") // 2
    steps = answer_by_steps(signals, _YAW, motion, window)
    per_angle = signals.values["u"] ** 2 if signals.has("u") else np.ones(signals.grid.cells)
    given, per_angle, before = (
        response_to_rates(each, signals.grid.step, half)
        for each in (by_steps(turns, steps), by_steps(per_angle, steps), rate)
    )
    beside = [change(rate, window), before, np.abs(before) * before]
    fitted = fit(given, per_angle, beside, window, constant=False)
    if fitted is None or not fitted.spread**2 >= _LEAST_SHARE * np.nanmean(per_angle**2):
        return None
    return RudderTrim(fitted.gain, fitted.error)


def _lies_over(signals: Signals) -> bool:
    roll = signals.values.get("phi", np.zeros(1))
    known = roll[np.isfinite(roll)]
    return bool(known.size) and abs(float(known.mean())) > _LEVEL


def rudder_trim_checks(found: RudderTrim | None) -> list[Check]:
    """Judge it, where the data tell it to a degree."""
    if found is None or _SIGMAS * found.error > 2.0 * _USUAL:
        return []
    stands, unsure = np.rad2deg(found)
    return [
        judged(
            "rudder",
            "trim",
            statistic=f"{stands:.2f} +- {unsure:.1g} deg on a straight course",
            threshold=f"<= {np.rad2deg(_USUAL):.2g} deg",
            passed=None if found.is_off else True,
            advice=f"The vehicle goes straight with its rudder at {found.angle:.3g} rad as it is recorded: its zero is "
            "off, the hull is bent, or it lies over. State the `centre` or `offset` in the map, or estimate it "
            "(`identification.estimate.biases: [fin_trim]`).",
        )
    ]
