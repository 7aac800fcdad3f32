"""Velocity, depth and pitch against each other: speed, signs, scale, lever arm, current, pitch offset."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import Check
from auvid_cli.inspection import responses
from auvid_cli.inspection.inspection import judged, mistaken_units, undetermined
from auvid_cli.inspection.kinematic_relations import (
    Regression,
    Relation,
    Signals,
    change,
    diving_speed,
    fit,
    lever_arm_acceleration,
    mean_between_middles,
    measured_depth_rate,
    measured_forces,
    rates_by_sensor,
    regress_relation,
    smoothed,
    without_mean,
)
from auvid_cli.inspection.responses import Current
from auvid_cli.vehicle.kinematics import GRAVITY

Array = NDArray[np.float64]
_UNDER_WAY_SHARE = 0.2  # of the usual speed
_MIN_SPEED = 0.05  # m/s
_MAX_SPEED = 15.0  # m/s
_MAX_SIDEWAYS_SHARE = 0.5  # of u
_GAIN_TOLERANCE = 0.2
_GAIN_SIGMAS = 3.0
_MIN_CORRELATION = 0.7
_MIN_SPREAD = 0.02  # m/s, and m/s^2 against the accelerometer
_MAX_FORCE_GAIN = 3.0  # an accelerometer checks signs and units, not scales
_MAX_ARM = 0.15  # m, between DVL and accelerometer
_ARM_SIGMAS = 3.0
_ARM_SOURCES = (("v", "fy", "r"), ("w", "fz", "q"))  # velocity, specific force, turn rate
_SCALE_TIME = 3.0  # s, of a change of depth: long enough that smoothing and delays hardly matter
_MIN_SCALE_INTERVALS = 10  # of depth and pitch in that time: interpolation flattens slower signals
_MAX_SCALE_ERROR = 0.01
_MAX_SCALE_DEVIATION = 0.006  # standard error at which a scale is known
_SCALE_SIGMAS = 2.0
_MAX_HEADING_OFFSET = np.deg2rad(2.0)
_MAX_DVL_AHEAD = 0.25  # lengths of the vehicle, from its pivot point to a DVL near the nose
_PITCH_OFFSET_NOTE = np.deg2rad(2.0)
_PITCH_OFFSET_FAILURE = np.deg2rad(5.0)
_PITCH_INTERVAL = 10.0  # s, shortest interval with a pitch offset of its own
_MAX_PITCH_INTERVALS = 1000
_MIN_PITCH_RUN = 2  # successive intervals with the same offset
_AHEAD_SHARE = 0.5  # of the usual speed, at which the vehicle moves where its nose points
_PITCH_ITERATIONS = 4
_DEPTH_NAME = "depth against pitch and u"
_DEPTH_THRESHOLD = f"gain 1 +- {_GAIN_TOLERANCE}, correlation >= {_MIN_CORRELATION}"


class PitchOffset(NamedTuple):
    """Offset of theta, rad."""

    usual: float  # median over intervals of the run
    temporary: float | None = None  # median over `span` if it is too large only there
    span: tuple[float, float] | None = None  # longest time span with a temporary offset, s
    rest: float | None = None  # median over the rest of the run

    @property
    def largest(self) -> float:
        """Return the offset that the check uses, rad."""
        return self.usual if self.temporary is None else self.temporary

    @property
    def is_too_large(self) -> bool:
        """Whether it fails."""
        return abs(self.largest) > _PITCH_OFFSET_FAILURE


def velocity_checks(
    signals: Signals, length: float, time_constant: float | None, accelerometer_ahead: float = 0.0
) -> list[Check]:
    """Check the DVL and everything that depends on it; with implausible velocities only these.

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
        offset = offset_by_depth(signals, dive)
        depth = _depth_rate(signals, dive, offset)
        checks.append(depth)
        # A failed depth is not evidence against other sensors.
        dive = None if depth.passed is False else dive
    elif signals.has("down"):
        checks.append(undetermined("depth", _DEPTH_NAME, "theta is not measured", _DEPTH_THRESHOLD))
    if forces:
        checks.append(against_force(signals, "u", forces["u"]))
    if dive is not None:
        checks.append(scale_check(signals, dive))
    current = responses.estimate_current(signals)
    directions = [_direction(signals, s, forces, dive, current, length) for s in ("v", "w") if signals.has(s)]
    checks += directions
    if dive is not None and offset is not None:
        checks.append(pitch_offset_check(offset, "depth rate"))
    elif forces and (offset := offset_by_gravity(signals, forces["u"])) is not None:
        checks.append(pitch_offset_check(offset, "accelerometer"))
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
    if fitted is None or moved is None or moved.spread < _MIN_SPREAD or not responses.known_sign(fitted):
        return _unknown_sign(symbol, name, threshold)
    return judged(
        "dvl",
        name,
        statistic=f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}",
        threshold=threshold,
        passed=1.0 / _MAX_FORCE_GAIN <= fitted.gain <= _MAX_FORCE_GAIN,
        advice=_with_units(
            f"{symbol} does not change as the accelerometer measures. Check in the map: its sign, its unit, exchanged "
            "axes.",
            mistaken_units(fitted.gain, ("the accelerometer", "m/s^2"), (symbol, "m/s")),
        ),
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
        if fitted is not None and fitted.spread > _MIN_SPREAD and responses.known_sign(fitted):
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


def _depth_rate(signals: Signals, dive: Relation, offset: PitchOffset | None) -> Check:
    """Check the depth rate against pitch and surge; a pitch offset, even a temporary one, does not fail it."""
    window = signals.window("down", "u", "theta")
    fitted: Regression | None = regress_relation(measured_depth_rate(signals), dive.main, dive.others, window)
    if fitted is None or fitted.spread < _MIN_SPREAD:
        advice = (
            "Signs and scales of depth and theta were not checked: the vehicle hardly pitches. In the next log, dive "
            "and climb."
        )
        return undetermined("depth", _DEPTH_NAME, "too little excitation", _DEPTH_THRESHOLD, advice)
    agrees, source = fitted.correlation >= _MIN_CORRELATION and _is_one(fitted), ""
    if not agrees and offset is not None and offset.is_too_large:
        fast = _fast_depth_rate(signals, dive)
        if fast is not None and responses.known_sign(fast) > 0 and _is_one(fast):
            fitted, agrees, source = fast, True, ", from changes within seconds"
    return judged(
        "depth",
        _DEPTH_NAME,
        statistic=f"gain {fitted.gain:.3g} +- {fitted.error:.2g}, correlation {fitted.correlation:.2g}{source}",
        threshold=_DEPTH_THRESHOLD,
        passed=agrees,
        advice=_with_units(
            "The vehicle does not move where its nose points. Check in the map: depth positive down and in m, theta "
            "positive nose up, and a delay of one of them.",
            mistaken_units(fitted.gain, ("depth", "m"), ("u", "m/s")),
        ),
    )


def _fast_depth_rate(signals: Signals, dive: Relation) -> Regression | None:
    """Return the regression of the depth rate on pitch and surge, all without slow changes.

    A temporary pitch offset distorts the gain over the whole run, but not this one.
    """
    window, interval = signals.window("down", "u", "theta"), round(_PITCH_INTERVAL / signals.grid.step)
    moving = np.where(_moves_ahead(signals), 0.0, np.nan)
    within = [
        without_mean(smoothed(values, window), interval)
        for values in (measured_depth_rate(signals) + moving, dive.main, *dive.others)
    ]
    return fit(within[0], within[1], within[2:], window)


def _with_units(advice: str, unit: str) -> str:
    return f"{advice} The gain suggests: {unit}" if unit else advice


def _is_one(fitted: Regression) -> bool:
    return abs(fitted.gain - 1.0) <= _GAIN_TOLERANCE + _GAIN_SIGMAS * fitted.error


def scale_check(signals: Signals, dive: Relation) -> Check:
    """Check the change of depth against pitch and velocities, given a pitch offset (a part u cos(theta))."""
    name = "scale by depth"
    threshold = f"1 +- {_MAX_SCALE_ERROR:g}, if known to {_MAX_SCALE_DEVIATION:g}"
    if max(signals.interval["down"], signals.interval["theta"]) > _SCALE_TIME / _MIN_SCALE_INTERVALS:
        return undetermined("dvl", name, "depth or pitch is measured too seldom", threshold)
    window = signals.window("down", "u", "theta", least=_SCALE_TIME)
    offset_effect = signals.values["u"] * np.cos(signals.values["theta"])
    depth_rate = change(signals.values["down"], window) / (window * signals.grid.step)
    expected, offset = (mean_between_middles(rate, window) for rate in (dive.total(), offset_effect))
    fitted = fit(depth_rate, expected, [offset], window)
    if fitted is None or not fitted.error <= _MAX_SCALE_DEVIATION:
        return undetermined("dvl", name, "the vehicle hardly dives, or not for long", threshold)
    return judged(
        "dvl",
        name,
        statistic=f"depth changes {fitted.gain:.4f} +- {fitted.error:.2g} times the change from velocity and pitch",
        threshold=threshold,
        passed=None if abs(fitted.gain - 1.0) > max(_MAX_SCALE_ERROR, _SCALE_SIGMAS * fitted.error) else True,
        advice="One scale is wrong: the speed of sound of the DVL, or the water density of the depth (salt and fresh "
        f"differ by 2.7 %). If the depth is right, multiply the velocities by {fitted.gain:.4g} (`scale` in the map) "
        "or estimate their scale (`identification.estimate.biases: [dvl]`).",
    )


def offset_by_depth(signals: Signals, dive: Relation) -> PitchOffset | None:
    """Return the pitch offset from the depth rate that pitch and speed do not explain; None if hardly under way."""
    unexplained = measured_depth_rate(signals) - dive.total()
    return _pitch_offset(signals, np.where(_moves_ahead(signals), unexplained, np.nan), signals.values["u"])


def offset_by_gravity(signals: Signals, forward: Relation) -> PitchOffset | None:
    """Return the pitch offset from gravity along the x axis of the accelerometer."""
    unexplained = signals.values["fx"] - forward.total()
    return _pitch_offset(signals, unexplained, np.full(unexplained.size, -GRAVITY))


def _moves_ahead(signals: Signals) -> NDArray[np.bool_]:
    u = signals.values["u"]
    return u >= _AHEAD_SHARE * np.nanquantile(u, 0.9)


def _pitch_offset(signals: Signals, unexplained: Array, weight: Array) -> PitchOffset | None:
    """Solve `unexplained` = `weight` (sin(theta) - sin(theta - offset)), interval by interval."""
    grid, theta = signals.grid, signals.values["theta"]
    finite = np.isfinite(unexplained) & np.isfinite(weight) & np.isfinite(theta)
    length = max(round(_PITCH_INTERVAL / grid.step), -(-grid.cells // _MAX_PITCH_INTERVALS))
    starts, offsets = [], []
    for start in range(0, grid.cells, length):
        interval = slice(start, start + length)
        inside = finite[interval]
        # An interval with few values counts only if the run has no other.
        if inside.sum() >= 0.5 * min(length, grid.cells):
            starts.append(start)
            parts = (values[interval][inside] for values in (unexplained, weight, theta))
            offsets.append(_offset_of_interval(*parts))
    if not offsets:
        return None
    by_interval = np.array(offsets)
    usual = float(np.median(by_interval))
    first, end = _longest_run(np.where(np.abs(by_interval) > _PITCH_OFFSET_FAILURE, np.sign(by_interval), 0.0))
    if end - first < _MIN_PITCH_RUN or end - first == by_interval.size:
        return PitchOffset(usual)
    span = grid.start + grid.step * starts[first], grid.start + grid.step * min(starts[end - 1] + length, grid.cells)
    rest = np.delete(by_interval, slice(first, end))
    return PitchOffset(usual, float(np.median(by_interval[first:end])), span, float(np.median(rest)))


def _offset_of_interval(unexplained: Array, weight: Array, theta: Array) -> float:
    # The median is robust against short faults.
    missing, offset = float(np.median(unexplained)), 0.0
    for _ in range(_PITCH_ITERATIONS):
        # sin(theta) - sin(theta - offset) = 2 sin(offset / 2) cos(theta - offset / 2)
        offset = missing / float(np.mean(weight * np.cos(theta - 0.5 * offset)))
    return offset


def _longest_run(signs: Array) -> tuple[int, int]:
    """Return begin and end of the longest run of one sign, without zeros; (0, 0) if there is none."""
    edges = np.flatnonzero(np.diff(signs, prepend=np.nan, append=np.nan))
    runs = [(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True) if signs[a]]
    return max(runs, key=lambda run: run[1] - run[0], default=(0, 0))


def pitch_offset_check(offset: PitchOffset, reference: str) -> Check:
    """Check the pitch offset; `reference` names the signal that it was found with."""
    size = abs(offset.largest)
    when = ""
    if offset.span is not None and offset.rest is not None:
        start, end = offset.span
        when = f" from t = {start:.4g} to {end:.4g} s, {np.rad2deg(offset.rest):+.2g} deg in the rest"
    return judged(
        "attitude",
        "pitch offset",
        statistic=f"theta is {np.rad2deg(offset.largest):+.2g} deg off compared with the {reference}{when}",
        threshold=f"<= {np.rad2deg(_PITCH_OFFSET_NOTE):.2g} deg; fails beyond "
        f"{np.rad2deg(_PITCH_OFFSET_FAILURE):.2g} deg",
        passed=True if size <= _PITCH_OFFSET_NOTE else None if size <= _PITCH_OFFSET_FAILURE else False,
        advice="The pitch is wrong for a part of the run: use another source, or identify from the rest (`--use`)."
        if when
        else "The sensor of theta, or of the velocity, is mounted at an angle: correct theta by it (`offset` in the "
        "map), or the mounting of the DVL (`mount`).",
    )


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
