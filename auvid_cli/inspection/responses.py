"""Responses of the vehicle to its inputs, in water that may move."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import Check
from auvid_cli.inspection.inspection import cannot_tell, judged
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

Array = NDArray[np.float64]
# rad; of the flow to a vehicle whose speed through the water is that over ground.
_USUAL_SLIP = np.deg2rad(2.0)
_CURRENT_SIGMAS = 5.0
_NAME = "current"
# Standard errors from 0, and partial correlation, at which a sign is known.
_RESPONSE_SIGMAS, _LEAST_CORRELATION = 5.0, 0.4
# rad, of a fin that moves at all.
LEAST_DEFLECTION = 1e-3
# Of which the means over a window count.
_OF_ROLL = "phi", "p"
_SHORTEST_ANSWER, _USUAL_ANSWER, _LONGEST_ANSWER = 0.3, 1.0, 3.0


class Drift(NamedTuple):
    """A current, m/s, north and east, with the standard error of both together."""

    north: float
    east: float
    error: float

    @property
    def size(self) -> float:
        """Return how fast the water is, m/s."""
        return float(np.hypot(self.north, self.east))


def carried_sideways(signals: Signals) -> tuple[Array, ...]:
    """Return what a current of 1 m/s north, and one east, adds to v; nothing where no heading is measured."""
    heading = next((signals.values[symbol] for symbol in ("psi", "heading") if signals.has(symbol)), None)
    return () if heading is None else (-np.sin(heading), np.cos(heading))


def drift(signals: Signals) -> Drift | None:
    """Find the current by v, beside the slip in turns; None if nothing is known of turns, or for too short a time."""
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
    return Drift(by_north.gain, by_east.gain, float(np.hypot(by_north.error, by_east.error)))


def is_current(signals: Signals, found: Drift) -> bool:
    """Say whether it is one beyond doubt that turns the flow more than a little."""
    return found.size > _usual(signals) + _CURRENT_SIGMAS * found.error


def through_water(signals: Signals, found: Drift | None) -> Signals:
    """Take a current, if there is one, off velocities over ground."""
    if found is None or not is_current(signals, found):
        return signals
    by_north, by_east = carried_sideways(signals)
    u = signals.values["u"] - found.north * by_east + found.east * by_north
    v = signals.values["v"] - found.north * by_north - found.east * by_east
    return signals._replace(values=signals.values | {"u": u, "v": v})


def current_check(signals: Signals, found: Drift | None) -> Check:
    """Judge the current: where there is one, velocities over ground are not those through the water."""
    usual = _usual(signals)
    threshold = f"<= {usual:.2g} m/s, which turns the flow by {np.rad2deg(_USUAL_SLIP):.2g} deg"
    if found is None:
        return cannot_tell("dvl", _NAME, "v and heading are not known together for long enough", threshold)
    if not found.error < usual:
        return cannot_tell("dvl", _NAME, f"the heading changes too little: +- {found.error:.2g} m/s", threshold)
    towards = np.rad2deg(np.arctan2(found.east, found.north)) % 360.0
    there_is = is_current(signals, found)
    return judged(
        "dvl",
        _NAME,
        statistic=f"{found.size:.2g} +- {found.error:.2g} m/s" + (f" towards {towards:.3g} deg" if there_is else ""),
        threshold=threshold,
        passed=None if there_is else True,
        advice="Velocity over ground has a part across the heading that turns with it: the water moves. Estimate it "
        "(`identification.estimate.biases: [current]`), or what it does is taken for slip.",
    )


def _usual(signals: Signals) -> float:
    return float(np.tan(_USUAL_SLIP) * np.nanmedian(np.abs(signals.values["u"])))


class RotationAxis(NamedTuple):
    """An axis of rotation: what turns about it, and what turns it.

    Attributes
    ----------
    rate, angle, given : str
        Symbols; `given` is the input.
    sign : int
        Of the rate that a positive input brings. Positive fins push the stern to starboard, or up.
    beside : tuple of str
        What else the moment depends on.
    """

    rate: str
    angle: str
    given: str
    sign: int
    beside: tuple[str, ...]


AXES = (
    RotationAxis("p", "phi", "roll_moment", 1, ("phi", "v", "r", "rudder")),
    RotationAxis("q", "theta", "elevator", -1, ("w", "theta")),
    RotationAxis("r", "psi", "rudder", -1, ("v",)),
)


def known_sign(fitted: Regression | None) -> int:
    """Return 1 or -1 where a gain is clearly positive or negative, else 0."""
    if (
        fitted is None
        or abs(fitted.correlation) < _LEAST_CORRELATION
        or abs(fitted.gain) < _RESPONSE_SIGMAS * fitted.error
    ):
        return 0
    return 1 if fitted.gain > 0.0 else -1


def moment(signals: Signals, axis: RotationAxis) -> Array | None:
    """Return what an input turns the vehicle by, but for a factor; None of a fin that does not move."""
    given = signals.values[axis.given]
    if axis.given == "roll_moment":
        return given
    if not np.nanstd(given) > LEAST_DEFLECTION:
        return None
    return signals.values["u"] ** 2 * given if signals.has("u") else given


def answer_window(signals: Signals, axis: RotationAxis, time_constant: float | None) -> int:
    """Say how many cells to watch for the answer to an input."""
    return signals.window(axis.rate, axis.angle, least=_shown_within(time_constant))


def _shown_within(time_constant: float | None) -> float:
    """Say how long to watch for the answer to an input, s."""
    return _USUAL_ANSWER if time_constant is None else min(max(time_constant, _SHORTEST_ANSWER), _LONGEST_ANSWER)


def response_fits(signals: Signals, axis: RotationAxis, time_constant: float | None) -> dict[str, Regression | None]:
    """Fit how fast a rate changes by an input, by the sensor that says the rate: "gyroscope" and "attitude".

    The change over a window is regressed on the mean input there, and on what the vehicle did at its begin: so an
    autopilot, which lets the input follow the motion, does not turn the sign. What rolls is righted and damped within
    the window, and may be on its way back as it ends: of that the means count, as the integral of the moments has it.
    """
    value, by_sensor = signals.values, rates_by_sensor(signals, axis.rate)
    force, window = moment(signals, axis), answer_window(signals, axis, time_constant)
    if force is None:
        return dict.fromkeys(by_sensor)

    def counted(symbol: str, values: Array) -> Array:
        return smoothed(values, window) if symbol in _OF_ROLL else values

    beside = [counted(symbol, value[symbol]) for symbol in axis.beside if signals.has(symbol)]
    return {
        name: fit(change(rate, window), smoothed(force, window), [counted(axis.rate, rate), *beside], window)
        for name, rate in by_sensor.items()
    }


def answers(axis: RotationAxis, fits: dict[str, Regression | None]) -> dict[str, int]:
    """Return 1 where by a sensor the vehicle answers the right way, -1 where the wrong way; where it can be told."""
    signs = {name: axis.sign * known_sign(fitted) for name, fitted in fits.items()}
    return {name: sign for name, sign in signs.items() if sign}


def response_check(signals: Signals, axis: RotationAxis, fits: dict[str, Regression | None]) -> Check:
    """Judge whether any sensor sees the right answer to an input: a wrong rate or angle is named elsewhere."""
    signs, name = answers(axis, fits), f"response of {axis.rate}"
    over = attitude_window(signals) * signals.grid.step
    statistic = ", ".join(
        f"{sensor} {'' if sensor == 'gyroscope' else f'over {over:.2g} s '}{fitted.gain:.3g} "
        f"(correlation {fitted.correlation:.2g})"
        for sensor, fitted in fits.items()
        if fitted
    )
    threshold = f"{'positive' if axis.sign > 0 else 'negative'} {axis.rate} from a positive {axis.given}"
    if not fits:
        return cannot_tell(axis.given, name, f"nothing measures {axis.rate}, or {axis.angle} instead", threshold)
    if not signs:
        statistic = f"not excited enough to tell: {statistic or 'it hardly moves, or not for long'}"
        return judged(
            axis.given,
            name,
            statistic=statistic,
            threshold=threshold,
            passed=None,
            advice=_unknown_sign(axis.given),
        )
    return judged(
        axis.given,
        name,
        statistic=statistic,
        threshold=threshold,
        passed=any(sign > 0 for sign in signs.values()),
        advice=f"The vehicle answers {axis.given} the wrong way round: turn its sign (positive rudder or elevator "
        "pushes the stern to starboard or up), or the order of its columns.",
    )


def thrust_check(signals: Signals, time_constant: float | None) -> Check:
    """Judge whether the vehicle is faster for more thrust."""
    value = signals.values
    window = signals.window("u", least=_shown_within(time_constant))
    u = value["u"]
    turning = list(rates_by_sensor(signals, "r").values())[:1] if signals.has("v") else []
    beside = [np.abs(u) * u, *(value["v"] * rate for rate in turning)]
    fitted = fit(change(u, window), smoothed(value["surge_force"], window), beside, window)
    sign = known_sign(fitted)
    statistic = f"{fitted.gain:.3g} (correlation {fitted.correlation:.2g})" if fitted else "too short"
    advice = "The vehicle slows down for more thrust: turn the sign of surge_force or of u."
    return judged(
        "surge_force",
        "response of u",
        statistic=statistic if sign else f"not excited enough to tell: {statistic}",
        threshold="positive u from a positive surge_force",
        passed=sign > 0 if sign else None,
        advice=advice if sign else _unknown_sign("surge_force"),
    )


def sideslip(signals: Signals, symbol: str) -> dict[str, float]:
    """Find how v or w goes with the turn, where that can be told, by the sensor that says the rate.

    A slender hull with its fins at the stern drifts outwards: v against r u, w with q u. What a current adds to v goes
    with the heading, and stands beside it.

    Returns
    -------
    dict of float
        How far the place that goes neither out of nor into the turn is ahead of where it is measured, m; behind it if
        negative, and then the velocity points into the turn.
    """
    rate_symbol, outwards = {"v": ("r", -1), "w": ("q", 1)}[symbol]
    value = signals.values
    by_sensor, window = rates_by_sensor(signals, rate_symbol), signals.window(symbol, rate_symbol, "psi", "heading")
    beside = carried_sideways(signals) if symbol == "v" else ()
    fits = {
        name: regress_relation(value[symbol], rate * value["u"], beside, window) for name, rate in by_sensor.items()
    }
    speed = float(np.nanmedian(value["u"]))
    return {name: outwards * fitted.gain * speed for name, fitted in fits.items() if fitted and known_sign(fitted)}


def _unknown_sign(given: str) -> str:
    return f"{given} hardly moves, or what it does is hidden by the rest: its sign cannot be checked on these data."
