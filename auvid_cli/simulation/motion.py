"""True motion: the vehicle under a plan, its autopilot and the limits of its fins."""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.blocks import LANES
from auvid_cli.compilation import compiled
from auvid_cli.config.manoeuvre import AnyManoeuvre, Recorded
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import SimulationError
from auvid_cli.simulation.plan import Plan
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.dynamics import (
    N_BLOCK,
    N_COEFFICIENT_BLOCK,
    N_WORK,
    motion_derivative,
    runge_kutta_step,
    sine_cosine,
    vehicle_constants,
)
from auvid_cli.vehicle.parameters import N_MOTION

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]

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
    inputs : ndarray, shape (n, 4)
        What the actuators did from this tick to the next.
    motion : ndarray, shape (n, 9)
        u, v, w, p, q, r, phi, theta, psi.
    position : ndarray, shape (n, 3)
        North, east, down, m.
    constants, coefficients : ndarray
        The vehicle, as `vehicle_constants` and as the 22 true coefficients.
    """

    time: Array
    inputs: Array
    motion: Array
    position: Array
    constants: Array
    coefficients: Array


def simulate_motion(
    vehicle: VehicleSettings, manoeuvre: AnyManoeuvre, plan: Plan, longest_step: float = LONGEST_STEP
) -> Truth:
    """Integrate the true motion (fourth-order Runge-Kutta, pairs of half steps of at most `longest_step`, s).

    Raises
    ------
    SimulationError
        If the vehicle capsizes, stands on its nose or blows up; says when.
    ConfigError
        If the vehicle has no positive-definite mass matrix or lacks coefficients.
    """
    stated = vehicle.all_coefficients()
    known = vehicle.known_parameters()
    constants = vehicle_constants(known)
    coefficients = np.array([stated[symbol] for symbol in SYMBOLS])
    autopilot, limits = manoeuvre.autopilot, manoeuvre.limits
    depth_hold = autopilot.vertical == "depth"
    # Per newton of thrust, so that an idle propeller makes no torque.
    torque = known["K_prop"] / known["X_prop"] if known["X_prop"] else 0.0
    drag = -stated["X_u|u|"]
    if isinstance(manoeuvre, Recorded):
        # What was recorded is all the thrust and torque there was.
        torque = drag = 0.0
    controls = np.array(
        [
            drag,
            constants[0] * autopilot.bandwidth * float(autopilot.speed),
            vehicle.size.length / manoeuvre.speed,
            np.copysign(autopilot.bandwidth, stated["N_uudr"]) * float(autopilot.horizontal == "turn_rate"),
            np.copysign(autopilot.bandwidth, stated["M_uude"]) * float(autopilot.vertical != "none"),
            plan.pitch,
            float(depth_hold) / (10.0 * vehicle.size.length),
            limits.fin_angle,
            limits.fin_rate,
            limits.surge_force,
            torque,
            np.copysign(plan.zigzag[0], stated["N_uudr"]) if plan.zigzag[0] else 0.0,
            plan.zigzag[1],
            plan.zigzag[2],
        ]
    )
    n = plan.time.size
    motion, position, inputs = np.zeros((n, N_MOTION)), np.zeros((n, 3)), np.zeros((n, 4))
    motion[0, 0] = plan.speed[0] if manoeuvre.initial_speed is None else manoeuvre.initial_speed
    motion[0, 7] = manoeuvre.initial_pitch
    reason, tick = _fly(
        plan.time,
        plan.feedforward,
        plan.speed,
        plan.turn_rate,
        controls,
        constants,
        coefficients,
        longest_step,
        motion,
        position,
        inputs,
    )
    if reason:
        raise SimulationError(
            f"the simulation of {vehicle.name} stopped at t = {plan.time[tick]:.2f} s: {_REASONS[reason]}; "
            "soften the excitation or let the autopilot hold pitch, turn rate and speed"
        )
    return Truth(plan.time, inputs, motion, position, constants, coefficients)


@compiled(types.void(_vector, _vector))
def _velocity_over_ground(block, velocity):
    """Velocity in the NED frame, eqs. (1) and (2), of the state in lane 0."""
    u, v, w = block[0], block[LANES], block[2 * LANES]
    sin_phi, cos_phi = sine_cosine(block[6 * LANES])
    sin_theta, cos_theta = sine_cosine(block[7 * LANES])
    sin_psi, cos_psi = sine_cosine(block[8 * LANES])
    ahead = cos_theta * u + sin_theta * (sin_phi * v + cos_phi * w)
    aside = cos_phi * v - sin_phi * w
    velocity[0] = cos_psi * ahead - sin_psi * aside
    velocity[1] = sin_psi * ahead + cos_psi * aside
    velocity[2] = -sin_theta * u + cos_theta * (sin_phi * v + cos_phi * w)


@compiled(
    types.UniTuple(types.int64, 2)(
        *(_vector, _matrix, _vector, _vector, _vector, _vector, _vector), types.float64, _matrix, _matrix, _matrix
    )
)
def _fly(
    time, feedforward, speed, turn_rate, controls, constants, coefficients, longest_step, motion, position, inputs
):
    """Fill in motion, position and inputs; returns (reason, tick), reason 0 if all went well."""
    drag, surge_gain, length_time = controls[0], controls[1], controls[2]
    rudder_gain, elevator_gain, pitch, depth_gain = controls[3], controls[4], controls[5], controls[6]
    fin_angle, fin_rate, largest_force, torque = controls[7], controls[8], controls[9], controls[10]
    zigzag_rudder, zigzag_heading, zigzag_start = controls[11], controls[12], controls[13]

    block, work = np.zeros(N_BLOCK), np.zeros(N_WORK)
    coefficient_block = np.zeros(N_COEFFICIENT_BLOCK)
    coefficient_block[::LANES] = coefficients
    block[::LANES] = motion[0]
    start, middle, end = np.zeros(3), np.zeros(3), np.zeros(3)
    speed_integral, turn_integral, pitch_integral, side = 0.0, 0.0, 0.0, 1.0
    fins = np.zeros(2)
    n = time.size
    for tick in range(n):
        period = time[tick + 1] - time[tick] if tick + 1 < n else time[tick] - time[tick - 1]
        u, q, r = motion[tick, 0], motion[tick, 4], motion[tick, 5]
        theta, psi = motion[tick, 7], motion[tick, 8]

        speed_error = speed[tick] - u
        speed_integral += 0.2 * surge_gain * speed_error * period
        force = drag * speed[tick] ** 2 + surge_gain * speed_error + speed_integral + feedforward[tick, 2]
        force = min(max(force, -largest_force), largest_force)

        turn_error = turn_rate[tick] - r
        turn_integral += turn_error * period
        turn_integral = min(max(turn_integral, -fin_angle), fin_angle)
        rudder = rudder_gain * (1.5 * length_time * turn_error + turn_integral) + feedforward[tick, 0]
        if zigzag_rudder != 0.0 and time[tick] >= zigzag_start:
            if side * psi >= zigzag_heading:
                side = -side
            rudder += side * zigzag_rudder

        wanted = pitch
        if depth_gain > 0.0:
            wanted = min(max(depth_gain * position[tick, 2], -0.35), 0.35)
        pitch_error = wanted - theta
        pitch_integral += 0.3 * pitch_error / length_time * period
        pitch_integral = min(max(pitch_integral, -fin_angle), fin_angle)
        elevator = elevator_gain * (1.5 * pitch_error - 1.5 * length_time * q + pitch_integral)
        elevator += feedforward[tick, 1]

        for fin, command in ((0, rudder), (1, elevator)):
            target = min(max(command, -fin_angle), fin_angle)
            if tick == 0:
                fins[fin] = target
            else:
                change = fin_rate * period
                fins[fin] = min(max(target, fins[fin] - change), fins[fin] + change)
        inputs[tick, 0], inputs[tick, 1] = fins[0], fins[1]
        inputs[tick, 2], inputs[tick, 3] = force, torque * force + feedforward[tick, 3]
        if tick + 1 == n:
            break

        substeps = int(np.ceil(period / longest_step - 1e-9))
        step = period / substeps
        for axis in range(3):
            position[tick + 1, axis] = position[tick, axis]
        for _ in range(substeps):
            # Position by Simpson's rule on half steps: as accurate as the motion itself.
            _velocity_over_ground(block, start)
            runge_kutta_step(block, coefficient_block, inputs[tick], constants, 1, 0.5 * step, work)
            _velocity_over_ground(block, middle)
            runge_kutta_step(block, coefficient_block, inputs[tick], constants, 1, 0.5 * step, work)
            _velocity_over_ground(block, end)
            for axis in range(3):
                position[tick + 1, axis] += step / 6.0 * (start[axis] + 4.0 * middle[axis] + end[axis])
        motion[tick + 1] = block[::LANES]

        finite = True
        for i in range(N_MOTION):
            finite = finite and np.isfinite(motion[tick + 1, i])
        if not finite or abs(motion[tick + 1, 0]) > LARGEST_SPEED:
            return 3, tick + 1
        if abs(motion[tick + 1, 7]) > LARGEST_PITCH:
            return 1, tick + 1
        if abs(motion[tick + 1, 6]) > LARGEST_ROLL:
            return 2, tick + 1
    return 0, n - 1


@compiled(types.void(_vector, _matrix, _matrix, _vector, _vector, _vector, _matrix, _matrix))
def _sample(time, inputs, motion, constants, coefficients, wanted, sampled, rate):
    block, work, slope = np.zeros(N_BLOCK), np.zeros(N_WORK), np.zeros(N_BLOCK)
    coefficient_block = np.zeros(N_COEFFICIENT_BLOCK)
    coefficient_block[::LANES] = coefficients
    tick, now = 0, time[0]
    block[::LANES] = motion[0]
    for k in range(wanted.size):
        while tick + 1 < time.size and time[tick + 1] <= wanted[k]:
            tick += 1
            now = time[tick]
            block[::LANES] = motion[tick]
        substeps = int(np.ceil(2.0 * (wanted[k] - now) / LONGEST_STEP))
        for _ in range(substeps):
            step = (wanted[k] - now) / substeps
            runge_kutta_step(block, coefficient_block, inputs[tick], constants, 1, step, work)
        now = wanted[k]
        motion_derivative(block, coefficient_block, inputs[tick], constants, 1, slope)
        sampled[k] = block[::LANES]
        rate[k] = slope[::LANES]


def sample_motion(truth: Truth, times: Array) -> tuple[Array, Array]:
    """True motion and its time derivative at any increasing times, by integrating on from the tick before.

    Returns
    -------
    motion, derivative : ndarray, shape (len(times), 9)
    """
    sampled, rate = np.zeros((times.size, N_MOTION)), np.zeros((times.size, N_MOTION))
    _sample(truth.time, truth.inputs, truth.motion, truth.constants, truth.coefficients, times, sampled, rate)
    return sampled, rate
