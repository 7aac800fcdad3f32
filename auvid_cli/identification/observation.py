"""What nonlinear sensors measure of the state: accelerometer and magnetometer of three axes if used, else the DVL."""

from auvid_cli.filters.problem import LINEARISATION_SIGNATURE, OBSERVATION_SIGNATURE
from auvid_cli.identification.compiled_layout import ACCELEROMETER, MAGNETOMETER, known_sensor
from auvid_cli.identification.sensors import (
    linearise_field,
    linearise_force,
    linearise_velocity,
    measure_field,
    measure_forces,
    measure_velocities,
)
from auvid_cli.numerics import compiled

# Of all others each component is a state, and errors just add to it.
OBSERVED = {
    "dvl": (measure_velocities, linearise_velocity),
    "accelerometer": (measure_forces, linearise_force),
    "magnetic_field": (measure_field, linearise_field),
}


@compiled(OBSERVATION_SIGNATURE)
def observe(moving, parameters, sensor, inputs, constants, selection, n_lanes, predicted, scratch):
    """Predict what a sensor measures of a block of states."""
    if sensor == known_sensor(constants, ACCELEROMETER):
        measure_forces(moving, parameters, inputs, constants, selection, n_lanes, predicted, scratch)
    elif sensor == known_sensor(constants, MAGNETOMETER):
        measure_field(moving, parameters, constants, n_lanes, predicted)
    else:
        measure_velocities(moving, parameters, constants, n_lanes, predicted)


@compiled(LINEARISATION_SIGNATURE)
def linearise(mean, sensor, inputs, constants, selection, predicted, matrix, scratch):
    """Predict what a sensor measures of one state, and the derivative by the state."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 0.0
    if sensor == known_sensor(constants, ACCELEROMETER):
        linearise_force(mean, inputs, constants, selection, predicted, matrix, scratch)
    elif sensor == known_sensor(constants, MAGNETOMETER):
        linearise_field(mean, constants, predicted, matrix)
    else:
        linearise_velocity(mean, constants, predicted, matrix)
