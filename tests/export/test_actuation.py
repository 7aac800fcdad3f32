"""A made-up history: a constant speed, a constant surge force, and a step of the elevator."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.config.vehicle import ActuatorSettings
from auvid_cli.data.dataset import InputRecord
from auvid_cli.export.model import acting_inputs, actuation
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.coefficients import SYMBOLS

SPEED, FORCE, STEP, LAG = 2.0, 50.0, 0.1, 0.2
INPUTS = InputRecord(np.array([0.0, 1.0]), np.array([[0.0, 0.0, FORCE, 0.0], [0.0, STEP, FORCE, 0.0]]))
TIME = np.linspace(0.0, 3.0, 601)
MOTION = np.tile([SPEED, *np.zeros(8)], (TIME.size, 1))
VALUES = dict.fromkeys(SYMBOLS, 0.0) | {"Z_uude": -30.0, "M_uude": -20.0, "Y_uudr": 10.0}


@pytest.fixture(scope="module")
def history(simulated_with, with_settings):
    """Function: an estimate over `TIME` with some settings."""
    dataset = simulated_with("manoeuvre.duration=2 s", "identification.estimate.biases=[thrust]")

    def make(*overrides, thrust_scale=0.0):
        own = with_settings(dataset, "identification.integration_step=0.0005 s", *overrides)
        estimate = replace(identify(dataset, FilterName.CKF), experiment=own.experiment, time=TIME)
        mean = np.zeros((TIME.size, len(estimate.state)))
        mean[:, estimate.state.index("thrust_scale")] = thrust_scale
        return replace(estimate, mean=mean)

    return make


def test_thrust_rms_is_the_added_force(history):
    effect = actuation(history(thrust_scale=-0.2), INPUTS, VALUES, MOTION)
    assert effect.thrust == pytest.approx(0.8)
    assert effect.thrust_rms == pytest.approx(0.2 * FORCE)


def test_lag_changes_fin_forces(history):
    effect = actuation(history(f"vehicle.actuators.fins.time_constant={LAG} s"), INPUTS, VALUES, MOTION)
    late = np.where(TIME >= 1.0, STEP * np.exp(-(TIME - 1.0) / LAG), 0.0)
    missing = SPEED**2 * np.sqrt(np.mean(late**2))
    assert effect.actuators.fins.time_constant == LAG
    of_fins = {"Y_uudr": 0.0, "Z_uude": 30.0 * missing, "M_uude": 20.0 * missing, "N_uudr": 0.0}
    assert effect.changes == pytest.approx(of_fins | {"surge_force": 0.0}, rel=2e-3)


def test_fins_act_after_lag(history):
    acting = acting_inputs(history(f"vehicle.actuators.fins.time_constant={LAG} s"), INPUTS)
    expected = np.where(TIME >= 1.0, STEP * -np.expm1(-(TIME - 1.0) / LAG), 0.0)
    np.testing.assert_allclose(acting[:, 1], expected, atol=2e-3 * STEP)
    assert (acting[:, 2] == FORCE).all()


def test_ideal_actuation_changes_nothing(history):
    effect = actuation(history(), INPUTS, VALUES, MOTION)
    nothing = dict.fromkeys(("Y_uudr", "Z_uude", "M_uude", "N_uudr", "surge_force"), 0.0)
    assert effect == (1.0, 0.0, ActuatorSettings(), nothing)
