"""What the nonlinear sensors see of the augmented state: the accelerometer where one is heard, else the DVL."""

from auvid_cli.compilation import compiled
from auvid_cli.filters.problem import LINEARISATION_SIGNATURE, OBSERVATION_SIGNATURE
from auvid_cli.identification.accelerometer import feel_forces, linearise_force
from auvid_cli.identification.compiled_layout import accelerometer_sensor
from auvid_cli.identification.dvl import linearise_velocity, see_velocities


@compiled(OBSERVATION_SIGNATURE)
def observe(moving, parameters, sensor, inputs, constants, selection, n_lanes, seen, scratch):
    """Predict what a sensor sees of a block of states."""
    if sensor == accelerometer_sensor(constants):
        feel_forces(moving, parameters, inputs, constants, selection, n_lanes, seen, scratch)
    else:
        see_velocities(moving, parameters, constants, n_lanes, seen)


@compiled(LINEARISATION_SIGNATURE)
def linearise(mean, sensor, inputs, constants, selection, seen, matrix, scratch):
    """Predict what a sensor sees of one state, and the derivative by the state."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 0.0
    if sensor == accelerometer_sensor(constants):
        linearise_force(mean, inputs, constants, selection, seen, matrix, scratch)
    else:
        linearise_velocity(mean, constants, seen, matrix)
