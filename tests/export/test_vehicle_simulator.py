"""The written vehicle in a main loop like the simulator's, which no registry has: its attributes, steps and current."""

import runpy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FormatName
from auvid_cli.config.vehicle import ActuatorSettings
from auvid_cli.export.formats import FORMATS, simulator_text
from auvid_cli.export.model import Actuation
from auvid_cli.vehicle.rigid_body import current_in_body_axes, euler_rates

STEP = 0.02
ACTUATORS = ActuatorSettings.model_validate(
    {
        "fins": {"dead_band": 0.02, "time_constant": 0.2, "stall": {"angle": 0.25, "slope": -0.5}},
        "propeller": {"saturation": 40.0, "rate_limit": 100.0},
    }
)
LAGGED = Actuation(1.25, 10.0, ACTUATORS, {"Y_uudr": 1.0, "Z_uude": 1.0, "M_uude": 1.0, "N_uudr": 1.0})


def read(model, folder):
    path = folder / "model.py"
    path.write_text(simulator_text(model, FORMATS[FormatName.SIMULATOR].unsupported(model), "model"), encoding="utf-8")
    return runpy.run_path(str(path))["Vehicle"]


@pytest.fixture(scope="module")
def vehicle_class(skewed, tmp_path_factory):
    return read(skewed, tmp_path_factory.mktemp("simulator"))


def simulate(vehicle, steps):
    """Velocities and attitudes by the loop of the simulator: commands, then velocities, then attitude, all Euler."""
    eta, nu, acting, seen = np.zeros(6), vehicle.nu, vehicle.u_actual, []
    for k in range(steps):
        seen.append(np.concatenate([eta, nu, acting]))
        nu, acting = vehicle.dynamics(eta, nu, acting, vehicle.stepInput(k * STEP), STEP)
        rates = euler_rates(nu[None, 3:], eta[None, 3:])[0]
        eta = eta + STEP * np.concatenate([nu[:3], rates])
    return np.array(seen)


@given(seed=st.integers(0, 2**32 - 1))
def test_simulator_step_is_euler_of_the_core(seed, vehicle_class, skewed, derivative_of, draw):
    motion, inputs = draw(seed)
    eta = np.concatenate([[5.0, 6.0, 7.0], motion[6:]])
    after, acting = vehicle_class().dynamics(eta, motion[:6], np.zeros(4), inputs, STEP)
    slope = derivative_of(skewed, motion, inputs)[:6]
    assert_allclose((after - motion[:6]) / STEP, slope, rtol=1e-9, atol=1e-9 * np.abs(slope).max())
    assert_allclose(acting, inputs)


@given(seed=st.integers(0, 2**32 - 1), direction=st.floats(-360.0, 360.0))
def test_simulator_current_moves_the_water(seed, direction, vehicle_class, skewed, derivative_of, draw):
    """The velocity over ground, turned to the earth, changes as that through the water does."""
    motion, inputs = draw(seed)
    angle = np.radians(direction)
    current = current_in_body_axes(motion[None, 6:], 0.5 * np.cos(angle), 0.5 * np.sin(angle))[0]
    over_ground = motion[:6] + np.concatenate([current, np.zeros(3)])
    eta = np.concatenate([np.zeros(3), motion[6:]])
    drifting = vehicle_class(V_current=0.5, beta_current=direction)
    after, _ = drifting.dynamics(eta, over_ground, np.zeros(4), inputs, STEP)
    slope, water = (after - over_ground) / STEP, derivative_of(skewed, motion, inputs)[:6]
    # The derivative of a rotated vector has a part from the rotation.
    slope[:3] += np.cross(motion[3:6], over_ground[:3])
    water[:3] += np.cross(motion[3:6], motion[:3])
    assert_allclose(slope, water, rtol=1e-9, atol=1e-9 * np.abs(water).max())


def test_main_loop_of_the_simulator_runs(model_with, tmp_path):
    model = model_with()
    vehicle = read(model, tmp_path)()
    assert vehicle.controlMode == "stepInput"
    assert len(vehicle.controls) == vehicle.dimU == len(vehicle.u_actual) == 4
    assert all(isinstance(text, str) for text in (vehicle.name, vehicle.controlDescription, *vehicle.controls))
    assert model.experiment.vehicle.size.length == vehicle.L
    sailed = simulate(vehicle, 500)
    assert sailed[-1, 6] > 1.0


def test_simulator_has_gain_and_actuators(model_with, tmp_path, derivative_of):
    model = model_with(actuation=LAGGED)
    lines = " ".join(FORMATS[FormatName.SIMULATOR].unsupported(model).notes)
    assert "actuators are lost" not in lines
    assert "gain" not in lines
    vehicle = read(model, tmp_path)()
    acting, nu, eta = np.array([0.3, 0.0, 0.0, 0.0]), np.array([2.0, *np.zeros(5)]), np.zeros(6)
    after, acting = vehicle.dynamics(eta, nu, acting, np.array([0.1, -0.1, 50.0, 0.0]), STEP)
    # The rudder is 0.05 beyond the stall, which subtracts 0.025; the thrust is unchanged.
    slope = derivative_of(model, [*nu, 0.0, 0.0, 0.0], [0.225, 0.0, 0.0, 0.0])[:6]
    assert_allclose((after - nu) / STEP, slope, rtol=1e-9, atol=1e-12)
    left = np.exp(-STEP / 0.2)
    assert_allclose(acting, [0.08 + 0.22 * left, -0.08 + 0.08 * left, 100.0 * STEP, 0.0])


def test_unknown_autopilot_is_refused(vehicle_class):
    with pytest.raises(ValueError, match="'depthHeadingAutopilot': this vehicle has only stepInput"):
        vehicle_class("depthHeadingAutopilot")
