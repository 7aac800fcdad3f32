"""What the vehicle file promises of the answer to an input, beside what was measured: how strong, and how late."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.plausibility import STRONGEST_FINS, WEAKEST_FINS
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.check import Check
from auvid_cli.data.rate_of_change import response_to_rates
from auvid_cli.inspection.grid import Signals, change
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_relations import attitude_window, rates_by_sensor
from auvid_cli.inspection.regression import fit
from auvid_cli.inspection.responses import AXES, RotationAxis, answer_window, moment
from auvid_cli.inspection.small_motion import SmallMotion, small_motion
from auvid_cli.inspection.velocity import mean_speed
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

Array = NDArray[np.float64]

# What moves along with a rate, the others held, and the input that it answers, whatever the columns are called.
_STATES = {"p": ("p", "phi"), "q": ("w", "q", "theta"), "r": ("v", "r")}
_ANSWERED = {axis.rate: axis.given for axis in AXES}
# Standard deviations by which a strength is beyond what is plausible.
_SIGMAS = 3.0
# What tells a strength: partial correlation, share of the change that the input explains, and windows that are as good
# as independent. Fewer are of one turn, or of a fin that only answers the motion.
_LEAST_CORRELATION, _LEAST_SHARE, _FEWEST_WINDOWS = 0.9, 0.3, 40.0


class PromisedAnswer(NamedTuple):
    """Change of a rate over a window, and what of it an input should make.

    Attributes
    ----------
    change : ndarray
        rad/s, from each cell on.
    promised : ndarray
        By the vehicle file, rad/s; without its coefficients in another unit.
    beside : list of ndarray
        What else may change the rate.
    window : int
        Cells.
    """

    change: Array
    promised: Array
    beside: list[Array]
    window: int


def motion_of(signals: Signals, vehicle: VehicleSettings) -> SmallMotion | None:
    """Make the vehicle's equations linear about the motion that was measured; None without speed or coefficients."""
    speed = mean_speed(signals)
    if speed is None:
        return None
    across = {symbol: signals.values[symbol] for symbol in "vw" if signals.has(symbol)}
    by_sensor = {symbol: rates_by_sensor(signals, symbol) for symbol in "pqr"}
    across |= {symbol: next(iter(rates.values())) for symbol, rates in by_sensor.items() if rates}
    sizes = {s: float(np.nanstd(values)) for s, values in across.items() if np.isfinite(values).any()}
    return small_motion(vehicle, speed, sizes)


def promised_answer(
    signals: Signals, axis: RotationAxis, motion: SmallMotion | None, window: int
) -> PromisedAnswer | None:
    """Compare the change of a rate over a window with what an input makes of it.

    Beside the input stands the motion at the begin of the window, in proportion and as cross-flow goes, so that an
    autopilot, which lets the input follow the motion, does not count; and of a pitch what a turn does to it.

    Returns
    -------
    PromisedAnswer or None
        None if the input does not move or nothing tells the rate.
    """
    force, rates = moment(signals, axis), rates_by_sensor(signals, axis.rate)
    if force is None or not rates:
        return None
    name, rate = next(iter(rates.items()))
    step = signals.grid.step
    promised, beside = by_steps(force, answer_by_steps(signals, axis, motion, window)), _beside(signals, axis)
    if name != "gyroscope":
        # As the changes of angles are taken, over which the rate is smoothed.
        half = attitude_window(signals, "psi" if name == "attitude" else "heading") // 2
        promised, *beside = (response_to_rates(each, step, half) for each in (promised, *beside))
    beside = [rate, *beside]
    return PromisedAnswer(change(rate, window), promised, [*beside, *(np.abs(each) * each for each in beside)], window)


def answer_by_steps(signals: Signals, axis: RotationAxis, motion: SmallMotion | None, window: int) -> Array:
    """Return how much each cell of a window of a unit input changes a rate by its end; alike where nothing says."""
    if motion is None:
        return np.full(window, signals.grid.step)
    return motion.answer(axis.rate, _STATES[axis.rate], _ANSWERED[axis.rate], signals.grid.step, window)


def by_steps(force: Array, steps: Array) -> Array:
    """Add up over each window what the means between the middles of cells make of a rate by its end."""
    between = 0.5 * (force[:-1] + force[1:])
    added = np.full(force.size, np.nan)
    if between.size >= steps.size:
        added[: between.size - steps.size + 1] = np.convolve(between, steps[::-1], "valid")
    return added


def _beside(signals: Signals, axis: RotationAxis) -> list[Array]:
    value = signals.values
    beside = [value[s] for s in axis.beside if signals.has(s) and s not in INPUT_SYMBOLS]
    turning = [*rates_by_sensor(signals, "r").values()][:1]
    if axis.rate == "q" and turning:
        sideways = [value["v"] * turning[0], value["v"] ** 2] if signals.has("v") else []
        beside += [turning[0] ** 2, *sideways]
    return beside


def strength_checks(
    signals: Signals, motion: SmallMotion | None, time_constant: float | None, axes: Sequence[RotationAxis] = AXES[1:]
) -> list[Check]:
    """Judge whether fins turn the vehicle about as strongly as its file says, as far as that can be told.

    Parameters
    ----------
    signals : Signals
        With inputs where they belong in time.
    motion : SmallMotion or None
        Of the vehicle file.
    time_constant : float or None
        s, of the vehicle.
    axes : sequence of RotationAxis
    """
    if motion is None:
        return []
    checks = (_strength(signals, axis, motion, time_constant) for axis in axes)
    return [check for check in checks if check is not None]


def _strength(signals: Signals, axis: RotationAxis, motion: SmallMotion, time_constant: float | None) -> Check | None:
    # Over half a window less depends on what the file says of damping.
    answer = promised_answer(signals, axis, motion, max(answer_window(signals, axis, time_constant) // 2, 2))
    fitted = answer and fit(answer.change, answer.promised, answer.beside, answer.window)
    if not answer or not fitted or abs(fitted.correlation) < _LEAST_CORRELATION:
        return None
    if fitted.independent < _FEWEST_WINDOWS or abs(fitted.gain) * fitted.spread < _LEAST_SHARE * np.nanstd(
        answer.change
    ):
        return None
    low, high = (abs(fitted.gain) + sign * _SIGMAS * fitted.error for sign in (-1.0, 1.0))
    return judged(
        axis.given,
        "strength",
        statistic=f"{abs(fitted.gain):.2f} +- {fitted.error:.1g} times what the vehicle file makes of it",
        threshold=f"{WEAKEST_FINS:g} to {STRONGEST_FINS:g} times",
        passed=low <= STRONGEST_FINS and high >= WEAKEST_FINS,
        advice=f"The vehicle answers {axis.given} {abs(fitted.gain):.2g} times as strongly as its file says: look at "
        f"unit and `scale` of {axis.given} in the map, and at its coefficients, mass and inertia in the vehicle file. "
        "Data alone cannot tell a fin that deflects half as far from one that is twice as effective.",
    )
