"""How far the DVL sits from the accelerometer along the hull."""

from auvid_cli.data.check import Check
from auvid_cli.inspection.grid import Signals, smoothed
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_relations import Relation, lever_arm_acceleration, rates_by_sensor
from auvid_cli.inspection.regression import fit

# m
_USUAL = 0.15
_SIGMAS = 3.0
_SOURCES = (("v", "fy", "r"), ("w", "fz", "q"))


def lever_arm_checks(signals: Signals, forces: dict[str, Relation], accelerometer_ahead: float = 0.0) -> list[Check]:
    """Judge the distance along the hull by v in yaw and by w in pitch, where either tells.

    A DVL that sits ahead by x measures ``v + x r`` and ``w - x q``, whose change contains what the accelerometer does
    not feel. Without one the arm could not be told from the drift of a hull in a turn, which is proportional to the
    turn rate as well.

    Parameters
    ----------
    signals : Signals
    forces : dict of Relation
        Of `kinematic_relations.measured_forces`.
    accelerometer_ahead : float
        m, by which the accelerometer is stated to sit ahead of the origin.
    """
    arms = {}
    for symbol, force, rate in _SOURCES:
        window = signals.window(symbol, force, rate, "psi")
        turning = next(iter(rates_by_sensor(signals, rate).values()))
        lacking = forces[symbol].total() - signals.values[force]
        # A scale of u that is wrong shows in u times the rate.
        lacking, swing, carried = (
            smoothed(each, window)
            for each in (lacking, lever_arm_acceleration(signals)[symbol], signals.values["u"] * turning)
        )
        arm = fit(lacking, swing, [carried], window)
        if arm is not None and arm.error < _USUAL / _SIGMAS:
            is_far = abs(arm.gain + accelerometer_ahead) > _USUAL + _SIGMAS * arm.error
            arms[f"{arm.gain:+.2f} +- {arm.error:.2g} m by {symbol} and {rate}"] = not is_far
    if not arms:
        return []
    return [
        judged(
            "dvl",
            "lever arm",
            statistic=f"ahead of the accelerometer by {', '.join(arms)}",
            threshold=f"<= {_USUAL:g} m",
            passed=all(arms.values()) or None,
            advice="DVL and accelerometer sit apart, so one of them is not at the origin of the model: state its place "
            "(`position` in the map).",
        )
    ]
