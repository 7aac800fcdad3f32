"""Velocity against other sensors: speed, signs, heading offset, lever arm."""

import numpy as np

from auvid_cli.data.checks import Check
from auvid_cli.inspection import depth, responses
from auvid_cli.inspection.depth import MIN_SPREAD
from auvid_cli.inspection.inspection import judged, suggested_units, undetermined
from auvid_cli.inspection.kinematic_relations import (
    Relation,
    Signals,
    diving_speed,
    fit,
    lever_arm_acceleration,
    measured_depth_rate,
    measured_forces,
    rates_by_sensor,
    regress_relation,
    smoothed,
)
from auvid_cli.inspection.responses import Current

_UNDER_WAY_SHARE = 0.2  # share of the usual speed from which the vehicle is under way
_MIN_SPEED = 0.05  # m/s
_MAX_SPEED = 15.0  # m/s
_MAX_SIDEWAYS_SHARE = 0.5  # largest v or w as a share of u
_MAX_FORCE_GAIN = 3.0  # an accelerometer checks signs and units, not scales
_MAX_ARM = 0.15  # m, between DVL and accelerometer
_ARM_SIGMAS = 3.0
_ARM_SOURCES = (("v", "fy", "r"), ("w", "fz", "q"))  # symbols of velocity, specific force and turn rate
_MAX_HEADING_OFFSET = np.deg2rad(2.0)
_MAX_CANCELLED = 2.0  # ratio of the sway that a heading offset explains to all sway, RMS
_MAX_DVL_AHEAD = 0.25  # lengths of the vehicle, from its pivot point to a DVL near the nose


def velocity_checks(
    signals: Signals, length: float, time_constant: float | None, accelerometer_ahead: float = 0.0
) -> list[Check]:
    """Check the DVL and everything that depends on it; if the velocities are implausible, nothing else is checked.

    Parameters
    ----------
    signals : Signals
    length : float
        Length of the vehicle, m.
    time_constant : float or None
        Time constant of the vehicle, s, if known.
    accelerometer_ahead : float
        Stated distance of the accelerometer ahead of the origin, m.
    """
    if not signals.has("u"):
        return []
    speed = _speed(signals)
    if speed.passed is False:
        return [speed]
    checks, forces, offset = [speed], measured_forces(signals), None
    dive = diving_speed(signals) if signals.has("down") else None
    if dive is not None:
        offset = depth.offset_by_depth(signals, dive)
        of_depth = depth.depth_check(signals, dive, offset)
        checks.append(of_depth)
        # A failed depth is not evidence against other sensors.
        dive = None if of_depth.passed is False else dive
    elif signals.has("down"):
        checks.append(undetermined("depth", depth.DEPTH_NAME, "theta is not measured", depth.DEPTH_THRESHOLD))
    if forces:
        checks.append(against_force(signals, "u", forces["u"]))
    if dive is not None:
        checks.append(depth.scale_check(signals, dive))
    current = responses.estimate_current(signals)
    directions = [_direction(signals, s, forces, dive, current, length) for s in ("v", "w") if signals.has(s)]
    checks += directions
    if dive is not None and offset is not None:
        checks.append(depth.pitch_offset_check(offset, "depth rate"))
    elif forces and (offset := depth.offset_by_gravity(signals, forces["u"])) is not None:
        checks.append(depth.pitch_offset_check(offset, "accelerometer"))
    if signals.has("v"):
        checks += [responses.current_check(signals, current), _heading_offset(signals)]
    # A wrong sign looks like a lever arm.
    if forces and all(direction.passed is not False for direction in directions):
        checks += lever_arm_checks(signals, forces, accelerometer_ahead)
    return [*checks, responses.thrust_check(signals, time_constant)]


def mean_speed(signals: Signals) -> float | None:
    """Return the mean surge velocity under way, m/s; None if it was not measured or is zero."""
    if not signals.has("u"):
        return None
    u = np.abs(signals.values["u"])
    u = u[np.isfinite(u)]
    return (float(u[u >= _UNDER_WAY_SHARE * np.quantile(u, 0.9)].mean()) or None) if u.size else None


def _speed(signals: Signals) -> Check:
    size = np.abs(signals.values["u"])
    moving = np.where(size >= _UNDER_WAY_SHARE * np.nanquantile(size, 0.9), 1.0, np.nan)
    measured = {symbol: moving * signals.values[symbol] for symbol in "uvw" if signals.has(symbol)}
    medians = {symbol: float(np.nanmedian(values)) for symbol, values in measured.items() if np.isfinite(values).any()}
    sideways = [float(np.nanmedian(np.abs(measured[symbol]))) for symbol in medians if symbol != "u"]
    is_forwards = all(speed <= _MAX_SIDEWAYS_SHARE * medians["u"] for speed in sideways)
    return judged(
        "dvl",
        "speed",
        statistic=f"median {', '.join(f'{symbol} {median:.3g}' for symbol, median in medians.items())} m/s",
        threshold=f"u {_MIN_SPEED:g} to {_MAX_SPEED:g} m/s; |v|, |w| <= {_MAX_SIDEWAYS_SHARE:g} u",
        passed=_MIN_SPEED <= medians["u"] <= _MAX_SPEED and is_forwards,
        advice="The vehicle does not move forwards at a plausible speed. Check in the map: exchanged axes, signs, the "
        "unit (knots, mm/s), the mounting angle of the DVL, and whether velocities are in body axes. Checks that need "
        "them were skipped.",
    )


def against_force(signals: Signals, symbol: str, relation: Relation) -> Check:
    """Check the sign and the order of magnitude of u, v or w with the accelerometer."""
    window = signals.window(symbol, f"f{'xyz'['uvw'.index(symbol)]}")
    force = signals.values[f"f{'xyz'['uvw'.index(symbol)]}"]
    moved = regress_relation(force, relation.main, relation.others, window)
    # With a lever arm between the sensors, rotation accelerates one of them.
    arm = [swing for other, swing in lever_arm_acceleration(signals).items() if other == symbol]
    fitted = regress_relation(force, relation.main, (*relation.others, *arm), window)
    name = f"{symbol} against accelerometer"
    threshold = f"gain {1.0 / _MAX_FORCE_GAIN:.2g} to {_MAX_FORCE_GAIN:g}"
    if fitted is None or moved is None or moved.spread < MIN_SPREAD or not responses.known_sign(fitted):
        return _unknown_sign(symbol, name, threshold)
    return judged(
        "dvl",
        name,
        statistic=f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}",
        threshold=threshold,
        passed=1.0 / _MAX_FORCE_GAIN <= fitted.gain <= _MAX_FORCE_GAIN,
        advice=f"{symbol} does not change as the accelerometer measures. Check in the map: its sign, its unit, "
        f"exchanged axes.{suggested_units(fitted.gain, ('the accelerometer', 'm/s^2'), (symbol, 'm/s'))}",
    )


def _direction(
    signals: Signals,
    symbol: str,
    forces: dict[str, Relation],
    dive: Relation | None,
    current: Current | None,
    length: float,
) -> Check:
    """Check the sign of v or w with the best source: depth, accelerometer, or the slip in turns."""
    if symbol == "w" and dive is not None:
        window = signals.window("down", "w", "theta")
        by_heave, by_sway = dive.others
        fitted = regress_relation(measured_depth_rate(signals), by_heave, (dive.main, by_sway), window)
        if fitted is not None and fitted.spread > MIN_SPREAD and responses.known_sign(fitted):
            return judged(
                "dvl",
                "w against depth",
                statistic=f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}",
                threshold="positive gain",
                passed=fitted.gain > 0.0,
                advice="The depth changes against w: set its `sign: -1` in the map (positive down).",
            )
    if forces:
        against = against_force(signals, symbol, forces[symbol])
        if against.passed is not None:
            return against
    name, outwards = f"{symbol} in a turn", f"{symbol} points out of the turn"
    pivots = responses.sideslip_pivots(signals, symbol)
    if not pivots:
        return _unknown_sign(symbol, name, outwards)
    ahead = max(pivots.values())
    agrees, drifts = ahead > 0.0, symbol == "v" and current is not None and responses.is_significant(signals, current)
    if not agrees and ahead > -_MAX_DVL_AHEAD * length:
        return judged(
            "dvl",
            name,
            statistic=f"{symbol} points into the turn, as measured {-ahead:.2g} m ahead of the pivot point",
            threshold=outwards,
            passed=None,
            advice="A DVL near the nose measures this: state its `position` in the map, or estimate it "
            "(`identification.estimate.biases: [dvl_arm]`). Otherwise set `sign: -1` of "
            f"{symbol} in the map.",
        )
    return judged(
        "dvl",
        name,
        statistic=(outwards if agrees else f"{symbol} points into the turn") + (", given a current" if drifts else ""),
        threshold=outwards,
        passed=False if not agrees else None if drifts else True,
        advice="A current was subtracted for this check: estimate it (`identification.estimate.biases: [current]`)."
        if agrees
        else "Slender hulls drift out of a turn, more than a DVL near the nose hides: set `sign: -1` of "
        f"{symbol} in the map.",
    )


def _unknown_sign(symbol: str, name: str, threshold: str) -> Check:
    advice = f"The sign of {symbol} was not checked: {symbol} hardly changes, or no other sensor shows it."
    return undetermined("dvl", name, "too little excitation", threshold, advice)


def _heading_offset(signals: Signals) -> Check:
    """Check the angle about z between DVL and hull: sway proportional to surge, given turns and a current."""
    value, rates = signals.values, rates_by_sensor(signals, "r")
    name, threshold = "heading offset", f"<= {np.rad2deg(_MAX_HEADING_OFFSET):.2g} deg"
    if not rates:
        return undetermined("dvl", name, "neither r nor a heading is measured", threshold)
    window, turning = signals.window("u", "v", "r", "psi"), next(iter(rates.values()))
    u, v = value["u"], value["v"]
    # Turns slow the vehicle down to both sides, but may slip differently.
    fitted = regress_relation(v, u, (turning * u, np.abs(turning) * u, *responses.carried_sideways(signals)), window)
    if fitted is None or not fitted.error < 0.5 * np.tan(_MAX_HEADING_OFFSET):
        advice = "A rotation of the DVL against the hull was not checked: the speed hardly changes apart from turns."
        return undetermined("dvl", name, "too little excitation", threshold, advice)
    known = np.isfinite(u) & np.isfinite(v)
    if abs(fitted.gain) * np.sqrt(np.mean(u[known] ** 2)) > _MAX_CANCELLED * np.sqrt(np.mean(v[known] ** 2)):
        # Slip in steady turns is proportional to surge as well; a large v cannot come from a small one.
        advice = "A rotation of the DVL against the hull was not checked: it cannot be separated from slip in turns."
        return undetermined(
            "dvl", name, f"v is too small for {np.rad2deg(np.arctan(fitted.gain)):.2g} deg", threshold, advice
        )
    return judged(
        "dvl",
        name,
        statistic=f"{np.rad2deg(np.arctan(fitted.gain)):.2g} deg",
        threshold=threshold,
        passed=True if abs(fitted.gain) <= np.tan(_MAX_HEADING_OFFSET) else None,
        advice="Sway is proportional to surge: the DVL may be rotated against the hull by this angle. Estimate it "
        "(`identification.estimate.biases: [dvl]`).",
    )


def lever_arm_checks(signals: Signals, forces: dict[str, Relation], accelerometer_ahead: float = 0.0) -> list[Check]:
    """Check the distance along the hull between DVL and accelerometer, by v in yaw and w in pitch.

    A DVL at a distance x ahead measures ``v + x r`` and ``w - x q``; the accelerometer does not measure the change of
    the second terms. Without it, the arm is confounded with the slip of the hull, which is proportional to the turn
    rate too. `forces` are `measured_forces`; `accelerometer_ahead` is its stated distance ahead of the origin, m.
    """
    arms = {}
    for symbol, force, rate in _ARM_SOURCES:
        window = signals.window(symbol, force, rate, "psi")
        turning = next(iter(rates_by_sensor(signals, rate).values()))
        unexplained = forces[symbol].total() - signals.values[force]
        # A wrong scale of u adds a part proportional to u times the rate.
        terms = (unexplained, lever_arm_acceleration(signals)[symbol], signals.values["u"] * turning)
        unexplained, swing, scale = (smoothed(term, window) for term in terms)
        arm = fit(unexplained, swing, [scale], window)
        if arm is not None and arm.error < _MAX_ARM / _ARM_SIGMAS:
            is_far = abs(arm.gain + accelerometer_ahead) > _MAX_ARM + _ARM_SIGMAS * arm.error
            arms[f"{arm.gain:+.2f} +- {arm.error:.2g} m by {symbol} and {rate}"] = not is_far
    if not arms:
        return []
    return [
        judged(
            "dvl",
            "lever arm",
            statistic=f"ahead of the accelerometer by {', '.join(arms)}",
            threshold=f"<= {_MAX_ARM:g} m",
            passed=all(arms.values()) or None,
            advice="DVL and accelerometer are apart, so at least one is not at the origin of the model: state its "
            "place (`position` in the map).",
        )
    ]
