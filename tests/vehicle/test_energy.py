"""Energy balance of the equations of motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.equations import vehicle_constants

NO_COEFFICIENTS = np.zeros(N_COEFFICIENTS)
NO_INPUTS = np.zeros(4)
DIAGONAL = ("X_u|u|", "Y_v|v|", "Z_w|w|", "K_p|p|", "M_q|q|", "N_r|r|")

# A 2 m hull, all centres off the axes, slightly heavy.
OFFSET = {
    "m": 50.0, "W": 490.0, "B": 485.0, "Ixx": 0.3, "Iyy": 15.0, "Izz": 15.5,
    "xG": 0.02, "yG": 0.004, "zG": 0.03, "xB": 0.015, "yB": -0.003, "zB": -0.01,
    "X_udot": -5.0, "Y_vdot": -52.0, "Z_wdot": -49.0, "K_pdot": -0.1, "M_qdot": -14.0, "N_rdot": -13.0,
    "Y_rdot": 2.0, "N_vdot": 2.0, "Z_qdot": -1.5, "M_wdot": -1.5, "X_prop": 10.0, "K_prop": 0.0,
}  # fmt: skip
CENTRED = OFFSET | {"B": 490.0, "xG": 0.0, "yG": 0.0, "zG": 0.0, "xB": 0.0, "yB": 0.0, "zB": 0.0}


def down_axis(motion):
    """The downward unit vector in body axes, third row of the rotation matrix."""
    phi, theta = motion[6], motion[7]
    return np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])


def kinetic_energy(vehicle, motion):
    """Return the kinetic energy of the body, about its centre of gravity, and of the water."""
    k, turning = vehicle, motion[3:6]
    centre = np.array([k["xG"], k["yG"], k["zG"]])
    moving = motion[:3] + np.cross(turning, centre)
    # Inertia is stated about the origin: take off the point mass at the centre (Steiner).
    about_centre = np.diag([k["Ixx"], k["Iyy"], k["Izz"]])
    about_centre -= k["m"] * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    body = 0.5 * k["m"] * moving @ moving + 0.5 * turning @ about_centre @ turning
    own = zip(("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot"), motion[:6], strict=True)
    water = -0.5 * sum(k[symbol] * x**2 for symbol, x in own)
    _, v, w, _, q, r = motion[:6]
    return body + water - k["Y_rdot"] * v * r - k["Z_qdot"] * w * q


def potential_energy(vehicle, motion, depth):
    """Return the potential energy of weight and buoyancy."""
    k, down = vehicle, down_axis(motion)
    weight_depth = depth + down @ [k["xG"], k["yG"], k["zG"]]
    buoyancy_depth = depth + down @ [k["xB"], k["yB"], k["zB"]]
    return k["B"] * buoyancy_depth - k["W"] * weight_depth


def energy_drift(core, step):
    """Largest change of total energy in 20 s, relative to the kinetic energy at the start."""
    start = np.array([0.8, 0.1, -0.1, 0.1, 0.05, -0.08, 0.2, 0.1, 0.0])
    steps = 2 * round(20.0 / step)
    path = core.advance(start, NO_COEFFICIENTS, NO_INPUTS, vehicle_constants(OFFSET), steps, 0.5 * step)
    sinking = np.array([down_axis(motion) @ motion[:3] for motion in path])
    # Simpson's rule over pairs of half steps.
    depth = np.concatenate([[0.0], np.cumsum(step / 6 * (sinking[:-2:2] + 4 * sinking[1::2] + sinking[2::2]))])
    pairs = zip(path[::2], depth, strict=True)
    energy = np.array([kinetic_energy(OFFSET, m) + potential_energy(OFFSET, m, z) for m, z in pairs])
    assert np.abs(path[:, 7]).max() < 1.4
    assert np.ptp(depth) > 0.1, "the test should move the vehicle in depth"
    return np.abs(energy - energy[0]).max() / kinetic_energy(OFFSET, start)


@pytest.mark.slow
def test_energy_is_conserved_without_damping_to_the_order_of_the_integrator(core):
    coarse, medium, fine = (energy_drift(core, step) for step in (0.04, 0.02, 0.01))
    assert fine < 1e-7
    # Fourth order, or fifth where the leading error does no work: a factor of 16 to 32.
    for ratio in (coarse / medium, medium / fine):
        assert 12.0 < ratio < 45.0


@pytest.mark.slow
@given(
    motion=st.tuples(*[st.floats(-2.0, 2.0)] * 3, *[st.floats(-0.5, 0.5)] * 3, *[st.floats(-1.0, 1.0)] * 3),
    drags=st.tuples(*[st.floats(-200.0, -1.0)] * 6),
)
def test_diagonal_drag_only_takes_energy(motion, drags, core):
    coefficients = np.zeros(N_COEFFICIENTS)
    coefficients[[SYMBOLS.index(symbol) for symbol in DIAGONAL]] = drags
    constants = vehicle_constants(CENTRED)
    start = np.array(motion)
    rate = core.derivative(start, coefficients, NO_INPUTS, constants)

    # The rate of change of the (quadratic) kinetic energy is what the drag dissipates, |x|^3 each.
    nu, dnu = start[:6], rate[:6]
    power = (kinetic_energy(CENTRED, nu + dnu) - kinetic_energy(CENTRED, nu - dnu)) / 2
    dissipated = np.dot(drags, np.abs(nu) ** 3)
    scale = sum(abs(a * b) for a, b in zip(nu, dnu, strict=True)) * 200.0
    assert_allclose(power, dissipated, rtol=1e-9, atol=1e-11 * scale + 1e-300)

    path = core.advance(np.array([*nu, 0.0, 0.0, 0.0]), coefficients, NO_INPUTS, constants, 100, 0.002)
    energies = np.array([kinetic_energy(CENTRED, state) for state in path])
    assert np.all(np.diff(energies) <= 1e-12 * energies[0])


def test_a_balanced_vehicle_at_rest_stays_at_rest(core):
    constants = vehicle_constants(CENTRED)
    attitude = [0.3, -0.4, 2.0]
    drag = np.full(N_COEFFICIENTS, -10.0)
    path = core.advance(np.array([0.0] * 6 + attitude), drag, NO_INPUTS, constants, 100, 0.02)
    assert_allclose(path[-1], path[0], atol=1e-15)


ROLLING = CENTRED | {"Y_rdot": 0.0, "N_vdot": 0.0}


def roll_inertia_at_work(vehicle):
    """Roll inertia about the axis that a free hull rolls about: sway gives way."""
    coupling = vehicle["m"] * vehicle["zG"]
    return vehicle["Ixx"] - vehicle["K_pdot"] - coupling**2 / (vehicle["m"] - vehicle["Y_vdot"])


def test_a_low_centre_of_gravity_makes_roll_swing_at_the_closed_form_frequency(core):
    vehicle = ROLLING | {"zG": 0.02}
    frequency = np.sqrt(vehicle["zG"] * vehicle["W"] / roll_inertia_at_work(vehicle))
    angle, step = 1e-4, 0.01
    start = np.array([0.0] * 6 + [angle, 0.0, 0.0])
    path = core.advance(start, NO_COEFFICIENTS, NO_INPUTS, vehicle_constants(vehicle), 1000, step)
    time = step * np.arange(1001)
    assert frequency * time[-1] > 6 * np.pi
    assert_allclose(path[:, 6], angle * np.cos(frequency * time), atol=1e-5 * angle)


def test_a_high_centre_of_gravity_makes_roll_grow(core):
    vehicle = ROLLING | {"zG": -0.02}
    growth = np.sqrt(-vehicle["zG"] * vehicle["W"] / roll_inertia_at_work(vehicle))
    angle, step = 1e-8, 0.005
    start = np.array([0.0] * 6 + [angle, 0.0, 0.0])
    path = core.advance(start, NO_COEFFICIENTS, NO_INPUTS, vehicle_constants(vehicle), 400, step)
    time = step * np.arange(401)
    assert path[-1, 6] > 100 * angle
    assert_allclose(path[:, 6], angle * np.cosh(growth * time), rtol=1e-5)


@pytest.mark.parametrize("attitude", [(0.0, 0.0), (np.pi / 2, 0.0), (0.0, 1.2)])
def test_surplus_buoyancy_lifts_whatever_the_attitude(attitude, core):
    constants = vehicle_constants(CENTRED | {"B": 500.0})
    motion = np.array([0.0] * 6 + [*attitude, 0.0])
    rate = core.derivative(motion, NO_COEFFICIENTS, NO_INPUTS, constants)
    assert down_axis(motion) @ rate[:3] < 0.0
