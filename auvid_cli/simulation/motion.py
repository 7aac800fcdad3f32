"""True motion of the vehicle, driven by a plan and its autopilot through actuators with limits."""

from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array, release_memory, zeros
from auvid_cli.config.manoeuvre import AnyManoeuvre
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError, SimulationError
from auvid_cli.numerics import LANES, compiled, types
from auvid_cli.simulation.manoeuvres import (
    CONTROLS,
    INITIAL_MEMORY,
    SETPOINTS,
    ManoeuvrePlan,
    autopilot_controls,
    limited,
    steer,
)
from auvid_cli.vehicle.actuator_motion import ACTUATOR, demanded, effective, moved
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
from auvid_cli.vehicle.parameters import IDEAL, N_ACTUATORS, N_MOTION
from auvid_cli.vehicle.rigid_body import mass_matrix

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]

_ACTUATORS = types.UniTuple(ACTUATOR, N_ACTUATORS)

_NO_TRIM = np.zeros(4)
LONGEST_STEP = 0.0025  # s
LARGEST_PITCH = np.deg2rad(85.0)  # rad
LARGEST_ROLL = np.deg2rad(90.0)  # rad
LARGEST_SPEED = 100.0  # m/s
# Number of ticks, or of samples of a sensor, that are computed at once; memory is released after each block.
BLOCK = 50_000
# Why a simulation stops, by the code of `_reason_to_stop`.
_REASONS = (
    "",
    "pitch within 5 deg of vertical, where Euler angles are singular",
    "the vehicle capsized (roll passed 90 deg)",
    "the motion diverged (not finite, or faster than 100 m/s)",
)


class Truth(NamedTuple):
    """True motion at the ticks of the plan."""

    time: Array  # shape (n,)
    inputs: Array  # shape (n, 4) or (n, 6); mean actual inputs from this tick to the next, SI
    commands: Array  # shape (n, 4) or (n, 6); commands of the actuators; equal to `inputs` if the actuators are ideal
    motion: Array  # shape (n, 9); u, v, w, p, q, r, phi, theta, psi
    position: Array  # shape (n, 3); north, east, down, m
    disturbance: Array  # shape (n, 6); acceleration by the disturbance from this tick to the next, m/s^2 and rad/s^2
    constants: Array  # from `vehicle_constants`
    coefficients: Array  # from `factors`


_TRUTH = types.NamedTuple((_vector, *[_matrix] * 5, *[_vector] * 2), Truth)


class _Workspace(NamedTuple):
    """Work arrays of a simulation."""

    memory: Array  # memory of the autopilot, see `INITIAL_MEMORY`
    block: Array  # shape (N_BLOCK,); motion in the first lane
    velocity: Array  # shape (3, 3); velocity over ground at the start, middle and end of a substep, m/s
    step: Array  # shape (N_WORK,); scratch of a Runge-Kutta step
    positions: Array  # shape (N_ACTUATORS,); positions of the actuators, SI


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
    vehicle, manoeuvre, plan
    disturbance : ndarray, shape (n, 6)
        Force (N) and moment (N m) in addition to those of the model, from each tick to the next.
    longest_step : float
        s.
    trim : ndarray, shape (4,)
        Part of the planned inputs that is not a command and bypasses the actuators, SI.

    Raises
    ------
    SimulationError
        If roll, pitch or speed leave the range of the model; the message has the time.
    ConfigError
        If the mass matrix is not positive definite, a coefficient has no value, or an input of an own term is missing.
    """
    if message := manoeuvre.missing_propulsion(vehicle.coefficient_set):
        raise ConfigError(message)
    parameters = vehicle.known_parameters()
    constants = vehicle_constants(parameters, vehicle.coefficient_set.terms)
    acceleration = np.zeros(disturbance.shape)
    # Pages of zeros that are never written take no memory.
    if disturbance.any():
        acceleration[:] = np.linalg.solve(mass_matrix(parameters), disturbance.T).T
    coefficients = factors(vehicle.all_coefficients(), of_vehicle=vehicle.coefficient_set)
    controls = autopilot_controls(vehicle, manoeuvre, plan)
    n = plan.time.size
    motion, position, inputs = zeros((n, N_MOTION)), zeros((n, 3)), zeros((n, 4 + plan.propulsion.shape[1]))
    motion[0, 0] = plan.speed[0] if manoeuvre.initial_speed is None else manoeuvre.initial_speed
    motion[0, 7] = manoeuvre.initial_pitch
    work = _Workspace(
        np.array(INITIAL_MEMORY), np.zeros(N_BLOCK), np.zeros((3, 3)), np.zeros(N_WORK), np.zeros(N_ACTUATORS)
    )
    actuators = vehicle.actuators.actuators()
    has_dynamics = any(actuator != IDEAL for actuator in actuators)
    # With ideal actuators, `inputs` and `commands` share one array.
    commands = zeros((n if has_dynamics else 0, inputs.shape[1]))
    (commands if has_dynamics else inputs)[:, 4:] = plan.propulsion
    truth = Truth(
        plan.time, inputs, commands, motion, position, acceleration, constants, np.repeat(coefficients, LANES)
    )
    for first in range(0, n, BLOCK):
        ticks = first, min(first + BLOCK, n)
        reason, tick = _simulate(ticks, plan.setpoints, controls, tuple(actuators), trim, truth, longest_step, work)
        if reason:
            raise SimulationError(
                f"the simulation of {vehicle.name} stopped at t = {plan.time[tick]:.2f} s: {_REASONS[reason]}; "
                "reduce the excitation or let the autopilot control pitch, turn rate and speed"
            )
        release_memory()
    return truth._replace(coefficients=coefficients, commands=commands if has_dynamics else inputs)


@compiled()
def _velocity_over_ground(block, velocity):
    """Compute the velocity in the NED frame, eqs. (1) and (2), of the motion in lane 0."""
    u, v, w = block[0], block[LANES], block[2 * LANES]
    sin_phi, cos_phi = sine_cosine(block[6 * LANES])
    sin_theta, cos_theta = sine_cosine(block[7 * LANES])
    sin_psi, cos_psi = sine_cosine(block[8 * LANES])
    ahead = cos_theta * u + sin_theta * (sin_phi * v + cos_phi * w)
    aside = cos_phi * v - sin_phi * w
    velocity[0] = cos_psi * ahead - sin_psi * aside
    velocity[1] = sin_psi * ahead + cos_psi * aside
    velocity[2] = -sin_theta * u + cos_theta * (sin_phi * v + cos_phi * w)


@compiled()
def _accelerate(block, acceleration, duration):
    """Add acceleration times duration to the velocities in lane 0."""
    for i in range(6):
        block[i * LANES] += duration * acceleration[i]


@compiled()
def _move(truth, tick, step, position, work):
    """Integrate motion and, by Simpson's rule, position over a step.

    The disturbance acts by half before and by half after each half step (Strang splitting).
    """
    block, velocity, coefficients, inputs = work.block, work.velocity, truth.coefficients, truth.inputs[tick]
    acceleration = truth.disturbance[tick]
    _velocity_over_ground(block, velocity[0])
    for half in range(1, 3):
        _accelerate(block, acceleration, 0.25 * step)
        runge_kutta_step(block, coefficients, inputs, truth.constants, 1, 0.5 * step, work.step)
        _accelerate(block, acceleration, 0.25 * step)
        _velocity_over_ground(block, velocity[half])
    for axis in range(3):
        position[axis] += step / 6.0 * (velocity[0, axis] + 4.0 * velocity[1, axis] + velocity[2, axis])


@compiled()
def _reason_to_stop(motion):
    total = 0.0
    for i in range(N_MOTION):
        total += motion[i]
    if not np.isfinite(total) or abs(motion[0]) > LARGEST_SPEED:
        return 3
    if abs(motion[7]) > LARGEST_PITCH:
        return 1
    return 2 if abs(motion[6]) > LARGEST_ROLL else 0


@compiled()
def _limit_fins(controls, before, now, change):
    """Limit the angles of the fins, and their change to `change`.

    On an x tail the rudder is half the sum of two fins, and the elevator half their difference.
    """
    shared = controls.shared_fins
    first, second = now[0] - shared * now[1], now[1] + shared * now[0]
    was_first, was_second = before[0] - shared * before[1], before[1] + shared * before[0]
    first = min(max(limited(first, controls.fin_angle), was_first - change), was_first + change)
    second = min(max(limited(second, controls.fin_angle), was_second - change), was_second + change)
    half = 1.0 / (1.0 + shared)
    now[0], now[1] = half * (first + shared * second), half * (second - shared * first)


@compiled()
def _move_actuators(actuators, trim, tick, period, truth, positions):
    """Integrate the actuators over a tick and store the inputs; they start at the first command."""
    commands, inputs = truth.commands[tick], truth.inputs[tick]
    for k in range(N_ACTUATORS, inputs.size):
        inputs[k] = commands[k]
    for k in range(N_ACTUATORS):
        demand = demanded(actuators[k], commands[k] - trim[k])
        if tick == 0:
            positions[k] = demand
        positions[k], mean = moved(actuators[k], positions[k], demand, period)
        inputs[k] = effective(actuators[k], mean) + trim[k]


_TICKS = types.UniTuple(types.int64, 2)


@compiled(_TICKS(_TICKS, SETPOINTS, CONTROLS, _ACTUATORS, _vector, _TRUTH, types.float64, _WORKSPACE))
def _simulate(ticks, setpoints, controls, actuators, trim, truth, longest_step, work):
    """Fill in motion, position and inputs of `truth` for the ticks `ticks[0]` to `ticks[1] - 1`.

    Returns the code in `_REASONS`, 0 for success, and the tick.
    """
    time, motion, position, block = truth.time, truth.motion, truth.position, work.block
    has_dynamics = truth.commands.size > 0
    commands = truth.commands if has_dynamics else truth.inputs
    for i in range(N_MOTION):
        block[i * LANES] = motion[ticks[0], i]
    n = time.size
    for tick in range(ticks[0], ticks[1]):
        period = time[tick + 1] - time[tick] if tick + 1 < n else time[tick] - time[tick - 1]
        now = commands[tick]
        steer(controls, setpoints, tick, period, position[tick, 2], motion[tick], work.memory, now)
        # No limit of the rate at the first tick.
        _limit_fins(controls, commands[tick - 1], now, controls.fin_rate * period if tick > 0 else np.inf)
        if has_dynamics:
            _move_actuators(actuators, trim, tick, period, truth, work.positions)
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
def _sample(time, record, constants, coefficients, times, block, slope, work):
    inputs, motion, acceleration, sampled, rate = record
    tick, now = -1, time[0]
    for k in range(times.size):
        before = tick
        while tick < 0 or (tick + 1 < time.size and time[tick + 1] <= times[k]):
            tick += 1
        if tick != before:
            now = time[tick]
            for i in range(N_MOTION):
                block[i * LANES] = motion[tick, i]
        substeps = int(np.ceil(2.0 * (times[k] - now) / LONGEST_STEP))
        for _ in range(substeps):
            step = (times[k] - now) / substeps
            _accelerate(block, acceleration[tick], 0.5 * step)
            runge_kutta_step(block, coefficients, inputs[tick], constants, 1, step, work)
            _accelerate(block, acceleration[tick], 0.5 * step)
        now = times[k]
        motion_derivative(block, coefficients, inputs[tick], constants, 1, slope)
        _accelerate(slope, acceleration[tick], 1.0)
        for i in range(N_MOTION):
            sampled[k, i], rate[k, i] = block[i * LANES], slope[i * LANES]


def sample_motion(truth: Truth, times: Array) -> tuple[Array, Array]:
    """Return true motion and its time derivative at increasing times, integrated from the tick before each.

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
