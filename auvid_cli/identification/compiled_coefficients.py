"""All coefficients, SI, as the compiled dynamics want them, of a state that has some of them, scaled."""

from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.identification.compiled_layout import HELD, ROW, SCALE, first_moving_row, row_of, value_of
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.dynamics import N_FACTORS, NO_ERRORS, n_terms, term_place
from auvid_cli.vehicle.parameters import N_MOTION

N_ERRORS = len(NO_ERRORS)
_vector = types.float64[::1]
_indices = types.int64[::1]


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
