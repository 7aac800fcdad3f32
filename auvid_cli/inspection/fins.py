"""Linear motion of the vehicle file, effectiveness of its fins, and trim of the rudder."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from auvid_cli.arrays import Array
from auvid_cli.config.sanity import MAX_FIN_STRENGTH, MIN_FIN_STRENGTH
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.checks import Check
from auvid_cli.data.signals import response_to_rates
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.kinematic_relations import Signals, attitude_window, change, fit, rates_by_sensor
from auvid_cli.inspection.responses import AXES, RotationAxis, moment, response_window
from auvid_cli.inspection.velocity import mean_speed
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS
from auvid_cli.vehicle.rigid_body import coriolis_matrix, mass_matrix, restoring_vector

_ACROSS = ("v", "w", "p", "q", "r")
_LINEAR_STATES = ("u", *_ACROSS, "phi", "theta")
_FORCE_ROWS = {"surge_force": 0, "roll_moment": 3}  # row of the equations of motion for each input
_MEAN_MODULUS = np.sqrt(2.0 / np.pi)  # mean modulus of a Gaussian signal, in standard deviations
# For each rate, the states that change with it; others are constant.
_FREE_STATES = {"p": ("p", "phi"), "q": ("w", "q", "theta"), "r": ("v", "r")}
_INPUTS = {axis.rate: axis.input for axis in AXES}
_ROLL_STEP = 1e-4  # rad, step of a difference quotient
_STRENGTH_SIGMAS = 3.0
_MIN_CORRELATION = 0.9  # partial correlation from which an effectiveness is known
_MIN_EXPLAINED_SHARE = 0.3  # share of the change of the rate that the fin explains
_MIN_INDEPENDENT_WINDOWS = 40.0  # fewer come from one turn, or from a fin that only follows the motion
_MAX_TRIM = np.deg2rad(0.5)
_TRIM_SIGMAS = 5.0
# Smallest share of a constant rudder's effect that is independent of turning. It is smaller if there is hardly any
# straight course, or if turns are to one side only.
_MIN_TRIM_SHARE = 0.9
_MAX_MEAN_ROLL = np.deg2rad(2.0)  # with more, for example from propeller torque, the elevator turns the vehicle too
_YAW = AXES[2]


class LinearMotion(NamedTuple):
    """Linear equations of motion."""

    # Shape (8, 8); derivative of the rates of change of u, v, w, p, q, r, roll and pitch by these states
    by_state: Array
    # By input, shape (8,); derivative of these rates by a force or moment, or by a fin angle times speed squared
    by_input: dict[str, Array]

    def pulse_responses(self, rate: str, states: Sequence[str], given: str, step: float, cells: int) -> Array:
        """Return the change of a rate at the end of `cells` steps due to a unit input in each step, shape (cells,).

        `states` move with the rate, others are held; `given` is the input, `step` in s.
        """
        at = [_LINEAR_STATES.index(state) for state in states]
        size = len(at)
        # With the input as a constant state, one matrix exponential contains the transition and the input's effect.
        joint = np.zeros((size + 1, size + 1))
        joint[:size, :size], joint[:size, size] = self.by_state[np.ix_(at, at)], self.by_input[given][at]
        transition = expm(step * joint)
        added, responses = transition[:size, size], np.empty(cells)
        for k in reversed(range(cells)):
            responses[k] = added[[*states].index(rate)]
            added = transition[:size, :size] @ added
        return responses


def linear_motion(vehicle: VehicleSettings, speed: float, spreads: Mapping[str, float]) -> LinearMotion | None:
    """Return linear equations of motion of a vehicle file at a speed, m/s; None if it states no coefficients.

    `spreads` are standard deviations of the other velocities, SI, if known: ``|v| v`` acts like ``sqrt(8/pi) sigma v``.
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
            for symbol in {*coefficient.signals}:
                slope = share * _slope(coefficient, symbol, at)
                if symbol in fins:
                    fins[symbol][coefficient.row] += slope / speed**2
                elif symbol in _LINEAR_STATES[:6]:
                    forces[coefficient.row, _LINEAR_STATES.index(symbol)] += slope
    ahead, unit = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]), np.eye(6)
    for k in range(6):
        more, less = (coriolis_matrix(mass, at) @ at for at in (ahead + unit[k], ahead - unit[k]))
        forces[:, k] -= 0.5 * (more - less)
    for k in range(2):
        more, less = (restoring_vector(parameters, sign * _ROLL_STEP * unit[k, :3]) for sign in (1.0, -1.0))
        forces[:, 6 + k] = (more - less) / (2.0 * _ROLL_STEP)
    by_state = np.zeros((8, 8))
    by_state[:6] = np.linalg.solve(mass, forces)
    by_state[6, 3] = by_state[7, 4] = 1.0
    by_force = dict(fins) | {given: unit[row] for given, row in _FORCE_ROWS.items()}
    by_input = {given: np.append(np.linalg.solve(mass, force), [0.0, 0.0]) for given, force in by_force.items()}
    return LinearMotion(by_state, by_input)


def _slope(coefficient: Coefficient, symbol: str, at: Mapping[str, float]) -> float:
    """Return the derivative of a regressor by one of its signals (product rule); fins and thrust are zero."""
    total, factors = 0.0, [*zip(coefficient.signals, coefficient.moduli, strict=True)]
    for k, (signal, modulus) in enumerate(factors):
        if signal == symbol:
            slope = float(np.sign(at.get(signal, 0.0))) if modulus else 1.0
            for other, is_modulus in factors[:k] + factors[k + 1 :]:
                value = at.get(other, 0.0)
                slope *= abs(value) if is_modulus else value
            total += slope
    return total


def motion_of(signals: Signals, vehicle: VehicleSettings) -> LinearMotion | None:
    """Return the linear equations about the measured motion; None without speed or coefficients."""
    speed = mean_speed(signals)
    if speed is None:
        return None
    across = {symbol: signals.values[symbol] for symbol in "vw" if signals.has(symbol)}
    by_sensor = {symbol: rates_by_sensor(signals, symbol) for symbol in "pqr"}
    across |= {symbol: next(iter(rates.values())) for symbol, rates in by_sensor.items() if rates}
    sizes = {s: float(np.nanstd(values)) for s, values in across.items() if np.isfinite(values).any()}
    return linear_motion(vehicle, speed, sizes)


class PredictedResponse(NamedTuple):
    """Change of a rate over a window, and the part that an input should cause."""

    change: Array  # rad/s, from each cell on
    predicted: Array  # from the vehicle file, rad/s; without its coefficients in another unit
    covariates: list[Array]  # other causes of a change
    window: int  # cells


def predicted_response(
    signals: Signals, axis: RotationAxis, motion: LinearMotion | None, window: int
) -> PredictedResponse | None:
    """Return the change of a rate over a window of cells with its prediction; None without moving input or rate.

    Covariates are the motion at the start of the window, linear and as cross-flow, so that an autopilot, whose inputs
    follow the motion, does not count; for pitch also the effect of a turn.
    """
    force, rates = moment(signals, axis), rates_by_sensor(signals, axis.rate)
    if force is None or not rates:
        return None
    name, rate = next(iter(rates.items()))
    predicted = sum_pulses(force, pulse_responses(signals, axis, motion, window))
    covariates = _covariates(signals, axis)
    if name != "gyroscope":
        # Smoothed like a rate from angles.
        half = attitude_window(signals, "psi" if name == "attitude" else "heading") // 2
        predicted, *covariates = (
            response_to_rates(values, signals.grid.step, half) for values in (predicted, *covariates)
        )
    covariates = [rate, *covariates]
    cross_flow = [np.abs(values) * values for values in covariates]
    return PredictedResponse(change(rate, window), predicted, [*covariates, *cross_flow], window)


def pulse_responses(signals: Signals, axis: RotationAxis, motion: LinearMotion | None, window: int) -> Array:
    """Return the change of a rate at the end of a window due to a unit input in each cell; equal without `motion`."""
    if motion is None:
        return np.full(window, signals.grid.step)
    return motion.pulse_responses(axis.rate, _FREE_STATES[axis.rate], _INPUTS[axis.rate], signals.grid.step, window)


def sum_pulses(force: Array, responses: Array) -> Array:
    """Return the change over each window from the means of the input between the middles of cells."""
    between = 0.5 * (force[:-1] + force[1:])
    added = np.full(force.size, np.nan)
    if between.size >= responses.size:
        added[: between.size - responses.size + 1] = np.convolve(between, responses[::-1], "valid")
    return added


def _covariates(signals: Signals, axis: RotationAxis) -> list[Array]:
    value = signals.values
    covariates = [value[s] for s in axis.covariates if signals.has(s) and s not in INPUT_SYMBOLS]
    turning = [*rates_by_sensor(signals, "r").values()][:1]
    if axis.rate == "q" and turning:
        sideways = [value["v"] * turning[0], value["v"] ** 2] if signals.has("v") else []
        covariates += [turning[0] ** 2, *sideways]
    return covariates


def strength_checks(signals: Signals, motion: LinearMotion | None, time_constant: float | None) -> list[Check]:
    """Check the effectiveness of both fins against the vehicle file's `motion`, where the data show it.

    `signals` have aligned inputs; `time_constant` is that of the vehicle, s.
    """
    if motion is None:
        return []
    checks = (_strength(signals, axis, motion, time_constant) for axis in AXES[1:])
    return [check for check in checks if check is not None]


def _strength(signals: Signals, axis: RotationAxis, motion: LinearMotion, time_constant: float | None) -> Check | None:
    # Within half a window the result depends less on the file's damping.
    window = max(response_window(signals, axis, time_constant) // 2, 2)
    response = predicted_response(signals, axis, motion, window)
    fitted = response and fit(response.change, response.predicted, response.covariates, response.window)
    if not response or not fitted or abs(fitted.correlation) < _MIN_CORRELATION:
        return None
    explained = abs(fitted.gain) * fitted.spread
    if fitted.independent < _MIN_INDEPENDENT_WINDOWS or explained < _MIN_EXPLAINED_SHARE * np.nanstd(response.change):
        return None
    low, high = (abs(fitted.gain) + sign * _STRENGTH_SIGMAS * fitted.error for sign in (-1.0, 1.0))
    return judged(
        axis.input,
        "strength",
        statistic=f"{abs(fitted.gain):.2f} +- {fitted.error:.1g} times that of the vehicle file",
        threshold=f"{MIN_FIN_STRENGTH:g} to {MAX_FIN_STRENGTH:g} times",
        passed=low <= MAX_FIN_STRENGTH and high >= MIN_FIN_STRENGTH,
        advice=f"The vehicle responds to {axis.input} {abs(fitted.gain):.2g} times as strongly as its file predicts. "
        f"Check the unit and `scale` of {axis.input} in the map, and its coefficients, the mass and the inertia in the "
        "vehicle file. Data alone cannot distinguish half the deflection from twice the effectiveness.",
    )


class RudderTrim(NamedTuple):
    """Recorded rudder angle on a straight course, rad, and its standard error."""

    angle: float
    error: float

    @property
    def is_significant(self) -> bool:
        """Whether the trim is significantly larger than 0.5 deg."""
        return abs(self.angle) > _MAX_TRIM + _TRIM_SIGMAS * self.error


def rudder_trim(signals: Signals, motion: LinearMotion | None, time_constant: float | None) -> RudderTrim | None:
    """Return the recorded rudder angle at which the heading does not turn; 0 is expected of a symmetric vehicle.

    None if the rudder does not move, the mean roll is large, hardly any course is straight, or all turns are to one
    side. `signals` have aligned inputs. `motion` weights the rudder over the time in which it acts. The turn rate comes
    from the heading, because a gyroscope's bias would look like a turn.
    """
    turns = moment(signals, _YAW)
    rates = {name: rate for name, rate in rates_by_sensor(signals, _YAW.rate).items() if name != "gyroscope"}
    if turns is None or not rates or _mean_roll_is_large(signals):
        return None
    ((name, rate),) = rates.items()
    window = response_window(signals, _YAW, time_constant)
    half = attitude_window(signals, "psi" if name == "attitude" else "heading") // 2
    pulses = pulse_responses(signals, _YAW, motion, window)
    per_angle = signals.values["u"] ** 2 if signals.has("u") else np.ones(signals.grid.cells)
    given, per_angle, before = (
        response_to_rates(values, signals.grid.step, half)
        for values in (sum_pulses(turns, pulses), sum_pulses(per_angle, pulses), rate)
    )
    covariates = [change(rate, window), before, np.abs(before) * before]
    fitted = fit(given, per_angle, covariates, window, constant=False)
    if fitted is None or not fitted.spread**2 >= _MIN_TRIM_SHARE * np.nanmean(per_angle**2):
        return None
    return RudderTrim(fitted.gain, fitted.error)


def _mean_roll_is_large(signals: Signals) -> bool:
    roll = signals.values.get("phi", np.zeros(1))
    finite = roll[np.isfinite(roll)]
    return bool(finite.size) and abs(float(finite.mean())) > _MAX_MEAN_ROLL


def rudder_trim_checks(trim: RudderTrim | None) -> list[Check]:
    """Check the trim if the data determine it to 1 deg."""
    if trim is None or _TRIM_SIGMAS * trim.error > 2.0 * _MAX_TRIM:
        return []
    angle, error = np.rad2deg(trim)
    return [
        judged(
            "rudder",
            "trim",
            statistic=f"{angle:.2f} +- {error:.1g} deg on a straight course",
            threshold=f"<= {np.rad2deg(_MAX_TRIM):.2g} deg",
            passed=None if trim.is_significant else True,
            advice=f"The vehicle goes straight at a recorded rudder of {np.degrees(trim.angle):.3g} deg: its zero is "
            "wrong, the hull is bent, or the vehicle heels (mean roll). Set `centre` or `offset` in the map, or "
            "estimate the trim "
            "(`identification.estimate.biases: [fin_trim]`).",
        )
    ]
