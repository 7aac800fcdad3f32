"""The augmented state as blocks: parameters first, every component where its symbol says."""

import numpy as np
import pytest

from auvid_cli.config.extra_states import ERROR_BLOCKS, ErrorBlock
from auvid_cli.config.identification import Identification
from auvid_cli.identification import compiled_layout, process, sensors
from auvid_cli.identification.compiled_layout import KnownSensors, check_named, model_constants
from auvid_cli.identification.states import StateBlock, StateLayout, state_layout
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.equations import N_CONSTANTS
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, Quantity


@pytest.fixture
def layout(experiment_with):
    asked = {"biases": ("gyro", "current", "dvl"), "dvl": {"yaw_walk": 1e-3}}
    settings = Identification(coefficients=("X_u|u|", "N_uvl"), estimate=asked)
    return state_layout(settings, experiment_with().vehicle, ("depth",))


def test_parameters_stand_before_moving_states(layout):
    assert layout.symbols == (
        *("X_u|u|", "N_uvl", "bias_p", "bias_q", "bias_r", "dvl_scale"),
        *(*MOTION_SYMBOLS, "down", "current_north", "current_east", "dvl_yaw"),
    )
    assert layout.n_parameters == 6
    assert layout.noise_density.size == len(layout.symbols) - 6


def test_a_block_stands_where_its_symbols_do(layout):
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


def test_an_error_that_no_compiled_code_names_is_refused_at_import():
    errors = [quantity.symbol for block in ERROR_BLOCKS if block.is_named for quantity in block.quantities]
    check_named(errors, (sensors, compiled_layout), by=2)
    with pytest.raises(TypeError, match="no compiled code says what comes of dvl_pitch"):
        check_named(["dvl_pitch"], (sensors,), by=2)
    with pytest.raises(TypeError, match="dvl_scale"):
        check_named(errors, (compiled_layout,), by=2)


def test_a_moving_state_that_no_compiled_code_moves_is_refused_at_import():
    check_named(["down"], (process,), by=3)
    with pytest.raises(TypeError, match="no compiled code says what comes of tether_tension"):
        check_named(["tether_tension"], (process,), by=3)


@pytest.mark.parametrize("noise", [(), (0.1,)])
def test_a_state_that_no_compiled_code_moves_is_no_random_walk(layout, noise):
    new = StateBlock("trim", (Quantity("rudder_twist", "rad", "", ""),), (0.1,), noise)
    wider = StateLayout([*layout.blocks, new])
    with pytest.raises(TypeError, match="rudder_twist"):
        model_constants(np.zeros(N_CONSTANTS), np.zeros(N_COEFFICIENTS), wider, KnownSensors())


def test_an_error_that_no_compiled_code_knows_is_never_left_out_silently(layout):
    quantity = Quantity("dvl_pitch", "rad", "", "")
    new = StateBlock("new", (quantity,), (0.1,), error=ErrorBlock("new", (quantity,), 0.1, 0.0, "dvl"))
    with pytest.raises(TypeError, match="dvl_pitch"):
        model_constants(
            np.zeros(N_CONSTANTS), np.zeros(N_COEFFICIENTS), StateLayout([*layout.blocks, new]), KnownSensors()
        )
