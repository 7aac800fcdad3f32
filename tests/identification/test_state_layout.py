"""The augmented state: blocks, rows and symbols."""

from inspect import isfunction

import numpy as np
import pytest

from auvid_cli.config.extra_states import ERROR_BLOCKS, FURTHER_STATES, ErrorBlock
from auvid_cli.config.identification import Identification
from auvid_cli.identification import compiled_layout, process, sensors
from auvid_cli.identification.compiled_layout import KnownSensors, model_constants
from auvid_cli.identification.states import StateBlock, StateLayout, state_layout
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.equations import N_CONSTANTS
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, Quantity


@pytest.fixture
def layout(experiment_with):
    asked = {"biases": ("gyro", "current", "dvl"), "dvl": {"yaw_walk": 1e-3}}
    settings = Identification(coefficients=("X_u|u|", "N_uvl"), estimate=asked)
    return state_layout(settings, experiment_with().vehicle, ("depth",))


def test_parameters_precede_moving_states(layout):
    assert layout.symbols == (
        *("X_u|u|", "N_uvl", "bias_p", "bias_q", "bias_r", "dvl_scale"),
        *(*MOTION_SYMBOLS, "down", "current_north", "current_east", "dvl_yaw"),
    )
    assert layout.n_parameters == 6
    assert layout.noise_density.size == len(layout.symbols) - 6


def test_rows_of_a_block_are_those_of_its_symbols(layout):
    for block in layout.blocks:
        symbols = tuple(quantity.symbol for quantity in block.quantities)
        rows = layout.rows_of(block.name)
        assert layout.symbols[rows] == symbols
        assert layout.rows(symbols) == list(range(rows.start, rows.stop))
    assert layout.row("thrust_scale") is None
    assert layout.symbols[layout.rows_of("thrust")] == ()


def test_scaled_components_have_a_prior_of_one(layout):
    own = layout.rows_of("coefficients")
    np.testing.assert_array_equal(layout.prior_std[own], 1.0)
    assert (layout.scale[own] != 1.0).all()


def functions_naming(symbol, *modules):
    names = [module.__name__ for module in modules]
    members = [getattr(value, "py_func", value) for module in modules for value in vars(module).values()]
    functions = {f for f in members if isfunction(f) and f.__module__ in names}
    return [f for f in functions if symbol in f.__code__.co_names]


def test_each_error_has_a_compiled_effect_and_its_derivative():
    errors = [quantity.symbol for block in ERROR_BLOCKS if block.is_named for quantity in block.quantities]
    assert errors
    assert all(len(functions_naming(symbol, sensors, compiled_layout)) >= 2 for symbol in errors)


def test_each_further_moving_state_is_advanced_and_in_both_transitions():
    assert all(len(functions_naming(state.quantity.symbol, process)) >= 3 for state in FURTHER_STATES)


@pytest.mark.parametrize("noise", [(), (0.1,)])
def test_state_without_compiled_code_is_refused(layout, noise):
    new = StateBlock("trim", (Quantity("rudder_twist", "rad", "", ""),), (0.1,), noise)
    wider = StateLayout([*layout.blocks, new])
    with pytest.raises(TypeError, match="rudder_twist"):
        model_constants(np.zeros(N_CONSTANTS), np.zeros(N_COEFFICIENTS), wider, KnownSensors())


def test_error_without_compiled_code_is_refused(layout):
    quantity = Quantity("dvl_pitch", "rad", "", "")
    new = StateBlock("new", (quantity,), (0.1,), error=ErrorBlock("new", (quantity,), 0.1, 0.0, "dvl"))
    with pytest.raises(TypeError, match="dvl_pitch"):
        model_constants(
            np.zeros(N_CONSTANTS), np.zeros(N_COEFFICIENTS), StateLayout([*layout.blocks, new]), KnownSensors()
        )
