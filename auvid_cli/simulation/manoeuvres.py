"""A manoeuvre: feedforward inputs and setpoints at each tick, and the autopilot of speed, turn rate, pitch or depth."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, assert_never

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.manoeuvre import (
    AnyManoeuvre,
    Doublets,
    Excitation,
    Lawnmower,
    Multisine,
    MultisineRun,
    Recorded,
    Spiral,
    TurningCircle,
    Zigzag,
)
from auvid_cli.config.units import parse_number
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError
from auvid_cli.numerics import compiled, types
from auvid_cli.regular_files import check_regular_file
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS
from auvid_cli.vehicle.rigid_body import mass_matrix

_vector = types.float64[::1]
_BISECTIONS = 50  # until the interval has the width of a rounding error


class Setpoints(NamedTuple):
    """Commands at each tick, see `ManoeuvrePlan`."""

    time: Array
    feedforward: Array
    speed: Array
    turn_rate: Array


SETPOINTS = types.NamedTuple((_vector, types.float64[:, ::1], _vector, _vector), Setpoints)


class ManoeuvrePlan(NamedTuple):
    """Commands of a manoeuvre."""

    time: Array  # start of each tick, s, shape (n,); inputs are constant during a tick
    # Shape (n, 4); rudder, elevator (rad), surge force (N), roll moment (N m), without the autopilot's part
    feedforward: Array
    speed: Array  # shape (n,); setpoint of the thrust loop, m/s; to brake, the thrust may be negative
    turn_rate: Array  # shape (n,); setpoint of the rudder loop, rad/s
    propulsion: Array  # shape (n, 2) or (n, 0); revolutions (turn/s) and voltage (V), if the manoeuvre has them
    pitch: float = 0.0  # setpoint of the elevator loop, rad; not used by a depth loop
    # Rudder (rad), heading (rad) and approach (s) of a zigzag; the rudder is 0 without a zigzag
    zigzag: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def setpoints(self) -> Setpoints:
        """Return the commands at each tick, for compiled code."""
        return Setpoints(self.time, self.feedforward, self.speed, self.turn_rate)


def make_plan(manoeuvre: AnyManoeuvre) -> ManoeuvrePlan:
    """Return the plan of a manoeuvre.

    Raises
    ------
    ConfigError
        If the file of a recorded manoeuvre cannot be read or ends too early.
    """
    ticks = round(manoeuvre.duration * manoeuvre.input_rate)
    time = np.arange(ticks + 1) / manoeuvre.input_rate
    ramp = _ramp(time, manoeuvre.excitation.fade_in)
    feedforward = _excitation(manoeuvre.excitation, time)
    feedforward *= ramp[:, None]
    first = manoeuvre.speed if manoeuvre.initial_speed is None else manoeuvre.initial_speed
    speed = first + (manoeuvre.speed - first) * ramp
    plan = ManoeuvrePlan(time, feedforward, speed, np.zeros(time.size), _propulsion(manoeuvre, time, ramp))
    match manoeuvre:
        case Spiral():
            return plan._replace(turn_rate=manoeuvre.turn_rate * ramp, pitch=manoeuvre.pitch)
        case Zigzag():
            return plan._replace(zigzag=(manoeuvre.rudder, manoeuvre.heading, manoeuvre.approach))
        case TurningCircle():
            feedforward[time >= manoeuvre.approach, 0] += manoeuvre.rudder
        case Lawnmower():
            return plan._replace(turn_rate=_half_turns(manoeuvre, time) * ramp)
        case Doublets():
            feedforward[:, :2] += _doublets(manoeuvre, time)
        case Recorded():
            feedforward += _recorded(Path(manoeuvre.file), time)
        case MultisineRun():
            pass
        case _:
            assert_never(manoeuvre)
    return plan


def multisine(settings: Multisine, time: Array) -> Array:
    """Return a sum of equal sines with Schroeder phases (1970), which keep the peak low, scaled to `amplitude`."""
    k = np.arange(settings.lines)
    frequencies = np.linspace(settings.lowest, settings.highest, settings.lines)
    phases = settings.phase - np.pi * k * (k + 1) / settings.lines
    signal = np.zeros(time.size)
    for frequency, phase in zip(frequencies, phases, strict=True):
        signal += np.sin(2.0 * np.pi * frequency * time + phase)
    return settings.amplitude * signal / np.abs(signal).max()


def _ramp(time: Array, fade_in: float) -> Array:
    """Return a smooth ramp from 0 to 1.

    A filter with wide priors then starts with a small motion, for which the unknown terms are nearly linear.
    """
    if fade_in == 0.0:
        return np.ones(time.size)
    return np.sin(0.5 * np.pi * np.clip(time / fade_in, 0.0, 1.0)) ** 2


def _propulsion(manoeuvre: AnyManoeuvre, time: Array, ramp: Array) -> Array:
    propeller = manoeuvre.propeller
    if propeller is None:
        return np.zeros((time.size, 0))
    revolutions = np.full(time.size, propeller.revolutions)
    if propeller.excitation is not None:
        revolutions += multisine(propeller.excitation, time)
    last = propeller.voltage if propeller.final_voltage is None else propeller.final_voltage
    voltage = propeller.voltage + (last - propeller.voltage) * time / time[-1]
    return np.column_stack([ramp * revolutions, voltage])


def _excitation(excitation: Excitation, time: Array) -> Array:
    columns = np.zeros((time.size, len(INPUT_SYMBOLS)))
    given = [(column, channel) for column, channel in enumerate(excitation.channels()) if channel is not None]
    for index, (column, channel) in enumerate(given):
        if excitation.orthogonal:
            columns[:, column] = orthogonal_multisine(channel, time, index, len(given))
        else:
            columns[:, column] = multisine(channel, time)
    return columns


def orthogonal_multisine(settings: Multisine, time: Array, index: int, channels: int) -> Array:
    """Return a multisine of a channel's own harmonics, shifted in time so that it starts and ends at zero.

    It has `settings.lines` harmonics, evenly spaced in its band, or all of the band if there are fewer. `time` covers
    the run, whose length is the common period. Channel `index`, from 0, has every `channels`-th harmonic.

    Different harmonics are orthogonal over the run (Morelli, Flight test maneuver design for efficient aerodynamic
    modeling, 2012).
    """
    period = time[-1]
    # The tolerance keeps harmonics at the ends of the band despite rounding.
    first, last = np.ceil(settings.lowest * period - 1e-6), np.floor(settings.highest * period + 1e-6)
    own = np.arange(max(first, 1.0), last + 1.0)
    own = own[own % channels == index]
    own = own[np.unique(np.linspace(0, own.size - 1, min(settings.lines, own.size)).round().astype(int))]
    k = np.arange(own.size)
    phases = settings.phase - np.pi * k * (k + 1) / own.size
    omega = 2.0 * np.pi * own / period
    signal = _sines(omega, phases, time)
    # A zero exists, because all sines have a mean of zero; find it by bisection.
    before = int(np.flatnonzero(np.signbit(signal[1:]) != np.signbit(signal[:-1]))[0])
    low, high = time[before], time[before + 1]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        same_sign = np.signbit(_sines(omega, phases, np.array([middle]))[0]) == np.signbit(signal[before])
        low, high = (middle, high) if same_sign else (low, middle)
    shifted = _sines(omega, phases + omega * low, time)
    return settings.amplitude * shifted / np.abs(shifted).max()


def _sines(omega: Array, phases: Array, time: Array) -> Array:
    return np.sin(np.outer(time, omega) + phases).sum(axis=1)


def _half_turns(manoeuvre: Lawnmower, time: Array) -> Array:
    period = manoeuvre.leg + np.pi / manoeuvre.turn_rate
    leg, within = np.divmod(time, period)
    return np.where(within < manoeuvre.leg, 0.0, manoeuvre.turn_rate * (-1.0) ** leg)


def _doublets(manoeuvre: Doublets, time: Array) -> Array:
    # 3-2-1-1 input of the aircraft-identification literature (Marchand 1977): signs + - + -.
    lengths = np.array([3.0, 2.0, 1.0, 1.0]) * manoeuvre.unit_time
    edges = np.concatenate([[0.0], np.cumsum(lengths)])
    period = edges[-1] + manoeuvre.pause
    within = time % (2.0 * period)
    fins = np.zeros((time.size, 2))
    for channel, amplitude in enumerate((manoeuvre.rudder, manoeuvre.elevator)):
        local = within - channel * period
        for step in range(4):
            active = (local >= edges[step]) & (local < edges[step + 1])
            fins[active, channel] = amplitude * (-1.0) ** step
    return fins


def _recorded(path: Path, time: Array) -> Array:
    """Return the inputs in a CSV file at each tick, constant from row to row."""
    try:
        table = np.array(list(_rows(path))).reshape(-1, 1 + len(INPUT_SYMBOLS))
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: not a recorded manoeuvre: {error}") from None
    if table.shape[0] == 0 or np.any(np.diff(table[:, 0]) <= 0.0):
        raise ConfigError(f"{path}: expected at least one row, with strictly increasing times")
    if table[0, 0] > time[0] or table[-1, 0] < time[-1] - 1.0:
        raise ConfigError(f"{path}: has {table[0, 0]:g} to {table[-1, 0]:g} s; the manoeuvre needs 0 to {time[-1]:g} s")
    return table[np.searchsorted(table[:, 0], time, side="right") - 1, 1:]


def _rows(path: Path) -> Iterator[list[float]]:
    """Yield time and inputs of each row; ValueError with the line if the file is not a table of numbers."""
    names = ("time", *INPUT_SYMBOLS)
    check_regular_file(path)
    with path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.reader(file)
        try:
            header = next(reader, [])
            if wrong := [name for name in names if header.count(name) != 1]:
                raise ValueError(f"no or several columns {', '.join(wrong)}; expected one each of {', '.join(names)}")
            columns = [header.index(name) for name in names]
            for row in filter(None, reader):
                if len(row) != len(header):
                    raise ValueError(f"{len(row)} cells; expected {len(header)} as in the header")
                yield [parse_number(row[column]) for column in columns]
        except (csv.Error, ValueError) as error:
            raise ValueError(f"line {reader.line_num}: {error}") from None


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
