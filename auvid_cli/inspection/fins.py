"""Fin effectiveness in small motions, and the trim of the rudder."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from auvid_cli.config.sanity import STRONGEST_FINS, WEAKEST_FINS
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.checks import Check
from auvid_cli.data.signals import response_to_rates
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_relations import Signals, attitude_window, change, fit, rates_by_sensor
from auvid_cli.inspection.responses import AXES, RotationAxis, answer_window, moment
from auvid_cli.inspection.velocity import mean_speed
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.matrices import coriolis_matrix, mass_matrix, restoring_vector
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

Array = NDArray[np.float64]
_ACROSS = ("v", "w", "p", "q", "r")
_SMALL_STATES = ("u", *_ACROSS, "phi", "theta")
# Row of the equations of motion that an input which is no fin acts in.
_ROWS = {"surge_force": 0, "roll_moment": 3}
# Of a Gaussian signal: its mean modulus over its standard deviation.
_MEAN_MODULUS = np.sqrt(2.0 / np.pi)
# What moves along with a rate, the others held, and the input that it answers, whatever the columns are called.
_FIN_STATES = {"p": ("p", "phi"), "q": ("w", "q", "theta"), "r": ("v", "r")}
_ANSWERED = {axis.rate: axis.given for axis in AXES}
# Standard deviations by which a strength is beyond what is plausible.
_FIN_SIGMAS = 3.0
# What tells a strength: partial correlation, share of the change that the input explains, and windows that are as good
# as independent. Fewer are of one turn, or of a fin that only answers the motion.
_LEAST_CORRELATION, _LEAST_FIN_SHARE, _FEWEST_WINDOWS = 0.9, 0.3, 40.0
# rad, of a fin in the middle; standard deviations by which it is off that.
_USUAL, _TRIM_SIGMAS = np.deg2rad(0.5), 5.0
# Share of what a constant rudder would do that must go with no turning: less is of a course that is hardly ever
# straight, or turns to one side only.
_LEAST_TRIM_SHARE = 0.9
# rad: where the vehicle lies over by more, as by the torque of its propeller, its elevator turns it as well.
_LEVEL = np.deg2rad(2.0)
_YAW = AXES[2]


class SmallMotion(NamedTuple):
    """Linear equations of motion.

    Attributes
    ----------
    by_state : ndarray, shape (8, 8)
        Rates of change of u, v, w, p, q, r, roll and pitch, by each of them.
    by_input : dict of ndarray, shape (8,)
        By input: of a fin by its angle times the square of the speed, of others by their force or moment.
    """

    by_state: Array
    by_input: dict[str, Array]

    def answer(self, rate: str, states: Sequence[str], given: str, step: float, cells: int) -> Array:
        """Return how much each of some steps of a unit input, one after the other, changes a rate by the end of all.

        Parameters
        ----------
        rate : str
        states : sequence of str
            What moves with it; all others are held.
        given : str
            The input.
        step : float
            s.
        cells : int
            How many steps.

        Returns
        -------
        ndarray, shape (cells,)
            That of the first step first.
        """
        at = [_SMALL_STATES.index(state) for state in states]
        size = len(at)
        # The input as a state that does not change: one exponential has the step's transition and what it adds.
        joint = np.zeros((size + 1, size + 1))
        joint[:size, :size], joint[:size, size] = self.by_state[np.ix_(at, at)], self.by_input[given][at]
        transition = expm(step * joint)
        added, answers = transition[:size, size], np.empty(cells)
        for k in reversed(range(cells)):
            answers[k] = added[[*states].index(rate)]
            added = transition[:size, :size] @ added
        return answers


def small_motion(vehicle: VehicleSettings, speed: float, spreads: Mapping[str, float]) -> SmallMotion | None:
    """Make the equations of motion of a vehicle file linear; None of a file that states no coefficients.

    Parameters
    ----------
    vehicle : VehicleSettings
    speed : float
        Along the axis, m/s.
    spreads : mapping of str to float
        Standard deviations of the other velocities, SI, as far as they are known: ``|v| v`` acts as
        ``sqrt(8/pi) sigma v`` does.
    """
    stated = vehicle.stated_coefficients()
    if any(c.symbol not in stated for c in vehicle.coefficient_set):
        return None
    parameters = vehicle.known_parameters()
    mass = mass_matrix(parameters)
    forces, fins = np.zeros((6, 8)), {fin: np.zeros(6) for fin in ("rudder", "elevator")}
    sizes = [_MEAN_MODULUS * spreads.get(symbol, 0.0) for symbol in _ACROSS]
    patterns = [*product((1.0, -1.0), repeat=len(_ACROSS))]
    for pattern in patterns:
        at = dict(zip(_ACROSS, np.multiply(pattern, sizes), strict=True)) | {"u": speed}
        for coefficient in vehicle.coefficient_set:
            share = stated[coefficient.symbol] / len(patterns)
            for k, symbol in enumerate(_SMALL_STATES[:6]):
                forces[coefficient.row, k] += share * _slope(coefficient, symbol, at)
            for fin, by_fin in fins.items():
                by_fin[coefficient.row] += share * _slope(coefficient, fin, at) / speed**2
    ahead, unit = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]), np.eye(6)
    for k in range(6):
        more, less = (coriolis_matrix(mass, at) @ at for at in (ahead + unit[k], ahead - unit[k]))
        forces[:, k] -= 0.5 * (more - less)
    for k in range(2):
        more, less = (restoring_vector(parameters, sign * 1e-4 * unit[k, :3]) for sign in (1.0, -1.0))
        forces[:, 6 + k] = (more - less) / 2e-4
    by_state = np.zeros((8, 8))
    by_state[:6] = np.linalg.solve(mass, forces)
    by_state[6, 3] = by_state[7, 4] = 1.0
    by_force = dict(fins) | {given: unit[row] for given, row in _ROWS.items()}
    by_input = {given: np.append(np.linalg.solve(mass, force), [0.0, 0.0]) for given, force in by_force.items()}
    return SmallMotion(by_state, by_input)


def _slope(coefficient: Coefficient, symbol: str, at: Mapping[str, float]) -> float:
    """Differentiate a regressor by one of its signals, by the product rule; fins and thrust are at zero."""
    total, factors = 0.0, [*zip(coefficient.signals, coefficient.moduli, strict=True)]
    for k, (signal, modulus) in enumerate(factors):
        if signal == symbol:
            slope = float(np.sign(at.get(signal, 0.0))) if modulus else 1.0
            for other, is_modulus in factors[:k] + factors[k + 1 :]:
                value = at.get(other, 0.0)
                slope *= abs(value) if is_modulus else value
            total += slope
    return total


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
    return motion.answer(axis.rate, _FIN_STATES[axis.rate], _ANSWERED[axis.rate], signals.grid.step, window)


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
    if fitted.independent < _FEWEST_WINDOWS or abs(fitted.gain) * fitted.spread < _LEAST_FIN_SHARE * np.nanstd(
        answer.change
    ):
        return None
    low, high = (abs(fitted.gain) + sign * _FIN_SIGMAS * fitted.error for sign in (-1.0, 1.0))
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


class RudderTrim(NamedTuple):
    """What the rudder stands on a straight course, rad, and its standard error."""

    angle: float
    error: float

    @property
    def is_off(self) -> bool:
        """Say whether it is off the middle beyond doubt, and by more than a little."""
        return abs(self.angle) > _USUAL + _TRIM_SIGMAS * self.error


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
    if fitted is None or not fitted.spread**2 >= _LEAST_TRIM_SHARE * np.nanmean(per_angle**2):
        return None
    return RudderTrim(fitted.gain, fitted.error)


def _lies_over(signals: Signals) -> bool:
    roll = signals.values.get("phi", np.zeros(1))
    known = roll[np.isfinite(roll)]
    return bool(known.size) and abs(float(known.mean())) > _LEVEL


def rudder_trim_checks(found: RudderTrim | None) -> list[Check]:
    """Judge it, where the data tell it to a degree."""
    if found is None or _TRIM_SIGMAS * found.error > 2.0 * _USUAL:
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
