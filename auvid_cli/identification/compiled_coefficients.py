"""All coefficients, SI, as the compiled dynamics want them, of a state that has some of them, scaled."""

from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.identification.compiled_layout import HELD, ROW, SCALE, first_moving_row, row_of, value_of
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.parameters import N_MOTION

_vector = types.float64[::1]
_indices = types.int64[::1]


@compiled(types.void(_vector, _vector, _vector, _indices, types.uint64, _vector), inline=True)
def fill_in_lanes(moving, parameters, constants, selection, n_lanes, coefficients):
    """Fill in the coefficients, estimated or held, and the thrust's factor of a block of states.

    Parameters
    ----------
    moving, parameters : ndarray
        Blocks of them.
    constants, selection : ndarray
        Of the process.
    n_lanes : int
    coefficients : ndarray, shape (N_FACTORS * LANES,)
    """
    j = 0
    for m in range(N_COEFFICIENTS):
        row = coefficients[m * LANES : (m + 1) * LANES]
        if j < selection.size and selection[j] == m:
            scale, scaled = constants[SCALE + j], parameters[j * LANES : (j + 1) * LANES]
            for k in range(LANES):
                row[k] = scale * scaled[k]
            j += 1
        else:
            for k in range(LANES):
                row[k] = constants[HELD + m]
    thrust = coefficients[N_COEFFICIENTS * LANES :]
    for k in range(LANES):
        thrust[k] = 1.0
    if row_of(constants, ROW.thrust_scale) >= 0:
        for k in range(n_lanes):
            thrust[k] += value_of(constants, ROW.thrust_scale, parameters, moving, k)


@compiled(types.void(_vector, _vector, _indices, _vector), internal=True)
def fill_in_all(mean, constants, selection, coefficients):
    """Do the same of one state: `coefficients` has shape (N_FACTORS,)."""
    for m in range(N_COEFFICIENTS):
        coefficients[m] = constants[HELD + m]
    for j in range(selection.size):
        coefficients[selection[j]] = constants[SCALE + j] * mean[j]
    row = row_of(constants, ROW.thrust_scale)
    coefficients[N_COEFFICIENTS] = 1.0 + mean[row] if row >= 0 else 1.0


@compiled(types.void(_vector, _vector, _indices, _vector), internal=True)
def fill_in_row(sensitivity, constants, selection, row):
    """Copy a derivative by the motion and all factors to a row of derivatives by the state; others stay."""
    n_coefficients, n_parameters = selection.size, first_moving_row(constants)
    for j in range(n_coefficients):
        row[j] = sensitivity[N_MOTION + selection[j]] * constants[SCALE + j]
    for j in range(N_MOTION):
        row[n_parameters + j] = sensitivity[j]
    thrust = row_of(constants, ROW.thrust_scale)
    if thrust >= 0:
        row[thrust] = sensitivity[N_MOTION + N_COEFFICIENTS]
