"""Checks of the velocity sensor: scale, lever arm, axes and units."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import Check
from auvid_cli.inspection.agreement import (
    PitchOffset,
    fit_over_seconds,
    mistaken_units,
    offset_by_depth,
    offset_by_gravity,
    pitch_offset_check,
)
from auvid_cli.inspection.inspection import cannot_tell, judged
from auvid_cli.inspection.kinematic_relations import (
    Regression,
    Relation,
    Signals,
    change,
    diving_speed,
    fit,
    lever_arm_acceleration,
    measured_depth_rate,
    measured_forces,
    rates_by_sensor,
    regress_relation,
    smoothed,
)
from auvid_cli.inspection.responses import (
    Drift,
    carried_sideways,
    current_check,
    drift,
    is_current,
    known_sign,
    sideslip,
    thrust_check,
)

# m
_USUAL = 0.15
_LEVER_ARM_SIGMAS = 3.0
_SOURCES = (("v", "fy", "r"), ("w", "fz", "q"))
Array = NDArray[np.float64]
# s, over which depth is gained: what averaging and delays make of a rate is then small.
_SPAN = 3.0
# Intervals of depth and pitch in that time, at least: a line between two measurements is flatter than what went on.
_FEWEST = 10
_LARGEST, _LARGEST_ERROR, _SCALE_SIGMAS = 0.01, 0.006, 2.0
_TOLERANCE, _LEAST_CORRELATION, _VELOCITY_SIGMAS = 0.2, 0.7, 3.0
# An accelerometer has its own place and is felt with gravity: of the size only the order.
_LARGEST_FACTOR = 3.0
_LEAST_ACCELERATION, _LEAST_SPEED = 0.02, 0.02
_SLOWEST, _FASTEST, _LARGEST_SLIP = 0.05, 15.0, 0.5
_USUAL_OFFSET = np.deg2rad(2.0)
_UNDER_WAY = 0.2
# Lengths of a vehicle that a DVL may sit ahead of where its hull pivots, which is that far ahead of the middle.
_LONGEST_ARM = 0.25
_DEPTH_NAME = "depth against pitch and u"
_DEPTH_THRESHOLD = f"gain 1 +- {_TOLERANCE}, correlation >= {_LEAST_CORRELATION}"


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
        if arm is not None and arm.error < _USUAL / _LEVER_ARM_SIGMAS:
            is_far = abs(arm.gain + accelerometer_ahead) > _USUAL + _LEVER_ARM_SIGMAS * arm.error
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


def scale_check(signals: Signals, dive: Relation) -> Check:
    """Compare the depth that is gained with what pitch and velocities promise.

    What an offset of pitch adds, u cos(theta) times it, stands beside.

    Parameters
    ----------
    signals : Signals
    dive : Relation
        Of `kinematic_relations.diving_speed`.
    """
    name, threshold = "scale by depth", f"1 +- {_LARGEST:g}, where it is known to {_LARGEST_ERROR:g}"
    if max(signals.interval["down"], signals.interval["theta"]) > _SPAN / _FEWEST:
        return cannot_tell("dvl", name, "depth or pitch is measured too seldom", threshold)
    window = signals.window("down", "u", "theta", least=_SPAN)

    def gained(rate: Array) -> Array:
        # A depth is known in the middle of a cell: from one middle to another lie the means of the cells between.
        means = smoothed(rate, window)
        return 0.5 * (means + np.append(means[1:], np.nan))

    beside = signals.values["u"] * np.cos(signals.values["theta"])
    sunk = change(signals.values["down"], window) / (window * signals.grid.step)
    fitted = fit(sunk, gained(dive.total()), [gained(beside)], window)
    if fitted is None or not fitted.error <= _LARGEST_ERROR:
        return cannot_tell("dvl", name, "the vehicle hardly dives, or not for long", threshold)
    away = abs(fitted.gain - 1.0)
    return judged(
        "dvl",
        name,
        statistic=f"depth changes {fitted.gain:.4f} +- {fitted.error:.2g} times as velocity and pitch have it",
        threshold=threshold,
        passed=None if away > max(_LARGEST, _SCALE_SIGMAS * fitted.error) else True,
        advice="One of them is to another scale: a DVL told another speed of sound, or a depth in water of another "
        f"density (salt and fresh differ by 2.7 %). Multiply the velocities by {fitted.gain:.4g} if the depth is right "
        "(`scale` in the map), or find it (`identification.estimate.biases: [dvl]`).",
    )


def velocity_checks(
    signals: Signals, length: float, time_constant: float | None, accelerometer_ahead: float = 0.0
) -> list[Check]:
    """Judge the DVL and what depends on it; where its axes are not even plausible nothing more is said.

    Parameters
    ----------
    signals : Signals
    length : float
        m, of the vehicle.
    time_constant : float or None
        s, of the vehicle, if it is known.
    accelerometer_ahead : float
        m, by which the accelerometer is stated to sit ahead of the origin.
    """
    if not signals.has("u"):
        return []
    speed = _speed(signals)
    if speed.passed is False:
        return [speed]
    checks, forces, offset = [speed], measured_forces(signals), None
    dive = diving_speed(signals)
    if signals.has("down"):
        if dive is None:
            checks.append(cannot_tell("depth", _DEPTH_NAME, "theta is not measured", _DEPTH_THRESHOLD))
        else:
            offset = offset_by_depth(signals, dive)
            depth = _depth_rate(signals, dive, offset)
            checks.append(depth)
            # A depth that contradicts itself is no witness.
            dive = None if depth.passed is False else dive
    if forces:
        checks.append(against_force(signals, "u", forces["u"]))
    witness = dive if signals.has("down") else None
    if witness is not None:
        checks.append(scale_check(signals, witness))
    found = drift(signals)
    directions = [_direction(signals, s, forces, witness, found, length) for s in ("v", "w") if signals.has(s)]
    checks += directions
    if witness is not None and offset is not None:
        checks.append(pitch_offset_check(offset, "depth rate"))
    elif forces and (offset := offset_by_gravity(signals, forces["u"])) is not None:
        checks.append(pitch_offset_check(offset, "accelerometer"))
    if signals.has("v"):
        checks += [current_check(signals, found), _heading_offset(signals)]
    # A turned sign looks like an arm.
    if forces and all(direction.passed is not False for direction in directions):
        checks += lever_arm_checks(signals, forces, accelerometer_ahead)
    return [*checks, thrust_check(signals, time_constant)]


def mean_speed(signals: Signals) -> float | None:
    """Return the mean surge velocity under way, m/s; None if none was measured, or the vehicle lay still."""
    if not signals.has("u"):
        return None
    u = np.abs(signals.values["u"])
    u = u[np.isfinite(u)]
    return (float(u[u >= _UNDER_WAY * np.quantile(u, 0.9)].mean()) or None) if u.size else None


def _speed(signals: Signals) -> Check:
    size = np.abs(signals.values["u"])
    moving = np.where(size >= _UNDER_WAY * np.nanquantile(size, 0.9), 1.0, np.nan)
    measured = {symbol: moving * signals.values[symbol] for symbol in "uvw" if signals.has(symbol)}
    medians = {symbol: float(np.nanmedian(values)) for symbol, values in measured.items() if np.isfinite(values).any()}
    across = [float(np.nanmedian(np.abs(measured[symbol]))) for symbol in medians if symbol != "u"]
    plausible = _SLOWEST <= medians["u"] <= _FASTEST and all(each <= _LARGEST_SLIP * medians["u"] for each in across)
    return judged(
        "dvl",
        "speed",
        statistic=f"median {', '.join(f'{symbol} {median:.3g}' for symbol, median in medians.items())} m/s",
        threshold=f"u {_SLOWEST:g} to {_FASTEST:g} m/s; |v|, |w| <= {_LARGEST_SLIP:g} u",
        passed=plausible,
        advice="The vehicle does not go forwards by these: axes exchanged, a sign turned, a unit mistaken (knots, "
        "mm/s), a DVL mounted at an angle, or velocity over the earth instead of in body axes. What needs them was not "
        "checked.",
    )


def against_force(signals: Signals, symbol: str, relation: Relation) -> Check:
    """Judge the change of a velocity, of symbol u, v or w, by the accelerometer: sign and order of size."""
    window = signals.window(symbol, f"f{'xyz'['uvw'.index(symbol)]}")
    force = signals.values[f"f{'xyz'['uvw'.index(symbol)]}"]
    moved = regress_relation(force, relation.main, relation.others, window)
    # Where the sensors do not sit together, what turning adds to one of them is no change of velocity.
    apart = [swing for other, swing in lever_arm_acceleration(signals).items() if other == symbol]
    fitted = regress_relation(force, relation.main, (*relation.others, *apart), window)
    name = f"{symbol} against accelerometer"
    threshold = f"gain {1.0 / _LARGEST_FACTOR:.2g} to {_LARGEST_FACTOR:g}"
    if fitted is None or moved is None or moved.spread < _LEAST_ACCELERATION or not known_sign(fitted):
        return _undetermined(symbol, name, threshold)
    return judged(
        "dvl",
        name,
        statistic=f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}",
        threshold=threshold,
        passed=1.0 / _LARGEST_FACTOR <= fitted.gain <= _LARGEST_FACTOR,
        advice=_with_units(
            f"{symbol} does not change as the accelerometer feels it: its sign is turned, its unit mistaken, or its "
            "axis exchanged with another.",
            mistaken_units(fitted.gain, ("the accelerometer", "m/s^2"), (symbol, "m/s")),
        ),
    )


def _direction(
    signals: Signals,
    symbol: str,
    forces: dict[str, Relation],
    dive: Relation | None,
    found: Drift | None,
    length: float,
) -> Check:
    """Judge the sign of v or w by the best witness there is: depth, accelerometer, or the slip in a turn."""
    if symbol == "w" and dive is not None:
        window = signals.window("down", "w", "theta")
        by_heave, by_sway = dive.others
        fitted = regress_relation(measured_depth_rate(signals), by_heave, (dive.main, by_sway), window)
        if fitted is not None and fitted.spread > _LEAST_SPEED and known_sign(fitted):
            return judged(
                "dvl",
                "w against depth",
                statistic=f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}",
                threshold="positive",
                passed=fitted.gain > 0.0,
                advice="The depth changes against w: turn the sign of w (positive down).",
            )
    if forces:
        against = against_force(signals, symbol, forces[symbol])
        if against.passed is not None:
            return against
    name, outwards = f"{symbol} in a turn", f"{symbol} points out of the turn"
    pivots = sideslip(signals, symbol)
    if not pivots:
        return _undetermined(symbol, name, outwards)
    ahead = max(pivots.values())
    agrees, drifts = ahead > 0.0, symbol == "v" and found is not None and is_current(signals, found)
    if not agrees and ahead > -_LONGEST_ARM * length:
        return judged(
            "dvl",
            name,
            statistic=f"{symbol} points into the turn, as {-ahead:.2g} m ahead of where the hull pivots",
            threshold=outwards,
            passed=None,
            advice=f"A DVL near the nose would see this (state its `position` in the map, or estimate "
            f"identification.estimate.biases: [dvl_arm]); or the sign of {symbol} is turned.",
        )
    return judged(
        "dvl",
        name,
        statistic=(outwards if agrees else f"{symbol} points into the turn") + (" beside a current" if drifts else ""),
        threshold=outwards,
        passed=False if not agrees else None if drifts else True,
        advice="What a current carries along was taken off: estimate it, before this is relied on."
        if agrees
        else f"Slender hulls drift outwards, more than a DVL near the nose hides: turn the sign of {symbol}.",
    )


def _undetermined(symbol: str, name: str, threshold: str) -> Check:
    return judged(
        "dvl",
        name,
        statistic="not excited enough to tell",
        threshold=threshold,
        passed=None,
        advice=f"{symbol} hardly changes, or nothing witnesses it: its sign cannot be checked on these data.",
    )


def _depth_rate(signals: Signals, dive: Relation, offset: PitchOffset | None) -> Check:
    """Judge depth rate against pitch and surge; an offset of pitch, which may come and go, is no fault."""
    window = signals.window("down", "u", "theta")
    fitted: Regression | None = regress_relation(measured_depth_rate(signals), dive.main, dive.others, window)
    if fitted is None or fitted.spread < _LEAST_SPEED:
        return judged(
            "depth",
            _DEPTH_NAME,
            statistic="not excited enough to tell",
            threshold=_DEPTH_THRESHOLD,
            passed=None,
            advice="The vehicle hardly pitches: signs and scales of depth and theta cannot be checked on these data.",
        )
    agrees, over = fitted.correlation >= _LEAST_CORRELATION and _is_one(fitted), ""
    if not agrees and offset is not None and offset.is_too_large:
        within_seconds = fit_over_seconds(signals, dive)
        if within_seconds is not None and known_sign(within_seconds) > 0 and _is_one(within_seconds):
            fitted, agrees, over = within_seconds, True, ", of what changes within seconds"
    return judged(
        "depth",
        _DEPTH_NAME,
        statistic=f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}{over}",
        threshold=_DEPTH_THRESHOLD,
        passed=agrees,
        advice=_with_units(
            "The vehicle does not go where its nose points: depth must be positive down and in m, theta positive nose "
            "up; or one of them is delayed.",
            mistaken_units(fitted.gain, ("depth", "m"), ("u", "m/s")),
        ),
    )


def _with_units(advice: str, unit: str) -> str:
    return f"{advice} By the size of the gain: {unit}" if unit else advice


def _is_one(fitted: Regression) -> bool:
    return abs(fitted.gain - 1.0) <= _TOLERANCE + _VELOCITY_SIGMAS * fitted.error


def _heading_offset(signals: Signals) -> Check:
    """Judge the angle about z between DVL and hull: sway in proportion to surge, beside turns and current."""
    value, rates = signals.values, rates_by_sensor(signals, "r")
    name, threshold = "heading offset", f"<= {np.rad2deg(_USUAL_OFFSET):.2g} deg"
    if not rates:
        return cannot_tell("dvl", name, "nothing measures r, or a heading instead", threshold)
    window, turning = signals.window("u", "v", "r", "psi"), next(iter(rates.values()))
    u, v = value["u"], value["v"]
    # A turn slows the vehicle down to either side, and may not slip as much to both.
    fitted = regress_relation(v, u, (turning * u, np.abs(turning) * u, *carried_sideways(signals)), window)
    tangent = 0.0 if fitted is None else fitted.gain
    is_observed = fitted is not None and fitted.error < 0.5 * np.tan(_USUAL_OFFSET)
    return judged(
        "dvl",
        name,
        statistic=f"{np.rad2deg(np.arctan(tangent)):.2g} deg" if is_observed else "not excited enough to tell",
        threshold=threshold,
        passed=True if is_observed and abs(tangent) <= np.tan(_USUAL_OFFSET) else None,
        advice="Sway goes with surge: the DVL may be turned to the hull by this; estimate it "
        "(`identification.estimate`)."
        if is_observed
        else "The speed hardly changes apart from the turns: a DVL turned to the hull would not show.",
    )
