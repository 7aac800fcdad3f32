"""Which way the vehicle answers its inputs, and which way it slips in a turn."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.evaluation.check import Check
from auvid_cli.inspection.grid import Signals, change, smoothed
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematics import attitude_rates, tied
from auvid_cli.inspection.regression import Fit, fit

Array = NDArray[np.float64]

# Standard errors from 0, and partial correlation, at which a sign is known.
_SIGMAS, _LEAST_CORRELATION = 5.0, 0.4
# rad, of a fin that moves at all.
_LEAST_DEFLECTION = 1e-3
_SHORTEST_ANSWER, _USUAL_ANSWER, _LONGEST_ANSWER = 0.3, 1.0, 3.0


class Axis(NamedTuple):
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
    Axis("p", "phi", "roll_moment", 1, ("phi", "v", "r", "rudder")),
    Axis("q", "theta", "elevator", -1, ("w", "theta")),
    Axis("r", "psi", "rudder", -1, ("v",)),
)


def known_sign(found: Fit | None) -> int:
    """1 or -1 where a gain is clearly positive or negative, else 0."""
    if found is None or abs(found.correlation) < _LEAST_CORRELATION or abs(found.gain) < _SIGMAS * found.error:
        return 0
    return 1 if found.gain > 0.0 else -1


def moment(signals: Signals, axis: Axis) -> Array | None:
    """What an input turns the vehicle by, but for a factor; None of a fin that does not move."""
    given = signals.values[axis.given]
    if axis.given == "roll_moment":
        return given
    if not np.nanstd(given) > _LEAST_DEFLECTION:
        return None
    return signals.values["u"] ** 2 * given if signals.has("u") else given


def answer_window(signals: Signals, axis: Axis, time_constant: float | None) -> int:
    """How many cells to watch for the answer to an input."""
    return signals.window(axis.rate, axis.angle, least=_shown_within(time_constant))


def _shown_within(time_constant: float | None) -> float:
    """How long to watch for the answer to an input, s."""
    return _USUAL_ANSWER if time_constant is None else min(max(time_constant, _SHORTEST_ANSWER), _LONGEST_ANSWER)


def response_fits(signals: Signals, axis: Axis, time_constant: float | None) -> dict[str, Fit | None]:
    """How fast a rate changes by an input, by the sensor that says the rate: "gyroscope" and "attitude".

    The change over a window is regressed on the mean input there, and on what the vehicle did at its begin: so an
    autopilot, which lets the input follow the motion, does not turn the sign.
    """
    value, rates = signals.values, attitude_rates(signals)
    said = {"gyroscope": value[axis.rate]} if signals.has(axis.rate) else {}
    if rates:
        said["attitude"] = rates[axis.rate].total()
    force, window = moment(signals, axis), answer_window(signals, axis, time_constant)
    if force is None:
        return dict.fromkeys(said)
    force = smoothed(force, window)
    return {
        name: fit(change(rate, window), force, [rate, *(value[s] for s in axis.beside if signals.has(s))], window)
        for name, rate in said.items()
    }


def answers(axis: Axis, fits: dict[str, Fit | None]) -> dict[str, int]:
    """1 where a sensor says that the vehicle answers the right way, -1 where the wrong way; where it can be told."""
    signs = {name: axis.sign * known_sign(found) for name, found in fits.items()}
    return {name: sign for name, sign in signs.items() if sign}


def response_check(axis: Axis, fits: dict[str, Fit | None]) -> Check:
    """Whether any sensor finds the answer to an input as it should be: a wrong rate or angle is named elsewhere."""
    told = answers(axis, fits)
    found = ", ".join(
        f"{name} {each.gain:.3g} (correlation {each.correlation:.2g})" for name, each in fits.items() if each
    )
    threshold = f"{'positive' if axis.sign > 0 else 'negative'} {axis.rate} from a positive {axis.given}"
    if not told:
        found = f"not excited enough to tell: {found or 'it hardly moves, or not for long'}"
        return judged(axis.given, f"response of {axis.rate}", found, threshold, None, _untold(axis.given))
    return judged(
        axis.given,
        f"response of {axis.rate}",
        found,
        threshold,
        any(sign > 0 for sign in told.values()),
        f"The vehicle answers {axis.given} the wrong way round: turn its sign (positive rudder or elevator pushes the "
        "stern to starboard or up), or the order of its columns.",
    )


def thrust_check(signals: Signals, time_constant: float | None) -> Check:
    """Whether the vehicle is faster for more thrust."""
    value = signals.values
    window = signals.window("u", least=_shown_within(time_constant))
    u = value["u"]
    beside = [np.abs(u) * u, *([value["v"] * value["r"]] if signals.has("v", "r") else [])]
    found = fit(change(u, window), smoothed(value["surge_force"], window), beside, window)
    sign = known_sign(found)
    shown = f"{found.gain:.3g} (correlation {found.correlation:.2g})" if found else "too short"
    advice = "The vehicle slows down for more thrust: turn the sign of surge_force or of u."
    return judged(
        "surge_force",
        "response of u",
        shown if sign else f"not excited enough to tell: {shown}",
        "positive u from a positive surge_force",
        sign > 0 if sign else None,
        advice if sign else _untold("surge_force"),
    )


def slip_sign(signals: Signals, symbol: str) -> dict[str, int]:
    """Whether v or w points out of the turn: 1 if so, -1 if into it, by the sensor that says the rate.

    A slender hull with its fins at the stern drifts outwards: v against r u, w with q u.
    """
    rate, sign = {"v": ("r", -1), "w": ("q", 1)}[symbol]
    value, rates = signals.values, attitude_rates(signals)
    said = {"gyroscope": value[rate]} if signals.has(rate) else {}
    if rates:
        said["attitude"] = rates[rate].total()
    window = signals.window(symbol, rate)
    found = {name: sign * known_sign(tied(value[symbol], each * value["u"], (), window)) for name, each in said.items()}
    return {name: each for name, each in found.items() if each}


def _untold(given: str) -> str:
    return f"{given} hardly moves, or what it does is hidden by the rest: its sign cannot be checked on these data."
