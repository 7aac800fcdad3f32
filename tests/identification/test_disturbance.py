"""Disturbing forces and moments as states: transition, limits and estimates."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from auvid_cli.config.enums import FilterName
from auvid_cli.config.identification import Identification
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.filters.ekf import run_extended_filter
from auvid_cli.filters.problem import OK, Gaussian, Sensors, Timeline
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature, transformed
from auvid_cli.identification.process import first_order_transition, vehicle_process
from auvid_cli.identification.run import identify
from auvid_cli.identification.states import state_layout
from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.equations import factors, motion_derivative, vehicle_constants
from auvid_cli.vehicle.parameters import DISTURBANCE, PARAMETER_SYMBOLS
from auvid_cli.vehicle.rigid_body import mass_matrix

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
        self.layout = state_layout(settings, vehicle, ("depth",) if has_depth else ())
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
    _, matrix = disturbed.moved(disturbed.state, 0.1 * DURATIONS)
    for j in range(matrix.shape[1]):
        step = 1e-5 * np.eye(len(matrix))[j]
        ahead, behind = (disturbed.moved(disturbed.state + by, 0.1 * DURATIONS)[0] for by in (step, -step))
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


def test_sigma_points_move_like_the_mean(disturbed):
    process, n = disturbed.process, disturbed.layout.n_parameters
    mean, _ = disturbed.moved(disturbed.state, DURATIONS)
    block = np.repeat(disturbed.state[:, None], LANES, axis=1)
    parameters, moving, scratch = block[:n].ravel(), block[n:].ravel(), np.zeros(process.scratch_size)
    held = np.arange(len(DURATIONS)) * len(INPUTS) // len(DURATIONS)
    for given, duration in zip(held, DURATIONS, strict=True):
        model = process.constants, process.selection, 5, duration, scratch
        process.advance(moving, parameters, INPUTS[given], *model)
    assert_allclose(moving.reshape(-1, LANES)[:, :5], np.repeat(mean[n:, None], 5, axis=1), rtol=1e-12)


def test_force_accelerates_by_the_mass_matrix_and_decays(experiment_with):
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


# Neutral and balanced, without any drag: in surge it is a mass that forces push.
MASS = 64.0
DRAGLESS = {
    **dict.fromkeys(PARAMETER_SYMBOLS, 0.0),
    **{"m": 60.0, "W": 600.0, "B": 600.0, "Ixx": 1.0, "Iyy": 20.0, "Izz": 20.0, "X_udot": 60.0 - MASS},
    **{"Y_vdot": -50.0, "Z_wdot": -50.0, "K_pdot": -0.1, "M_qdot": -10.0, "N_rdot": -10.0},
}
STEP, EVERY, DENSITY = 0.004, 25, 1e-3
NEVER = np.zeros((1, 4))


def pushed_mass(vehicle, size, time_constant, measured):
    """Return the process, and a timeline with the surge measured to 1 cm/s at regular steps."""
    force = {"standard_deviation": [size, 0.0, 0.0], "time_constant": time_constant}
    settings = Identification(
        coefficients=("K_p|p|",),
        estimate={"biases": ("disturbance",), "disturbance": {"force": force}},
        process_noise={"velocity": DENSITY},
        integration_step=STEP,
    )
    layout = state_layout(settings, vehicle, ())
    process = vehicle_process(vehicle_constants(DRAGLESS), dict.fromkeys(SYMBOLS, 0.0), layout)
    row = np.zeros((1, 1, len(layout.symbols)))
    row[0, 0, layout.row("u")] = 1.0
    sensors = Sensors(row, np.full((1, 1), 1e-4), np.zeros((1, 1), dtype=bool), np.zeros(1, dtype=bool))
    n = EVERY * len(measured)
    steps = np.arange(n + 1)
    timeline = Timeline(
        *(STEP * (1 + np.arange(n)), steps, np.full(n, STEP), np.zeros(n, dtype=np.int64), NEVER),
        *(np.zeros(n, dtype=np.int64), steps // EVERY, np.zeros(len(measured), dtype=np.int8), measured[:, None]),
    )
    # The other states are zero, so that the problem is linear.
    rows, std = layout.rows(("u", "disturbance_X")), np.full(len(layout.symbols), 1e-12)
    std[rows], density = layout.prior_std[rows], np.full(len(process.noise_density), 1e-12)
    density[np.array(rows) - 1] = process.noise_density[np.array(rows) - 1]
    prior = Gaussian(np.zeros(len(layout.symbols)), np.diag(std))
    return process._replace(noise_density=density), sensors, timeline, prior, rows


def filtered(problem, run):
    process, sensors, timeline, prior, rows = problem
    told = []
    outcome = run(process, sensors, [timeline], prior, lambda chunk, records: told.append(records))
    assert outcome.failure == OK
    return told[0].mean[:, rows], outcome.covariance[np.ix_(rows, rows)]


KALMAN = {
    "ekf": run_extended_filter,
    "ckf": partial(run_square_root_filter, cubature(11)),
    "tukf": partial(run_square_root_filter, transformed(11)),
}


@pytest.mark.parametrize("run", KALMAN.values(), ids=KALMAN)
def test_filters_equal_the_textbook_kalman_filter(run, experiment_with, rng):
    measured, size, time_constant = 0.05 * rng.standard_normal(12), 5.0, 0.5
    problem = pushed_mass(experiment_with().vehicle, size, time_constant, measured)
    left = np.exp(-STEP / time_constant)
    transition = np.array([[1.0, 0.5 * STEP * (1.0 + left) / MASS], [0.0, left]])
    driven = np.diag([DENSITY**2 * STEP, 2.0 * size**2 / time_constant * STEP])
    mean, covariance = np.zeros(2), np.diag([0.1**2, size**2])
    means = []
    for event in range(EVERY * len(measured)):
        mean, covariance = transition @ mean, transition @ covariance @ transition.T + driven
        if event % EVERY == EVERY - 1:
            gain = covariance[:, 0] / (covariance[0, 0] + 1e-4)
            mean = mean + gain * (measured[event // EVERY] - mean[0])
            covariance = covariance - np.outer(gain, covariance[0])
        means.append(mean)
    found = filtered(problem, run)
    assert_allclose(found[0], means, rtol=1e-8, atol=1e-9)
    assert_allclose(found[1], covariance, rtol=1e-8)


def test_short_time_constant_becomes_white_noise(experiment_with, rng):
    """Equal density at low frequency; the difference falls with the time constant."""
    measured, density, vehicle = 0.05 * rng.standard_normal(12), 5.0, experiment_with().vehicle
    white = pushed_mass(vehicle, 1e-6, 1.0, measured)
    driven = white[0].noise_density.copy()
    driven[0] = np.hypot(DENSITY, density / MASS)
    mean, covariance = filtered((white[0]._replace(noise_density=driven), *white[1:]), KALMAN["ckf"])
    differences = []
    for time_constant in (0.08, 0.04, 0.02):
        size = density / np.sqrt(2.0 * time_constant)
        coloured, uncertain = filtered(pushed_mass(vehicle, size, time_constant, measured), KALMAN["ckf"])
        off = np.abs(coloured - mean)[EVERY - 1 :: EVERY, 0].max() / np.sqrt(covariance[0, 0])
        differences.append([off, abs(uncertain[0, 0] / covariance[0, 0] - 1.0)])
    first, second, third = np.array(differences)
    assert np.all(second < 0.6 * first)
    assert np.all(third < 0.6 * second)


PUSHED = "{force: {standard_deviation: 5 N, time_constant: 2 s}, moment: {standard_deviation: [0, 2, 2]}}"
SHORT = "manoeuvre.duration=40 s", "sensors.attitude={source: direct, rate: 20 Hz}", "sensors.gyroscope.rate=20 Hz"
ASKED = f"identification.estimate={{biases: [disturbance], disturbance: {PUSHED}}}"


@pytest.fixture(scope="module")
def pushed(simulated_with):
    """A run under forces that are estimated, with few coefficients."""
    few = "identification.coefficients=[X_u|u|, N_url, N_uudr]"
    return simulated_with(*SHORT, f"manoeuvre.disturbance={PUSHED}", ASKED, few)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FilterName if not name.is_free_run_fit])
def test_estimators_follow_the_force_and_are_consistent_with_it(name, pushed):
    estimate = identify(pushed, name)
    assert estimate.status == "completed"
    late = estimate.time > 5.0
    acted = pushed.truth.disturbance[np.searchsorted(pushed.truth.time, estimate.time[late] - 1e-9, side="right") - 1]
    for axis in (0, 1, 2, 4, 5):
        row = estimate.state.index(DISTURBANCE[axis].symbol)
        found, deviation = estimate.mean[late, row], estimate.standard_deviation[late, row]
        assert np.corrcoef(found, acted[:, axis])[0, 1] > 0.5
        assert np.sqrt(np.mean(((found - acted[:, axis]) / deviation) ** 2)) < 1.5
    assert "disturbance_K" not in estimate.state
    for sensor, innovations in estimate.innovations.items():
        assert innovations.sums().mean_nis == pytest.approx(1.0, abs=0.15), sensor


def test_output_error_refuses_a_disturbance(pushed):
    with pytest.raises(ConfigError, match=r"disturbance.*output_error"):
        identify(pushed, FilterName.OUTPUT_ERROR)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ("{}", r"must state the standard_deviation of a force or a moment"),
        (
            "{moment: {standard_deviation: [0, 0, 1], time_constant: [1, 1, 0.09]}}",
            r"disturbance_N has a time_constant of 0.09 s; expected at least 0.2 s, 5 times integration_step",
        ),
    ],
)
def test_a_disturbance_without_size_or_duration_is_refused(settings, words, experiment_with):
    asked = f"identification.estimate={{biases: [disturbance], disturbance: {settings}}}"
    with pytest.raises(ConfigError, match=words):
        experiment_with(asked)
    experiment_with(asked.replace("[disturbance]", "[]"))


def test_too_short_time_constant_is_refused(simulated_with):
    slow = "sensors.dvl.rate=2 Hz", "sensors.gyroscope.rate=2 Hz", "sensors.attitude={source: direct, rate: 2 Hz}"
    with pytest.raises(DataError, match=r"disturbance_X has a time_constant of 2 s; expected"):
        identify(simulated_with("manoeuvre.duration=10 s", *slow, ASKED), FilterName.CKF)
