"""Current, and responses of the vehicle to its inputs."""

from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.checks import Check
from auvid_cli.inspection.inspection import judged, undetermined
from auvid_cli.inspection.kinematic_relations import (
    Regression,
    Signals,
    attitude_window,
    change,
    fit,
    rates_by_sensor,
    regress_relation,
    smoothed,
)

_MAX_FLOW_ANGLE = np.deg2rad(2.0)  # rad, largest effect of a current that needs no note
_CURRENT_SIGMAS = 5.0
_SIGN_SIGMAS = 5.0  # standard errors of a gain from 0 at which its sign is known
_MIN_SIGN_CORRELATION = 0.4  # partial correlation at which the sign of a gain is known
MIN_DEFLECTION = 1e-3  # rad, standard deviation of a fin that moves
_ROLL_SYMBOLS = "phi", "p"
_MIN_RESPONSE_TIME = 0.3  # s
_USUAL_RESPONSE_TIME = 1.0  # s, for a vehicle with an unknown time constant
_MAX_RESPONSE_TIME = 3.0  # s


class Current(NamedTuple):
    """Estimate of a current, m/s, with the standard error of both components together."""

    north: float
    east: float
    error: float

    @property
    def speed(self) -> float:
        """Return its speed, m/s."""
        return float(np.hypot(self.north, self.east))


def carried_sideways(signals: Signals) -> tuple[Array, ...]:
    """Return the part of v due to a current of 1 m/s to the north, and to the east; empty without a heading."""
    heading = next((signals.values[symbol] for symbol in ("psi", "heading") if signals.has(symbol)), None)
    return () if heading is None else (-np.sin(heading), np.cos(heading))


def estimate_current(signals: Signals) -> Current | None:
    """Return the current from v, given the slip in turns; None without heading or turn rate, or with too few data."""
    directions, rates = carried_sideways(signals), rates_by_sensor(signals, "r")
    if not directions or not rates or not signals.has("u", "v"):
        return None
    window = signals.window("v", "u", "r", "psi", "heading")
    slip = next(iter(rates.values())) * signals.values["u"]
    north, east = directions
    by_north = regress_relation(signals.values["v"], north, (east, slip), window)
    by_east = regress_relation(signals.values["v"], east, (north, slip), window)
    if by_north is None or by_east is None:
        return None
    return Current(by_north.gain, by_east.gain, float(np.hypot(by_north.error, by_east.error)))


def is_significant(signals: Signals, current: Current) -> bool:
    """Whether a current is significant and turns the flow by more than 2 deg."""
    return current.speed > _max_current(signals) + _CURRENT_SIGMAS * current.error


def through_water(signals: Signals, current: Current | None) -> Signals:
    """Subtract a significant current from the velocities over ground."""
    if current is None or not is_significant(signals, current):
        return signals
    by_north, by_east = carried_sideways(signals)
    u = signals.values["u"] - current.north * by_east + current.east * by_north
    v = signals.values["v"] - current.north * by_north - current.east * by_east
    return signals._replace(values=signals.values | {"u": u, "v": v})


def current_check(signals: Signals, current: Current | None) -> Check:
    """Check for a current: with one, velocities over ground differ from those through the water."""
    name, limit = "current", _max_current(signals)
    threshold = f"<= {limit:.2g} m/s, which turns the flow by {np.rad2deg(_MAX_FLOW_ANGLE):.2g} deg"
    if current is None:
        return undetermined("dvl", name, "v and heading were measured together for too short a time", threshold)
    if not current.error < limit:
        return undetermined("dvl", name, f"the heading changes too little: +- {current.error:.2g} m/s", threshold)
    towards = np.rad2deg(np.arctan2(current.east, current.north)) % 360.0
    significant = is_significant(signals, current)
    return judged(
        "dvl",
        name,
        statistic=f"{current.speed:.2g} +- {current.error:.2g} m/s"
        + (f" towards {towards:.3g} deg" if significant else ""),
        threshold=threshold,
        passed=None if significant else True,
        advice="Velocity over ground has a part that depends on the heading: the water moves. Estimate the current "
        "(`identification.estimate.biases: [current]`), or the model treats it as slip.",
    )


def _max_current(signals: Signals) -> float:
    return float(np.tan(_MAX_FLOW_ANGLE) * np.nanmedian(np.abs(signals.values["u"])))


class RotationAxis(NamedTuple):
    """An axis of rotation."""

    rate: str  # symbol of the turn rate about this axis
    angle: str  # symbol of the angle
    input: str  # symbol of the input
    sign: int  # sign of the rate after a positive input; a positive fin pushes the stern to starboard or up
    covariates: tuple[str, ...]  # symbols of other signals that change the moment


AXES = (
    RotationAxis("p", "phi", "roll_moment", 1, ("phi", "v", "r", "rudder")),
    RotationAxis("q", "theta", "elevator", -1, ("w", "theta")),
    RotationAxis("r", "psi", "rudder", -1, ("v",)),
)


def known_sign(fitted: Regression | None) -> int:
    """Return 1 or -1 for a gain that is clearly positive or negative, else 0."""
    if (
        fitted is None
        or abs(fitted.correlation) < _MIN_SIGN_CORRELATION
        or abs(fitted.gain) < _SIGN_SIGMAS * fitted.error
    ):
        return 0
    return 1 if fitted.gain > 0.0 else -1


def moment(signals: Signals, axis: RotationAxis) -> Array | None:
    """Return a signal proportional to the moment of an input; None for a fin that does not move."""
    given = signals.values[axis.input]
    if axis.input == "roll_moment":
        return given
    if not np.nanstd(given) > MIN_DEFLECTION:
        return None
    return signals.values["u"] ** 2 * given if signals.has("u") else given


def response_window(signals: Signals, axis: RotationAxis, time_constant: float | None) -> int:
    """Return the number of cells over which the response to an input is observed."""
    return signals.window(axis.rate, axis.angle, least=_response_time(time_constant))


def _response_time(time_constant: float | None) -> float:
    if time_constant is None:
        return _USUAL_RESPONSE_TIME
    return min(max(time_constant, _MIN_RESPONSE_TIME), _MAX_RESPONSE_TIME)


def response_fits(signals: Signals, axis: RotationAxis, time_constant: float | None) -> dict[str, Regression | None]:
    """Return the regression of the change of a rate on an input, by the sensor of the rate.

    The change over a window is regressed on the mean input, given the motion at the start of the window, so that an
    autopilot, whose inputs follow the motion, does not reverse the sign. Roll is restored and damped within the window,
    so its covariates are means over the window.
    """
    by_sensor = rates_by_sensor(signals, axis.rate)
    force, window = moment(signals, axis), response_window(signals, axis, time_constant)
    if force is None:
        return dict.fromkeys(by_sensor)

    def covariate(symbol: str, values: Array) -> Array:
        return smoothed(values, window) if symbol in _ROLL_SYMBOLS else values

    others = [covariate(symbol, signals.values[symbol]) for symbol in axis.covariates if signals.has(symbol)]
    return {
        name: fit(change(rate, window), smoothed(force, window), [covariate(axis.rate, rate), *others], window)
        for name, rate in by_sensor.items()
    }


def response_signs(axis: RotationAxis, fits: dict[str, Regression | None]) -> dict[str, int]:
    """Return by sensor 1 for a response with the expected sign, -1 for the opposite; only where it is known."""
    signs = {name: axis.sign * known_sign(fitted) for name, fitted in fits.items()}
    return {name: sign for name, sign in signs.items() if sign}


def response_check(signals: Signals, axis: RotationAxis, fits: dict[str, Regression | None]) -> Check:
    """Check that any sensor shows the expected response to an input; other checks find a wrong rate or angle."""
    signs, name = response_signs(axis, fits), f"response of {axis.rate}"
    over = attitude_window(signals) * signals.grid.step
    statistic = ", ".join(
        f"{sensor} {'' if sensor == 'gyroscope' else f'over {over:.2g} s '}{fitted.gain:.3g} "
        f"(correlation {fitted.correlation:.2g})"
        for sensor, fitted in fits.items()
        if fitted
    )
    threshold = f"{'positive' if axis.sign > 0 else 'negative'} {axis.rate} after a positive {axis.input}"
    if not fits:
        return undetermined(axis.input, name, f"neither {axis.rate} nor {axis.angle} is measured", threshold)
    if not signs:
        return _unknown_sign(axis.input, name, statistic or "it hardly moves, or not for long", threshold)
    return judged(
        axis.input,
        name,
        statistic=statistic,
        threshold=threshold,
        passed=any(sign > 0 for sign in signs.values()),
        advice=f"The vehicle responds to {axis.input} with the wrong sign: set its `sign: -1` in the map "
        "(positive rudder or elevator pushes the stern to starboard or up), or the order of its columns.",
    )


def thrust_check(signals: Signals, time_constant: float | None) -> Check:
    """Check that the vehicle accelerates with more thrust."""
    value = signals.values
    window = signals.window("u", least=_response_time(time_constant))
    u = value["u"]
    turning = list(rates_by_sensor(signals, "r").values())[:1] if signals.has("v") else []
    covariates = [np.abs(u) * u, *(value["v"] * rate for rate in turning)]
    fitted = fit(change(u, window), smoothed(value["surge_force"], window), covariates, window)
    sign = known_sign(fitted)
    statistic = f"{fitted.gain:.3g} (correlation {fitted.correlation:.2g})" if fitted else "too short"
    name, threshold = "response of u", "positive change of u after a positive surge_force"
    if not sign:
        return _unknown_sign("surge_force", name, statistic, threshold)
    advice = "The vehicle slows down with more thrust: set `sign: -1` of surge_force or of u in the map."
    return judged("surge_force", name, statistic=statistic, threshold=threshold, passed=sign > 0, advice=advice)


def sideslip_pivots(signals: Signals, symbol: str) -> dict[str, float]:
    """Return the distance, m, of the pivot point ahead of the place where v or w is measured, by sensor of the rate.

    A slender hull with fins at the stern drifts out of a turn: v against r u, w with q u. Negative: the velocity points
    into the turn. Only where the sign is known; v is regressed given a current, which depends on the heading.
    """
    rate_symbol, outwards = {"v": ("r", -1), "w": ("q", 1)}[symbol]
    value = signals.values
    by_sensor, window = rates_by_sensor(signals, rate_symbol), signals.window(symbol, rate_symbol, "psi", "heading")
    current = carried_sideways(signals) if symbol == "v" else ()
    fits = {
        name: regress_relation(value[symbol], rate * value["u"], current, window) for name, rate in by_sensor.items()
    }
    speed = float(np.nanmedian(value["u"]))
    return {name: outwards * fitted.gain * speed for name, fitted in fits.items() if fitted and known_sign(fitted)}


def _unknown_sign(symbol: str, name: str, found: str, threshold: str) -> Check:
    advice = f"The sign of {symbol} was not checked: it hardly moves, or other effects hide its response."
    return undetermined(symbol, name, f"too little excitation, {found}", threshold, advice)
