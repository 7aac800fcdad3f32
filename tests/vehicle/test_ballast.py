"""Ballast as a part of the equations of motion, and as another buoyancy at another place."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.vehicle.equations import vehicle_constants
from auvid_cli.vehicle.parameters import AS_STATED
from auvid_cli.vehicle.rigid_body import NO_BALLAST, Ballast


@given(seed=st.integers(0, 2**32 - 1))
def test_ballast_equals_changed_parameters(seed, core, random_vehicle, random_state):
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng)
    motion, coefficients, inputs = random_state(rng, vehicle["m"])
    ballast = Ballast(*(vehicle["m"] * rng.uniform(-1.0, 1.0, 2)).tolist())
    everything = np.concatenate([coefficients, AS_STATED, ballast])
    expected = core.derivative(motion, coefficients, inputs, vehicle_constants(ballast.added_to(vehicle)))
    found = core.derivative(motion, everything, inputs, vehicle_constants(vehicle))
    assert_allclose(found, expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max())


def test_a_vehicle_without_ballast_stays_as_it_is(rng, random_vehicle):
    vehicle = random_vehicle(rng)
    same = NO_BALLAST.added_to(vehicle)
    assert same.keys() == vehicle.keys()
    assert_allclose([*same.values()], [*vehicle.values()], rtol=1e-15)
