"""Autopilot of the simulation: control loops of speed, turn rate and pitch or depth, plus the excitation."""

from typing import NamedTuple

import numpy as np

from auvid_cli.config.manoeuvre import AnyManoeuvre, Recorded
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.numerics import compiled, types
from auvid_cli.simulation.manoeuvres import ManoeuvrePlan
from auvid_cli.vehicle.matrices import mass_matrix


class Controls(NamedTuple):
    """Gains and limits of an autopilot, SI; a gain is 0 if its loop is off."""

    drag: float  # thrust divided by the square of the speed setpoint
    surge_gain: float  # thrust divided by the speed error
    length_time: float  # vehicle's length divided by the speed of the manoeuvre, s
    rudder_gain: float
    elevator_gain: float
    pitch: float  # setpoint without a depth loop, rad
    depth_gain: float
    fin_angle: float  # limit, rad
    fin_rate: float  # limit, rad/s
    largest_force: float  # limit, N
    shared_fins: float  # 1 if each fin turns for both rudder and elevator, as on an x tail, else 0
    torque: float  # roll moment of the propeller divided by its thrust, m
    zigzag_rudder: float  # rad
    zigzag_heading: float  # heading at which the rudder is reversed, rad
    zigzag_start: float  # s


_vector = types.float64[::1]
CONTROLS = types.NamedUniTuple(types.float64, len(Controls._fields), Controls)
# Integrals of the errors of speed, turn rate and pitch, and the side of a zigzag.
INITIAL_MEMORY = (0.0, 0.0, 0.0, 1.0)


def autopilot_controls(vehicle: VehicleSettings, manoeuvre: AnyManoeuvre, plan: ManoeuvrePlan) -> Controls:
    """Return the autopilot of a manoeuvre, tuned to a vehicle; ConfigError if the vehicle is invalid or incomplete."""
    coefficients, parameters = vehicle.all_coefficients(), vehicle.known_parameters()
    autopilot, limits, geometry = manoeuvre.autopilot, manoeuvre.limits, vehicle.geometry
    # Proportional to thrust, so that an idle propeller has no torque.
    torque = parameters["K_prop"] / parameters["X_prop"] if parameters["X_prop"] else 0.0
    drag = -coefficients["X_u|u|"]
    if isinstance(manoeuvre, Recorded):
        # The recorded inputs include all thrust and torque.
        torque = drag = 0.0
    if manoeuvre.propeller is not None:
        # The terms with revolutions, not the autopilot, balance the drag.
        drag = 0.0
    return Controls(
        drag=drag,
        surge_gain=mass_matrix(parameters)[0, 0] * autopilot.bandwidth * float(autopilot.speed),
        length_time=vehicle.size.length / manoeuvre.speed,
        rudder_gain=np.copysign(autopilot.bandwidth, coefficients["N_uudr"])
        * float(autopilot.horizontal == "turn_rate"),
        elevator_gain=np.copysign(autopilot.bandwidth, coefficients["M_uude"]) * float(autopilot.vertical != "none"),
        pitch=plan.pitch,
        depth_gain=float(autopilot.vertical == "depth") / (10.0 * vehicle.size.length),
        fin_angle=limits.fin_angle,
        fin_rate=limits.fin_rate,
        largest_force=limits.surge_force,
        shared_fins=float(geometry is not None and geometry.fins.tail == "x"),
        torque=torque,
        zigzag_rudder=np.copysign(plan.zigzag[0], coefficients["N_uudr"]) if plan.zigzag[0] else 0.0,
        zigzag_heading=plan.zigzag[1],
        zigzag_start=plan.zigzag[2],
    )


@compiled()
def limited(value, limit):
    """Return the value, limited to +-limit."""
    return min(max(value, -limit), limit)


@compiled()
def steer(controls, setpoints, tick, period, depth, motion, memory, inputs):
    """Compute the `inputs` of a tick, shape (4,): rudder and elevator without limits (rad), force (N), torque (N m).

    `period` is that of the tick (s), `depth` in m, `motion` has shape (9,), and `memory` starts as `INITIAL_MEMORY`.
    """
    time, speed, turn_rate = setpoints.time[tick], setpoints.speed[tick], setpoints.turn_rate[tick]
    feedforward = setpoints.feedforward[tick]
    speed_error = speed - motion[0]
    memory[0] += 0.2 * controls.surge_gain * speed_error * period
    force = controls.drag * speed**2 + controls.surge_gain * speed_error + memory[0] + feedforward[2]
    force = limited(force, controls.largest_force)

    turn_error = turn_rate - motion[5]
    memory[1] = limited(memory[1] + turn_error * period, controls.fin_angle)
    rudder = controls.rudder_gain * (1.5 * controls.length_time * turn_error + memory[1]) + feedforward[0]
    if controls.zigzag_rudder != 0.0 and time >= controls.zigzag_start:
        if memory[3] * motion[8] >= controls.zigzag_heading:
            memory[3] = -memory[3]
        rudder += memory[3] * controls.zigzag_rudder

    pitch = limited(controls.depth_gain * depth, 0.35) if controls.depth_gain > 0.0 else controls.pitch
    pitch_error = pitch - motion[7]
    memory[2] = limited(memory[2] + 0.3 * pitch_error / controls.length_time * period, controls.fin_angle)
    elevator = 1.5 * pitch_error - 1.5 * controls.length_time * motion[4] + memory[2]
    inputs[0], inputs[1] = rudder, controls.elevator_gain * elevator + feedforward[1]
    inputs[2], inputs[3] = force, controls.torque * force + feedforward[3]
