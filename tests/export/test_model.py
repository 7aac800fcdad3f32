from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.errors import DataError
from auvid_cli.evaluation.accuracy import coefficient_results
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.export.model import Origin, acting_inputs, identified_model
from auvid_cli.export.unsupported_features import UnsupportedFeatures, caveats, heading_lines
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.coefficients import COEFFICIENTS, EQUATION_ROWS, N_COEFFICIENTS

SOUND = Judgement(Grade.SOUND)

ORIGIN = Origin("d" * 64, "e" * 64, "1.2.3", "2026-01-01T00:00:00+00:00")
CHOSEN = ("X_u|u|", "Z_uude", "N_uudr")


@pytest.fixture(scope="module")
def dataset(simulated_with):
    return simulated_with(f"identification.coefficients=[{', '.join(CHOSEN)}]", "manoeuvre.duration=4 s")


@pytest.fixture(scope="module")
def estimate(dataset):
    return identify(dataset, FilterName.TUKF)


@pytest.fixture(scope="module")
def model(estimate, dataset):
    return identified_model(estimate, dataset, {}, ORIGIN)


def test_values_are_final_or_held(model, estimate, dataset):
    final = dict(zip(estimate.state, zip(estimate.mean[-1], estimate.standard_deviation[-1], strict=True), strict=True))
    for coefficient in model.coefficients:
        if coefficient.symbol in CHOSEN:
            assert (coefficient.value, coefficient.standard_deviation) == final[coefficient.symbol]
        else:
            assert coefficient.value == dataset.experiment.vehicle.all_coefficients()[coefficient.symbol]
            assert (coefficient.standard_deviation, coefficient.identified) == (None, None)
    assert model.estimated() == CHOSEN


def test_covariance_is_that_of_the_coefficients(model):
    deviations = [each.standard_deviation for each in model.coefficients if each.standard_deviation is not None]
    np.testing.assert_allclose(np.sqrt(np.diag(model.covariance)), deviations, rtol=1e-9)
    assert np.array_equal(model.covariance, model.covariance.T)


def test_corrected_uncertainties_keep_correlations(estimate, dataset, model):
    nominal = dict(zip(estimate.state, estimate.standard_deviation[-1].tolist(), strict=True))
    corrected = replace(estimate, corrected={symbol: 2.0 * nominal[symbol] for symbol in CHOSEN[:2]})
    wider = identified_model(corrected, dataset, {}, ORIGIN)
    stated = {each.symbol: each.standard_deviation for each in wider.coefficients if each.standard_deviation}
    assert stated == {**corrected.corrected, CHOSEN[2]: nominal[CHOSEN[2]]}
    times = np.array([2.0, 2.0, 1.0])
    np.testing.assert_allclose(wider.covariance, model.covariance * np.outer(times, times))


def test_identified_coefficients_equal_the_tables(estimate, dataset):
    bounds = {"Z_uude": np.inf}
    model = identified_model(estimate, dataset, bounds, ORIGIN, reference=replace(estimate, filter="smoother"))
    assert "Z_uude" in model.not_identified()
    expected = {
        result.coefficient: result.identified for result in coefficient_results(estimate, dataset.truth, bounds, SOUND)
    }
    assert {c.symbol: c.identified for c in model.coefficients if c.identified is not None} == expected
    assert "Z_uude" in caveats(model)[0]


def test_term_sizes_are_along_the_estimated_motion(model, estimate, dataset):
    """The elevator's heave force by hand, event by event."""
    u = estimate.mean[:, estimate.state.index("u")]
    value = next(each.value for each in model.coefficients if each.symbol == "Z_uude")
    squares = 0.0
    for time, speed in zip(estimate.time, u, strict=True):
        row = max(i for i, begin in enumerate(dataset.inputs.time) if begin <= time)
        squares += (value * speed**2 * dataset.inputs.values[row, 1]) ** 2
    size = next(size for size in model.term_sizes if size.symbol == "Z_uude")
    assert size.rms == pytest.approx(np.sqrt(squares / estimate.time.size), rel=1e-9)
    assert size.rms > 0.01
    for row in EQUATION_ROWS:
        shares = [size.percent for size in model.term_sizes if size.row == row]
        assert np.hypot.reduce(shares) == pytest.approx(100.0)
    assert [size.symbol for size in model.term_sizes] == [c.symbol for c in COEFFICIENTS]


def test_unused_segments_do_not_shift_inputs(simulated_with, with_settings):
    """The gap is four seconds; an elevator that tells its own time shows which row was taken."""
    dataset = simulated_with(f"identification.coefficients=[{', '.join(CHOSEN)}]", "manoeuvre.duration=10 s")
    estimate = identify(with_settings(dataset, "identification.use.spans=[[0, 3], [7, 10]]"), FilterName.CKF)
    assert np.diff(estimate.time).max() == pytest.approx(4.0, abs=0.1)
    inputs = dataset.inputs
    clock = inputs.values.copy()
    clock[:, 1] = inputs.time
    acting = acting_inputs(estimate, replace(inputs, values=clock))[:, 1]
    step = np.diff(inputs.time).max()
    assert step < 0.2
    late = estimate.time - acting
    assert late.min() > -1e-9
    assert late.max() < step - 1e-9


def test_further_states_have_their_covariance(dataset, with_settings):
    seen = with_settings(
        dataset, "identification.estimate.biases=[thrust, current, gyro]", "vehicle.actuators.fins.time_constant=0.1 s"
    )
    estimate = identify(seen, FilterName.CKF)
    model = identified_model(estimate, seen, {}, ORIGIN)
    units = {state.symbol: state.unit for state in model.states}
    expected = {"thrust_scale": "1", "current_north": "m/s", "current_east": "m/s"}
    assert units == expected | dict.fromkeys(("bias_p", "bias_q", "bias_r"), "rad/s")
    for state in model.states:
        column = estimate.state.index(state.symbol)
        assert state.value == estimate.mean[-1, column]
        assert state.standard_deviation == estimate.standard_deviation[-1, column]
    assert model.actuation.thrust == pytest.approx(1.0 + estimate.mean[-1, estimate.state.index("thrust_scale")])
    assert model.actuation.actuators.fins.time_constant == 0.1
    heave = next(size for size in model.term_sizes if size.symbol == "Z_uude")
    value = estimate.final_coefficients()["Z_uude"]
    force = value * estimate.mean[:, estimate.state.index("u")] ** 2 * acting_inputs(estimate, seen.inputs)[:, 1]
    assert heave.rms == pytest.approx(np.sqrt(np.mean(force**2)))
    deviations = [each.standard_deviation for each in model.coefficients if each.standard_deviation is not None]
    deviations += [state.standard_deviation for state in model.states]
    np.testing.assert_allclose(np.sqrt(np.diag(model.covariance)), deviations, rtol=1e-9)


def test_depth_is_not_a_further_state(simulated_with):
    measured = simulated_with("manoeuvre.duration=4 s", "sensors.depth={rate: 10 Hz, noise: 0.02 m}")
    estimate = identify(measured, FilterName.CKF)
    assert "down" in estimate.state
    model = identified_model(estimate, measured, {}, ORIGIN)
    assert model.states == ()
    assert model.covariance.shape == (N_COEFFICIENTS, N_COEFFICIENTS)


@pytest.mark.parametrize("status", ["diverged at t = 2 s: not finite", "unconverged: out of evaluations"])
def test_incomplete_estimate_is_refused(status, estimate, dataset):
    with pytest.raises(DataError, match=f"tukf {status.split(':')[0]}.*nothing is exported"):
        identified_model(replace(estimate, status=status), dataset, {}, ORIGIN)


def test_inconsistent_estimate_has_a_caveat(estimate, dataset):
    belied = {
        name: replace(one, innovation=10 * one.innovation, nis=100 * one.nis)
        for name, one in estimate.innovations.items()
    }
    model = identified_model(replace(estimate, innovations=belied), dataset, {}, ORIGIN)
    assert model.not_identified() == CHOSEN
    lines = heading_lines(model, UnsupportedFeatures((), ()))
    assert any(line.startswith("Do not rely on these values, inconsistent: ") for line in lines)
    assert "Nothing is lost." in lines


def test_doubt_of_one_coefficient_is_no_caveat_of_all(model):
    doubtful = Judgement(Grade.DOUBTFUL, "a bias of the gyroscope", doubted=("N_r|r|",))
    (caveat,) = caveats(replace(model, judgement=doubtful, speed_remarks=()))
    assert caveat.startswith("The estimate is doubtful: a bias of the gyroscope")
    (caveat,) = caveats(replace(model, judgement=doubtful._replace(doubted=None), speed_remarks=()))
    assert caveat.startswith("Do not rely on these values, doubtful: ")


def test_heading_names_the_parameters_and_the_speed_of_the_coefficients(model):
    at_one_speed = replace(model, speed_remarks=("X_u|u| holds at one speed.",))
    lines = heading_lines(at_one_speed, UnsupportedFeatures((), ()))
    (parameters,) = (line for line in lines if "with these parameters" in line)
    known = model.experiment.vehicle.known_parameters()
    assert f"Izz = {known['Izz']:.5g} kg*m^2" in parameters
    assert "X_u|u| holds at one speed." in lines
    assert "X_u|u| holds at one speed." in caveats(at_one_speed)
