"""Rows and constants of the compiled model, and its coefficients."""

from collections import namedtuple
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.config.extra_states import ERROR_BLOCKS
from auvid_cli.config.moving_states import FURTHER_STATES
from auvid_cli.identification.states import StateLayout
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.equations import N_CONSTANTS, N_FACTORS, NO_ERRORS, n_terms, term_place, with_table_at_end
from auvid_cli.vehicle.parameters import DISTURBANCE, N_MOTION

Array = NDArray[np.float64]
_vector = types.float64[::1]
# States that compiled code looks for by name, with where their rows stand among themselves: moving states beside the
# motion, and errors that do not just add to a sensor. They stand at the end of the constants, behind the vehicle, the
# 22 held values, one scale for each estimated coefficient, the vehicle's own terms, how what disturbs fades, and the
# known sensors, and before the number of parameters.
_SYMBOLS = (
    *(state.quantity.symbol for state in FURTHER_STATES),
    *(
        quantity.symbol
        for block in ERROR_BLOCKS
        if not (block.additive or block.shifts)
        for quantity in block.quantities
    ),
)
_Rows = namedtuple("_Rows", _SYMBOLS)
ROW = _Rows(*range(len(_SYMBOLS)))
HELD = N_CONSTANTS
SCALE = N_CONSTANTS + N_COEFFICIENTS
_NOWHERE = -1
_N_ROWS = len(ROW)
_N_KNOWN = 4
# Blocks that the compiled process moves, or is made of, without being asked.
_OF_EVERY_MODEL = "coefficients", "motion"
N_ERRORS = len(NO_ERRORS)
_indices = types.int64[::1]


class KnownSensor(NamedTuple):
    """A sensor of which compiled code knows a vector.

    Attributes
    ----------
    sensor : int
        Its row in `auvid_cli.filters.problem.Sensors`; negative if none is used.
    vector : tuple of float
        Of an accelerometer where it sits, forward, starboard and down of the origin, m; of a magnetometer the field of
        the earth, north, east and down, T.
    """

    sensor: int
    vector: tuple[float, float, float]


NOT_USED = KnownSensor(_NOWHERE, (0.0, 0.0, 0.0))


class KnownSensors(NamedTuple):
    """The accelerometer and the magnetometer of three axes that are used."""

    accelerometer: KnownSensor = NOT_USED
    magnetometer: KnownSensor = NOT_USED


NONE_KNOWN = KnownSensors()


# Which of them; a number and a vector each, and where the first begins, from the end of the constants.
ACCELEROMETER, MAGNETOMETER = range(len(KnownSensors._fields))


_SENSORS = 1 + _N_ROWS + _N_KNOWN * len(KnownSensors._fields)


# Before them how fast what disturbs each axis fades, and before that the fastest, 0 if nothing does.
_FADING = _SENSORS + len(DISTURBANCE)


_FASTEST = _FADING + 1


def model_constants(vehicle: Array, held: Array, layout: StateLayout, known: KnownSensors) -> Array:
    """Lay out the constants of an augmented model; see `auvid_cli.identification.process.vehicle_process`.

    Parameters
    ----------
    vehicle : ndarray
        From `vehicle_constants`.
    held : ndarray
        SI, of each coefficient of the vehicle; of those that are estimated any number.
    layout : StateLayout
    known : KnownSensors
    """
    compiled_in = {
        quantity.symbol
        for block in layout.blocks
        if block.name not in _OF_EVERY_MODEL and not (block.error is not None and block.error.additive)
        for quantity in block.quantities
    }
    if not compiled_in <= {*_SYMBOLS}:
        raise TypeError(f"no compiled code knows of {', '.join(sorted(compiled_in - {*_SYMBOLS}))}")
    rows = [row if (row := layout.row(symbol)) is not None else _NOWHERE for symbol in _SYMBOLS]
    scale = layout.scale[layout.rows_of("coefficients")]
    time_constants = {block.name: block.error.time_constant for block in layout.blocks if block.error is not None}
    fading = [1.0 / time_constants.get(quantity.symbol, np.inf) for quantity in DISTURBANCE]
    sensors = [number for sensor in known for number in (sensor.sensor, *sensor.vector)]
    of_22, of_terms = held[:N_COEFFICIENTS], held[N_COEFFICIENTS:]
    model = with_table_at_end(vehicle, of_terms, np.concatenate([of_22, scale]))
    return np.concatenate([model, [max(fading)], fading, sensors, rows, [layout.n_parameters]])


@compiled(types.int64(_vector), internal=True)
def first_moving_row(constants):
    """Return the row of the first moving state, behind all parameters; the motion begins there."""
    return int(constants[constants.size - 1])


@compiled(types.int64(_vector, types.int64), internal=True)
def row_of(constants, which):
    """Return the row of the state at which one of `ROW` stands; negative if nowhere."""
    return int(constants[constants.size - 1 - _N_ROWS + which])


@compiled(types.int64(_vector, types.int64), internal=True)
def known_sensor(constants, which):
    """Return which sensor `ACCELEROMETER` or `MAGNETOMETER` is; negative if it is not used."""
    return int(constants[constants.size - _SENSORS + _N_KNOWN * which])


@compiled(types.UniTuple(types.float64, 3)(_vector, types.int64), internal=True)
def known_vector(constants, which):
    """Return the vector of `ACCELEROMETER` or `MAGNETOMETER`, see `KnownSensor`."""
    place = constants.size - _SENSORS + _N_KNOWN * which + 1
    return constants[place], constants[place + 1], constants[place + 2]


@compiled(types.boolean(_vector), internal=True)
def depth_is_state(constants):
    """Say whether it is."""
    return row_of(constants, ROW.down) >= 0


@compiled(types.boolean(_vector), internal=True)
def is_disturbed(constants):
    """Say whether a disturbing force or moment is a state."""
    return constants[constants.size - _FASTEST] > 0.0


def place_of_fading_rate(constants: Array, axis: int) -> int:
    """Return where the rate at which the disturbance of an axis fades stands among the constants."""
    return constants.size - _FADING + axis


@compiled(types.float64(_vector, types.int64), internal=True)
def fading_rate(constants, axis):
    """Return how fast the disturbing force or moment of an axis fades, 1/s; 0 if it is no state."""
    return constants[constants.size - _FADING + axis]


@compiled(types.float64(_vector, types.int64, _vector, _vector, types.int64), internal=True)
def value_of(constants, which, parameters, moving, k):
    """Return one lane of one of `ROW`, parameter or moving state; 0 if it is no state."""
    row, n_parameters = row_of(constants, which), first_moving_row(constants)
    if row < 0:
        return 0.0
    return parameters[row * LANES + k] if row < n_parameters else moving[(row - n_parameters) * LANES + k]


@compiled(types.void(_vector, _vector, _vector, _indices, types.uint64, _vector), inline=True)
def fill_in_lanes(moving, parameters, constants, selection, n_lanes, coefficients):
    """Fill in the coefficients, estimated or held, the actuators' errors and the ballast of a block of states.

    Parameters
    ----------
    moving, parameters : ndarray
        Blocks of them.
    constants, selection : ndarray
        Of the process.
    n_lanes : int
    coefficients : ndarray, shape ((N_FACTORS + terms) * LANES,)
    """
    j = 0
    for m in range(N_COEFFICIENTS):
        row = coefficients[m * LANES : (m + 1) * LANES]
        if j < selection.size and selection[j] == m:
            scale, scaled = constants[SCALE + j], parameters[j * LANES : (j + 1) * LANES]
            for k in range(n_lanes):
                row[k] = scale * scaled[k]
            j += 1
        else:
            for k in range(n_lanes):
                row[k] = constants[HELD + m]
    for a in range(N_ERRORS):
        error = coefficients[(N_COEFFICIENTS + a) * LANES : (N_COEFFICIENTS + a + 1) * LANES]
        which = (ROW.thrust_scale, ROW.rudder_trim, ROW.elevator_trim, ROW.excess_buoyancy, ROW.trim_moment)[a]
        for k in range(n_lanes):
            error[k] = NO_ERRORS[a]
        if row_of(constants, which) >= 0:
            for k in range(n_lanes):
                error[k] += value_of(constants, which, parameters, moving, k)
    for t in range(n_terms(constants)):
        row = coefficients[(N_FACTORS + t) * LANES : (N_FACTORS + t + 1) * LANES]
        if j < selection.size and selection[j] == N_FACTORS + t:
            scale, scaled = constants[SCALE + j], parameters[j * LANES : (j + 1) * LANES]
            for k in range(n_lanes):
                row[k] = scale * scaled[k]
            j += 1
        else:
            for k in range(n_lanes):
                row[k] = constants[term_place(constants, t)]


@compiled(types.void(_vector, _vector, _indices, _vector), internal=True)
def fill_in_all(mean, constants, selection, coefficients):
    """Do the same of one state: `coefficients` has shape (N_FACTORS + terms,)."""
    for m in range(N_COEFFICIENTS):
        coefficients[m] = constants[HELD + m]
    for t in range(n_terms(constants)):
        coefficients[N_FACTORS + t] = constants[term_place(constants, t)]
    for j in range(selection.size):
        coefficients[selection[j]] = constants[SCALE + j] * mean[j]
    for a in range(N_ERRORS):
        which = (ROW.thrust_scale, ROW.rudder_trim, ROW.elevator_trim, ROW.excess_buoyancy, ROW.trim_moment)[a]
        row = row_of(constants, which)
        coefficients[N_COEFFICIENTS + a] = NO_ERRORS[a] + mean[row] if row >= 0 else NO_ERRORS[a]


@compiled(types.void(_vector, _vector, _indices, _vector), internal=True)
def fill_in_row(sensitivity, constants, selection, row):
    """Copy a derivative by the motion and all factors to a row of derivatives by the state; others stay."""
    n_coefficients, n_parameters = selection.size, first_moving_row(constants)
    for j in range(n_coefficients):
        row[j] = sensitivity[N_MOTION + selection[j]] * constants[SCALE + j]
    for j in range(N_MOTION):
        row[n_parameters + j] = sensitivity[j]
    for a in range(N_ERRORS):
        which = (ROW.thrust_scale, ROW.rudder_trim, ROW.elevator_trim, ROW.excess_buoyancy, ROW.trim_moment)[a]
        error = row_of(constants, which)
        if error >= 0:
            row[error] = sensitivity[N_MOTION + N_COEFFICIENTS + a]
