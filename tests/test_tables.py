"""Tables of the package are complete: each name that users can write has everything that it needs."""

from auvid_cli.config.enums import FilterName, FormatName
from auvid_cli.config.extra_states import (
    DELAYS,
    ERROR_BLOCKS,
    ERROR_STATES,
    FURTHER_STATES,
    AugmentedStates,
    BiasName,
    InitialMotion,
    ProcessNoise,
)
from auvid_cli.config.sensors import SensorSuite
from auvid_cli.evaluation.free_run import VELOCITY_ERRORS
from auvid_cli.export.formats import FORMATS
from auvid_cli.identification import sensors
from auvid_cli.identification.faults import DELAY_FAULTS
from auvid_cli.report.figures.style import FILTER_STYLES
from auvid_cli.simulation.simulate import MEASUREMENT_MODELS
from auvid_cli.vehicle.parameters import MOTION, MOTION_AND_DEPTH, MOTION_SYMBOLS, SENSORS, state_of

# Predicted measurement and its derivative. All other sensors measure states, plus additive errors.
OBSERVED = {
    "dvl": (sensors.measure_velocities, sensors.linearise_velocity),
    "accelerometer": (sensors.measure_forces, sensors.linearise_force),
    "magnetic_field": (sensors.measure_field, sensors.linearise_field),
}


def test_each_error_has_name_and_settings():
    assert {*AugmentedStates.model_fields} - {"biases"} == {*BiasName}


def test_symbols_of_errors_differ():
    assert len({quantity.symbol for quantity in ERROR_STATES}) == len(ERROR_STATES)


def test_each_moving_state_has_noise_and_start():
    names = {state.name for state in FURTHER_STATES}
    assert names <= ProcessNoise.model_fields.keys() & InitialMotion.model_fields.keys()


def test_each_sensor_has_settings_and_components_of_one_unit():
    assert {*SensorSuite.model_fields} - {"name"} == SENSORS.keys()
    assert all(len({quantity.unit for quantity in components}) == 1 for components in SENSORS.values())


def test_each_sensor_that_measures_no_motion_state_is_simulated():
    direct = {name for name, measured in SENSORS.items() if {q.symbol for q in measured} <= {*MOTION_SYMBOLS}}
    assert SENSORS.keys() == direct | MEASUREMENT_MODELS.keys()


def test_each_nonlinear_sensor_has_compiled_code_that_is_called():
    states = {q.symbol for q in (*MOTION, *(state.quantity for state in FURTHER_STATES))}
    nonlinear = {name for name, measured in SENSORS.items() if not {state_of(q) for q in measured} <= states}
    nonlinear |= {block.sensor for block in ERROR_BLOCKS if block.sensor is not None and not block.additive}
    assert nonlinear <= OBSERVED.keys()
    called = {*sensors.observe.py_func.__code__.co_names, *sensors.linearise.py_func.__code__.co_names}
    assert all(function.py_func.__name__ in called for both in OBSERVED.values() for function in both)


def test_additive_errors_belong_to_linear_sensors():
    assert not [block.name for block in ERROR_BLOCKS if block.additive and block.sensor in OBSERVED]


def test_errors_of_motion_sensors_are_additive_or_of_the_velocity():
    readable = {q.symbol for q in MOTION_AND_DEPTH}
    names = {name for name, measured in SENSORS.items() if {state_of(q) for q in measured} <= readable}
    others = {q.symbol for b in ERROR_BLOCKS if b.sensor in names and not b.additive for q in b.quantities}
    assert others <= {*VELOCITY_ERRORS}


def test_each_delay_is_a_fault():
    assert DELAY_FAULTS.keys() == {delay.symbol for delay in DELAYS.values()}


def test_each_filter_has_a_style_and_each_export_a_writer():
    assert FILTER_STYLES.keys() == {name.value for name in FilterName}
    assert FORMATS.keys() == {name for name in FormatName if not name.is_of_a_run}
