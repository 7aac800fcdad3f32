"""True motion: the vehicle under a plan, its autopilot and the limits of its fins."""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.config.manoeuvre import AnyManoeuvre
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError, SimulationError
from auvid_cli.lanes import LANES
from auvid_cli.simulation.autopilot import CONTROLS, INITIAL_MEMORY, autopilot_controls, limited, steer
from auvid_cli.simulation.manoeuvres import SETPOINTS, ManoeuvrePlan
from auvid_cli.vehicle.actuator_motion import ACTUATOR, demanded, effective, moved
from auvid_cli.vehicle.actuators import IDEAL, N_ACTUATORS
from auvid_cli.vehicle.equations import (
    N_BLOCK,
    N_SLOPE,
    N_WORK,
    factors,
    motion_derivative,
    runge_kutta_step,
    sine_cosine,
    vehicle_constants,
)
from auvid_cli.vehicle.matrices import mass_matrix
from auvid_cli.vehicle.parameters import N_MOTION

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]

_ACTUATORS = types.UniTuple(ACTUATOR, N_ACTUATORS)

_NO_TRIM = np.zeros(4)
LONGEST_STEP = 0.0025
LARGEST_PITCH = np.deg2rad(85.0)
LARGEST_ROLL = np.deg2rad(90.0)
LARGEST_SPEED = 100.0
_REASONS = (
    "",
    "pitch came within 5 deg of vertical, where Euler angles are singular",
    "the vehicle capsized (roll passed 90 deg)",
    "the motion blew up (not finite, or faster than 100 m/s)",
)


class Truth(NamedTuple):
    """True motion on the ticks of the plan.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs : ndarray, shape (n, 4) or (n, 6)
        What the actuators did from this tick to the next, on the average.
    commands : ndarray, shape (n, 4) or (n, 6)
        What they followed; the same where they do so exactly.
    motion : ndarray, shape (n, 9)
        u, v, w, p, q, r, phi, theta, psi.
    position : ndarray, shape (n, 3)
        North, east, down, m.
    push : ndarray, shape (n, 6)
        Acceleration, m/s^2 and rad/s^2, by what disturbs the motion from this tick to the next.
    constants, coefficients : ndarray
        The vehicle, as `vehicle_constants` and as `factors`.
    """

    time: Array
    inputs: Array
    commands: Array
    motion: Array
    position: Array
    disturbance: Array
    constants: Array
    coefficients: Array


_TRUTH = types.NamedTuple((_vector, *[_matrix] * 5, *[_vector] * 2), Truth)


class _Workspace(NamedTuple):
    """What a flight works with.

    Attributes
    ----------
    memory : ndarray, shape (4,)
        Of the autopilot, see `INITIAL_MEMORY`.
    block : ndarray, shape (N_BLOCK,)
        The motion in the first lane of a block.
    velocity : ndarray, shape (3, 3)
        Over ground, at the beginning, the middle and the end of a substep.
    step : ndarray, shape (N_WORK,)
        For a Runge-Kutta step.
    fins : ndarray, shape (N_ACTUATORS,)
        Where the actuators are.
    """

    memory: Array
    block: Array
    velocity: Array
    step: Array
    fins: Array


_WORKSPACE = types.NamedTuple((_vector, _vector, _matrix, _vector, _vector), _Workspace)


def simulate_motion(
    vehicle: VehicleSettings,
    manoeuvre: AnyManoeuvre,
    plan: ManoeuvrePlan,
    disturbance: Array,
    longest_step: float = LONGEST_STEP,
    trim: Array = _NO_TRIM,
) -> Truth:
    """Integrate the true motion (fourth-order Runge-Kutta, pairs of half steps of at most `longest_step`, s).

    Parameters
    ----------
    vehicle : VehicleSettings
    manoeuvre : AnyManoeuvre
    plan : ManoeuvrePlan
    disturbance : ndarray, shape (n, 6)
        Force, N, and moment, N m, beside those of the model, from each tick to the next.
    longest_step : float
        s.
    trim : ndarray, shape (4,)
        What of the planned inputs is no command: it acts whatever the actuators do.

    Raises
    ------
    SimulationError
        If the vehicle capsizes, stands on its nose or blows up; says when.
    ConfigError
        If the vehicle has no positive-definite mass matrix or lacks coefficients, or the manoeuvre inputs of its terms.
    """
    if lacking := manoeuvre.missing_propulsion(vehicle.coefficient_set):
        raise ConfigError(lacking)
    known = vehicle.known_parameters()
    constants = vehicle_constants(known, vehicle.coefficient_set.terms)
    push = np.zeros(disturbance.shape)
    # Of an undisturbed run of hours nothing is touched, and takes no memory.
    if disturbance.any():
        push[:] = np.linalg.solve(mass_matrix(known), disturbance.T).T
    coefficients = factors(vehicle.all_coefficients(), of_vehicle=vehicle.coefficient_set)
    controls = autopilot_controls(vehicle, manoeuvre, plan)
    n = plan.time.size
    motion, position, inputs = np.zeros((n, N_MOTION)), np.zeros((n, 3)), np.zeros((n, 4 + plan.propulsion.shape[1]))
    motion[0, 0] = plan.speed[0] if manoeuvre.initial_speed is None else manoeuvre.initial_speed
    motion[0, 7] = manoeuvre.initial_pitch
    work = _Workspace(
        np.array(INITIAL_MEMORY), np.zeros(N_BLOCK), np.zeros((3, 3)), np.zeros(N_WORK), np.zeros(N_ACTUATORS)
    )
    actuators = vehicle.actuators.actuators()
    follows = any(actuator != IDEAL for actuator in actuators)
    # Where actuators do as they are told, nothing is written down twice.
    commands = np.zeros((n if follows else 0, inputs.shape[1]))
    (commands if follows else inputs)[:, 4:] = plan.propulsion
    truth = Truth(plan.time, inputs, commands, motion, position, push, constants, np.repeat(coefficients, LANES))
    reason, tick = _fly(plan.setpoints, controls, tuple(actuators), trim, truth, longest_step, work)
    if reason:
        raise SimulationError(
            f"the simulation of {vehicle.name} stopped at t = {plan.time[tick]:.2f} s: {_REASONS[reason]}; "
            "soften the excitation or let the autopilot hold pitch, turn rate and speed"
        )
    return truth._replace(coefficients=coefficients, commands=commands if follows else inputs)


@compiled(types.void(_vector, _vector), internal=True)
def _velocity_over_ground(block, velocity):
    """Find the velocity in the NED frame, eqs. (1) and (2), of the state in lane 0."""
    u, v, w = block[0], block[LANES], block[2 * LANES]
    sin_phi, cos_phi = sine_cosine(block[6 * LANES])
    sin_theta, cos_theta = sine_cosine(block[7 * LANES])
    sin_psi, cos_psi = sine_cosine(block[8 * LANES])
    ahead = cos_theta * u + sin_theta * (sin_phi * v + cos_phi * w)
    aside = cos_phi * v - sin_phi * w
    velocity[0] = cos_psi * ahead - sin_psi * aside
    velocity[1] = sin_psi * ahead + cos_psi * aside
    velocity[2] = -sin_theta * u + cos_theta * (sin_phi * v + cos_phi * w)


@compiled(types.void(_vector, _vector, types.float64), internal=True)
def _push(block, push, duration):
    """Let a disturbance act for so long on the state in lane 0: before and after a step, for half of it each."""
    for i in range(6):
        block[i * LANES] += duration * push[i]


@compiled(types.void(_TRUTH, types.int64, types.float64, _vector, _WORKSPACE), internal=True)
def _move(truth, tick, step, position, work):
    """Integrate motion and position; Simpson's rule on half steps is as accurate as the motion itself."""
    block, velocity, coefficients, inputs = work.block, work.velocity, truth.coefficients, truth.inputs[tick]
    push = truth.push[tick]
    _velocity_over_ground(block, velocity[0])
    for half in range(1, 3):
        _push(block, push, 0.25 * step)
        runge_kutta_step(block, coefficients, inputs, truth.constants, 1, 0.5 * step, work.step)
        _push(block, push, 0.25 * step)
        _velocity_over_ground(block, velocity[half])
    for axis in range(3):
        position[axis] += step / 6.0 * (velocity[0, axis] + 4.0 * velocity[1, axis] + velocity[2, axis])


@compiled(types.int64(_vector), internal=True)
def _reason_to_stop(motion):
    total = 0.0
    for i in range(N_MOTION):
        total += motion[i]
    if not np.isfinite(total) or abs(motion[0]) > LARGEST_SPEED:
        return 3
    if abs(motion[7]) > LARGEST_PITCH:
        return 1
    return 2 if abs(motion[6]) > LARGEST_ROLL else 0


@compiled(types.void(CONTROLS, _vector, _vector, types.float64), internal=True)
def _limit_fins(controls, before, now, change):
    """Keep fins to their angle, and to so much of a change.

    Of an x tail half the sum of two fins is the rudder, half the difference the elevator.
    """
    shared = controls.shared_fins
    first, second = now[0] - shared * now[1], now[1] + shared * now[0]
    was_first, was_second = before[0] - shared * before[1], before[1] + shared * before[0]
    first = min(max(limited(first, controls.fin_angle), was_first - change), was_first + change)
    second = min(max(limited(second, controls.fin_angle), was_second - change), was_second + change)
    half = 1.0 / (1.0 + shared)
    now[0], now[1] = half * (first + shared * second), half * (second - shared * first)


@compiled(types.void(_ACTUATORS, _vector, types.int64, types.float64, _TRUTH, _vector), internal=True)
def _act(actuators, trim, tick, period, truth, places):
    """Let the actuators follow the commands of a tick; before the first they rest in it."""
    commands, inputs = truth.commands[tick], truth.inputs[tick]
    for k in range(N_ACTUATORS, inputs.size):
        inputs[k] = commands[k]
    for k in range(N_ACTUATORS):
        demand = demanded(actuators[k], commands[k] - trim[k])
        if tick == 0:
            places[k] = demand
        places[k], mean = moved(actuators[k], places[k], demand, period)
        inputs[k] = effective(actuators[k], mean) + trim[k]


@compiled(types.UniTuple(types.int64, 2)(SETPOINTS, CONTROLS, _ACTUATORS, _vector, _TRUTH, types.float64, _WORKSPACE))
def _fly(wanted, controls, actuators, trim, truth, longest_step, work):
    """Fill in motion, position and inputs; returns (reason, tick), reason 0 if all went well."""
    time, motion, position, block = truth.time, truth.motion, truth.position, work.block
    follows = truth.commands.size > 0
    commands = truth.commands if follows else truth.inputs
    for i in range(N_MOTION):
        block[i * LANES] = motion[0, i]
    n = time.size
    for tick in range(n):
        period = time[tick + 1] - time[tick] if tick + 1 < n else time[tick] - time[tick - 1]
        now = commands[tick]
        steer(controls, wanted, tick, period, position[tick, 2], motion[tick], work.memory, now)
        # Before the first tick fins are where they have to be.
        _limit_fins(controls, commands[tick - 1], now, controls.fin_rate * period if tick > 0 else np.inf)
        if follows:
            _act(actuators, trim, tick, period, truth, work.fins)
        if tick + 1 == n:
            break

        substeps = int(np.ceil(period / longest_step - 1e-9))
        for axis in range(3):
            position[tick + 1, axis] = position[tick, axis]
        for _ in range(substeps):
            _move(truth, tick, period / substeps, position[tick + 1], work)
        for i in range(N_MOTION):
            motion[tick + 1, i] = block[i * LANES]
        reason = _reason_to_stop(motion[tick + 1])
        if reason:
            return reason, tick + 1
    return 0, n - 1


@compiled(
    types.void(_vector, types.UniTuple(_matrix, 5), _vector, _vector, _vector, _vector, _vector, _vector),
)
def _sample(time, record, constants, coefficients, wanted, block, slope, work):
    inputs, motion, push, sampled, rate = record
    tick, now = -1, time[0]
    for k in range(wanted.size):
        before = tick
        while tick < 0 or (tick + 1 < time.size and time[tick + 1] <= wanted[k]):
            tick += 1
        if tick != before:
            now = time[tick]
            for i in range(N_MOTION):
                block[i * LANES] = motion[tick, i]
        substeps = int(np.ceil(2.0 * (wanted[k] - now) / LONGEST_STEP))
        for _ in range(substeps):
            step = (wanted[k] - now) / substeps
            _push(block, push[tick], 0.5 * step)
            runge_kutta_step(block, coefficients, inputs[tick], constants, 1, step, work)
            _push(block, push[tick], 0.5 * step)
        now = wanted[k]
        motion_derivative(block, coefficients, inputs[tick], constants, 1, slope)
        _push(slope, push[tick], 1.0)
        for i in range(N_MOTION):
            sampled[k, i], rate[k, i] = block[i * LANES], slope[i * LANES]


def sample_motion(truth: Truth, times: Array) -> tuple[Array, Array]:
    """Find true motion and its time derivative at any increasing times, by integrating on from the tick before.

    Returns
    -------
    motion, derivative : ndarray, shape (len(times), 9)
    """
    sampled, rate = np.zeros((times.size, N_MOTION)), np.zeros((times.size, N_MOTION))
    record, coefficients = (
        (truth.inputs, truth.motion, truth.disturbance, sampled, rate),
        np.repeat(truth.coefficients, LANES),
    )
    work = np.zeros(N_BLOCK), np.zeros(N_SLOPE), np.zeros(N_WORK)
    _sample(truth.time, record, truth.constants, coefficients, times, *work)
    return sampled, rate
