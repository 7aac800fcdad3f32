"""Constants of the compiled model, and the coefficients that it computes from a state.

Order of the constants: those of the vehicle (`auvid_cli.vehicle.equations.vehicle_constants`), the 22 held values, one
scale for each estimated coefficient, the table of the vehicle's own terms, the fastest rate of decay of a disturbance
(0 if there is none), the rate of each axis, the known sensors (row and vector each), the rows of `ROW`, and the number
of parameters.
"""

from collections import namedtuple
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.extra_states import ERROR_BLOCKS, FURTHER_STATES
from auvid_cli.identification.states import StateLayout
from auvid_cli.numerics import LANES, compiled, types
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.equations import N_CONSTANTS, N_FACTORS, NO_ERRORS, n_terms, term_place, with_table_at_end
from auvid_cli.vehicle.parameters import DISTURBANCE, N_MOTION

_vector = types.float64[::1]
# States that compiled code looks up by name: moving states other than the motion, and errors that are not additive.
_SYMBOLS = (
    *(state.quantity.symbol for state in FURTHER_STATES),
    *(
        quantity.symbol
        for block in ERROR_BLOCKS
        if not (block.additive or block.is_delay)
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
# Blocks that compiled code finds by their place in the state instead of a name.
_OF_EVERY_MODEL = "coefficients", "motion"
N_ERRORS = len(NO_ERRORS)
_indices = types.int64[::1]


class KnownSensor(NamedTuple):
    """A sensor with a constant vector."""

    sensor: int  # row in `auvid_cli.filters.problem.Sensors`; negative if it is not used
    # Position of an accelerometer in body axes, m; for a magnetometer the field north, east and down, T
    vector: tuple[float, float, float]


NOT_USED = KnownSensor(_NOWHERE, (0.0, 0.0, 0.0))


class KnownSensors(NamedTuple):
    """The accelerometer and the magnetometer of three axes."""

    accelerometer: KnownSensor = NOT_USED
    magnetometer: KnownSensor = NOT_USED


NONE_KNOWN = KnownSensors()
ACCELEROMETER = KnownSensors._fields.index("accelerometer")
MAGNETOMETER = KnownSensors._fields.index("magnetometer")
# Places counted from the end of the constants: of the known sensors, the decay rates, and the fastest of these.
_SENSORS = 1 + _N_ROWS + _N_KNOWN * len(KnownSensors._fields)
_FADING = _SENSORS + len(DISTURBANCE)
_FASTEST = _FADING + 1


def model_constants(vehicle: Array, held: Array, layout: StateLayout, known: KnownSensors) -> Array:
    """Return the constants of an augmented model.

    Parameters
    ----------
    vehicle : ndarray
        From `vehicle_constants`.
    held : ndarray
        Value of each coefficient of the vehicle, SI; ignored for those that are estimated.
    layout : StateLayout
    known : KnownSensors

    Raises
    ------
    TypeError
        If the state has a component that no compiled code handles.
    """
    compiled_in = {
        quantity.symbol
        for block in layout.blocks
        if block.name not in _OF_EVERY_MODEL and not (block.error is not None and block.error.additive)
        for quantity in block.quantities
    }
    if not compiled_in <= {*_SYMBOLS}:
        raise TypeError(f"no compiled code handles {', '.join(sorted(compiled_in - {*_SYMBOLS}))}")
    rows = [row if (row := layout.row(symbol)) is not None else _NOWHERE for symbol in _SYMBOLS]
    scale = layout.scale[layout.rows_of("coefficients")]
    time_constants = {block.name: block.error.time_constant for block in layout.blocks if block.error is not None}
    fading = [1.0 / time_constants.get(quantity.symbol, np.inf) for quantity in DISTURBANCE]
    sensors = [number for sensor in known for number in (sensor.sensor, *sensor.vector)]
    of_22, of_terms = held[:N_COEFFICIENTS], held[N_COEFFICIENTS:]
    model = with_table_at_end(vehicle, of_terms, np.concatenate([of_22, scale]))
    return np.concatenate([model, [max(fading)], fading, sensors, rows, [layout.n_parameters]])


@compiled()
def first_moving_row(constants):
    """Return the row of the first moving state, u, after all parameters."""
    return int(constants[constants.size - 1])


@compiled()
def row_of(constants, which):
    """Return the row in the state of one of `ROW`; negative if it is not in the state."""
    return int(constants[constants.size - 1 - _N_ROWS + which])


@compiled()
def known_sensor(constants, which):
    """Return the number of the sensor `ACCELEROMETER` or `MAGNETOMETER`; negative if it is not used."""
    return int(constants[constants.size - _SENSORS + _N_KNOWN * which])


@compiled()
def known_vector(constants, which):
    """Return the vector of `ACCELEROMETER` or `MAGNETOMETER`, see `KnownSensor`."""
    begin = constants.size - _SENSORS + _N_KNOWN * which + 1
    return constants[begin], constants[begin + 1], constants[begin + 2]


@compiled()
def depth_is_state(constants):
    """Whether the depth is a state."""
    return row_of(constants, ROW.down) >= 0


@compiled()
def is_disturbed(constants):
    """Whether a disturbing force or moment is a state."""
    return constants[constants.size - _FASTEST] > 0.0


def place_of_fading_rate(constants: Array, axis: int) -> int:
    """Return the index of `fading_rate` among the constants."""
    return constants.size - _FADING + axis


@compiled()
def fading_rate(constants, axis):
    """Return the inverse time constant of the disturbance of an axis, 1/s; 0 if it is not a state."""
    return constants[constants.size - _FADING + axis]


@compiled()
def value_of(constants, which, parameters, moving, k):
    """Return the value in lane k of one of `ROW`, parameter or moving state; 0 if it is not in the state."""
    row, n_parameters = row_of(constants, which), first_moving_row(constants)
    if row < 0:
        return 0.0
    return parameters[row * LANES + k] if row < n_parameters else moving[(row - n_parameters) * LANES + k]


@compiled(inline=True)
def fill_in_lanes(moving, parameters, constants, selection, n_lanes, coefficients):
    """Fill in the coefficients, estimated or held, actuator errors and ballast of a block of states.

    Parameters
    ----------
    moving, parameters : ndarray
        Moving states and parameters, one lane for each state.
    constants, selection : ndarray
        See `auvid_cli.filters.problem.Process`.
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


@compiled()
def fill_in_all(mean, constants, selection, coefficients):
    """Fill in coefficients, actuator errors and ballast of one state, shape (N_FACTORS + terms,)."""
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


@compiled()
def fill_in_row(sensitivity, constants, selection, row):
    """Copy a derivative by the motion and all factors to a row of derivatives by the state; other columns are kept."""
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
