"""A force or moment that disturbs the motion, as a state: what it does, and what is found of it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from auvid_cli.config.experiment import Identification
from auvid_cli.identification.process import first_order_transition, vehicle_process
from auvid_cli.identification.state_layout import state_layout
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.dynamics import factors, motion_derivative, vehicle_constants
from auvid_cli.vehicle.matrices import mass_matrix
from auvid_cli.vehicle.parameters import DISTURBANCE

INPUTS = np.array([[0.1, -0.05, 30.0, 1.0], [-0.1, 0.07, 35.0, -1.0]])
MOTION = np.array([2.0, 0.1, -0.1, 0.02, 0.03, -0.05, 0.1, -0.2, 0.3])
FORCE = np.array([5.0, -4.0, 3.0, 0.2, -1.0, 2.0])
TIME_CONSTANT = np.array([0.5, 1.0, 2.0, 0.4, 0.8, 3.0])
AXES = {"all axes": range(6), "three axes": (0, 3, 5)}


def asked_for(axes):
    size = np.where(np.isin(range(6), axes), 1.0, 0.0).tolist()
    groups = {"force": slice(0, 3), "moment": slice(3, 6)}
    return {
        "biases": ("disturbance",),
        "disturbance": {
            name: {"standard_deviation": size[of], "time_constant": TIME_CONSTANT[of].tolist()}
            for name, of in groups.items()
        },
    }


class Disturbed:
    """A process whose state is two coefficients, the motion, perhaps the depth, and what disturbs some axes."""

    def __init__(self, vehicle, axes, has_depth):
        true = vehicle.all_coefficients()
        settings = Identification(coefficients=("X_u|u|", "N_uvl"), estimate=asked_for(axes))
        self.layout = state_layout(settings, vehicle.size, ("depth",) if has_depth else ())
        self.parameters = vehicle.known_parameters()
        self.process = vehicle_process(vehicle_constants(self.parameters), true, self.layout)
        values = dict(zip(self.layout.symbols[2:11], MOTION, strict=True)) | {"down": 7.0}
        values |= {quantity.symbol: force for quantity, force in zip(DISTURBANCE, FORCE, strict=True)}
        values |= {symbol: true[symbol] for symbol in self.layout.symbols if symbol in SYMBOLS}
        self.state = np.array([values[symbol] for symbol in self.layout.symbols]) / self.layout.scale
        self.factors = factors(true)

    def moved(self, state, durations, exact=True):
        process, held = self.process, np.arange(len(durations)) * len(INPUTS) // len(durations)
        transition = process.transition if exact else first_order_transition
        state, matrix, scratch = state.copy(), np.eye(state.size), np.full(process.scratch_size, 7.0)
        transition(state, INPUTS, held, durations, process.constants, process.selection, matrix, scratch)
        return state, matrix


@pytest.fixture(params=AXES.values(), ids=AXES)
def disturbed(request, experiment_with):
    return Disturbed(experiment_with().vehicle, request.param, has_depth=True)


DURATIONS = np.array([0.01, 0.03, 0.02])


def test_the_exact_transition_is_the_derivative_of_the_motion_under_forces(disturbed):
    _, matrix = disturbed.moved(disturbed.state, DURATIONS)
    for j in range(matrix.shape[1]):
        step = 1e-5 * np.eye(len(matrix))[j]
        ahead, behind = (disturbed.moved(disturbed.state + by, DURATIONS)[0] for by in (step, -step))
        assert_allclose(matrix[:, j], (ahead - behind) / 2e-5, rtol=1e-6, atol=1e-8)


def test_the_first_order_transition_differs_from_it_by_the_square_of_the_interval(disturbed):
    errors = []
    for shorter in (1.0, 0.5, 0.25):
        durations = shorter * np.full(1, 4e-3)
        both = (disturbed.moved(disturbed.state, durations, exact) for exact in (True, False))
        (mean, exact), (same, first_order) = both
        assert_allclose(same, mean, rtol=1e-10)
        errors.append(np.abs(exact - first_order).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.05)


def test_sigma_points_are_moved_as_the_mean_is(disturbed):
    process, n = disturbed.process, disturbed.layout.n_parameters
    mean, _ = disturbed.moved(disturbed.state, DURATIONS)
    block = np.repeat(disturbed.state[:, None], LANES, axis=1)
    parameters, moving, scratch = block[:n].ravel(), block[n:].ravel(), np.zeros(process.scratch_size)
    held = np.arange(len(DURATIONS)) * len(INPUTS) // len(DURATIONS)
    for given, duration in zip(held, DURATIONS, strict=True):
        model = process.constants, process.selection, 5, duration, scratch
        process.advance(moving, parameters, INPUTS[given], *model)
    assert_allclose(moving.reshape(-1, LANES)[:, :5], np.repeat(mean[n:, None], 5, axis=1), rtol=1e-12)


def test_a_force_accelerates_by_the_mass_matrix_and_fades(experiment_with):
    """As another integrator has it, with an error that falls with the square of the step."""
    disturbed = Disturbed(experiment_with().vehicle, range(6), has_depth=False)
    constants, inverse = vehicle_constants(disturbed.parameters), np.linalg.inv(mass_matrix(disturbed.parameters))

    def rates(time, state):
        slope = np.zeros(9 * LANES)
        motion, lanes = np.repeat(state, LANES), np.repeat(disturbed.factors, LANES)
        motion_derivative(motion, lanes, INPUTS[0], constants, 1, slope)
        slope = slope.reshape(9, LANES)[:, 0]
        slope[:6] += inverse @ (FORCE * np.exp(-time / TIME_CONSTANT))
        return slope

    right = solve_ivp(rates, (0.0, 0.4), MOTION, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    errors = []
    for n in (20, 40):
        state, process = disturbed.state.copy(), disturbed.process
        model = process.constants, process.selection, np.eye(state.size), np.zeros(process.scratch_size)
        process.transition(state, INPUTS, np.zeros(n, dtype=np.int64), np.full(n, 0.4 / n), *model)
        assert_allclose(state[11:], FORCE * np.exp(-0.4 / TIME_CONSTANT), rtol=1e-12)
        errors.append(np.abs(state[2:11] - right).max())
    assert errors[0] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
