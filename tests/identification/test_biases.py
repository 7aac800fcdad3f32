"""Sensor errors as states: found where the data hold them, named where they do not."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.data.dataset import Dataset
from auvid_cli.errors import DataError
from auvid_cli.evaluation.accuracy import average_steady_state_error, coefficient_results, sensor_error_results
from auvid_cli.evaluation.judgement import Grade, Judgement, status_of
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.rigid_body import NO_BALLAST, Ballast

SOUND = Judgement(Grade.SOUND)

GYRO = np.array([0.004, -0.003, 0.005])
ATTITUDE = np.array([0.003, -0.004, 0.03])
SCALE, YAW = 0.02, 0.03
BIASED = (
    "manoeuvre.duration=60 s",
    "sensors.gyroscope={rate: 25 Hz, range: 0.2 deg/s, bias: [0.004, -0.003, 0.005]}",
    "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg, bias: [0.003, -0.004, 0.03]}",
)
ALL = "identification.estimate.biases=[gyro, attitude]"


@pytest.fixture(scope="module")
def biased(simulated_with):
    return simulated_with(*BIASED)


@pytest.fixture(scope="module")
def mounted_badly(simulated_with):
    """A DVL that reads 2 % too much and is turned by 0.03 rad; everything else without bias."""
    direct = "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}", "sensors.gyroscope.rate=25 Hz"
    return simulated_with(
        "manoeuvre.duration=60 s", *direct, f"sensors.dvl.scale_error={SCALE}", f"sensors.dvl.mounting_yaw={YAW}"
    )


def by_state(estimate):
    return {row.state: row for row in sensor_error_results(estimate)}


def test_without_blocks_the_biases_are_noticed(biased):
    estimate = identify(biased, FilterName.TUKF)
    assert status_of(estimate).startswith("inconsistent: innovations of gyroscope")
    assert sensor_error_results(estimate) == []


@pytest.mark.slow
def test_constant_biases_are_found_and_the_heading_offset_is_not(biased, with_settings, filter_name):
    dataset = with_settings(biased, ALL)
    estimate = identify(dataset, filter_name)
    assert status_of(estimate) == "completed"
    found = by_state(estimate)
    true = dict(zip(["bias_p", "bias_q", "bias_r"], GYRO, strict=True))
    true |= dict(zip(["bias_phi", "bias_theta"], ATTITUDE, strict=False))
    for symbol, value in true.items():
        row = found[symbol]
        assert row.observed
        assert abs(row.estimate - value) < 4.0 * row.standard_deviation
        assert row.standard_deviation < 0.2 * abs(value)
    assert not found["bias_psi"].observed
    # Half of the variance of heading plus offset, which alone is known, stays with each.
    # Output error has no prior, and says that it knows nothing.
    row = found["bias_psi"]
    expected = np.inf if filter_name is FilterName.OUTPUT_ERROR else row.prior_standard_deviation / 2**0.5
    assert row.standard_deviation == pytest.approx(expected, rel=0.05)


def test_blocks_bring_the_coefficients_back(biased, with_settings):
    errors = [
        average_steady_state_error(coefficient_results(identify(dataset, FilterName.CKF), biased.truth, {}, SOUND))
        for dataset in (biased, with_settings(biased, ALL))
    ]
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.slow
def test_scale_and_mounting_of_the_dvl_are_found(mounted_badly, with_settings, filter_name):
    # Narrow priors: with wide ones the first seconds, where the millimetre-sharp DVL and unknown coefficients meet,
    # lead some filters astray, which their status then says.
    settings = "identification.estimate.biases=[dvl]", "identification.prior.factor=0.3"
    estimate = identify(with_settings(mounted_badly, *settings), filter_name)
    assert status_of(estimate) == "completed"
    found = by_state(estimate)
    yaw = found["dvl_yaw"]
    assert yaw.observed
    assert abs(yaw.estimate - YAW) < 4.0 * yaw.standard_deviation
    scale = found["dvl_scale"]
    assert abs(scale.estimate - SCALE) < 4.0 * scale.standard_deviation


@pytest.mark.slow
def test_a_bias_that_walks_is_followed(simulated_with, with_settings, kalman_filter):
    drifting = simulated_with(*BIASED, "sensors.gyroscope.rate=50 Hz", "sensors.gyroscope.drift=5e-4 rad/s/s^0.5")
    constant = identify(with_settings(drifting, ALL), kalman_filter)
    walking = identify(
        with_settings(drifting, ALL, "identification.estimate.gyro.walk=5e-4 rad/s/s^0.5"), kalman_filter
    )
    assert walking.state[-3:] == ("bias_p", "bias_q", "bias_r")
    nis = [np.nanmean(e.innovations["gyroscope"].nis) / 3.0 for e in (constant, walking)]
    assert nis[1] == pytest.approx(1.0, abs=0.03)
    assert nis[0] > 1.05


def test_walking_bias_is_reported_for_each_segment(biased, with_settings):
    spans, walk = [[0.0, 15.0], [20.0, 40.0]], "identification.estimate.gyro.walk=1e-6 rad/s/s^0.5"
    estimate = identify(with_settings(biased, ALL, walk, f"identification.use.spans={spans}"), FilterName.CKF)
    rows = [row for row in sensor_error_results(estimate, [15.0, 40.0]) if row.state in ("bias_p", "bias_phi")]
    assert [(row.state, row.segment) for row in rows] == [("bias_p", 1), ("bias_p", 2), ("bias_phi", None)]
    of_first = estimate.mean[estimate.time <= 15.0][-1, estimate.state.index("bias_p")]
    assert rows[0].estimate == of_first != rows[1].estimate
    cut = replace(estimate, time=estimate.time[:9], mean=estimate.mean[:9])
    cut = replace(cut, standard_deviation=estimate.standard_deviation[:9])
    assert [row.segment for row in sensor_error_results(cut, [15.0, 40.0]) if row.state == "bias_p"] == [1]


def test_an_error_of_a_sensor_that_is_not_there_is_refused(biased, with_settings):
    sensors = {name: record for name, record in biased.sensors.items() if name != "dvl"}
    with pytest.raises(DataError, match=r"biases: dvl_scale.*dvl"):
        identify(
            with_settings(replace(biased, sensors=sensors), "identification.estimate.biases=[dvl]"), FilterName.CKF
        )


ARM, TRIM = np.array([0.4, -0.1, 0.15]), np.array([0.012, -0.008])


@pytest.fixture(scope="module")
def off_centre(simulated_with):
    """Function: a run with a DVL ahead of the origin, and fins that are not where they are said to be.

    Some Kalman filters need inputs and samples at 100 Hz. The others take most of the time, and half is enough.
    """

    @cache
    def run(rate: str) -> Dataset:
        direct = f"sensors.attitude={{source: direct, rate: {rate}, noise: 0.1 deg}}", f"sensors.gyroscope.rate={rate}"
        trim = f"manoeuvre.fin_trim={{rudder: {TRIM[0]}, elevator: {TRIM[1]}}}"
        duration = "manoeuvre.duration=60 s", f"manoeuvre.input_rate={rate}"
        return simulated_with(*duration, *direct, trim, f"sensors.dvl.arm={ARM.tolist()}")

    return run


@pytest.mark.slow
def test_fin_trims_and_the_arm_of_a_dvl_are_found(off_centre, with_settings, filter_name):
    settings = (
        "identification.estimate={biases: [dvl_arm, fin_trim], dvl_arm: {axes: [x, y, z]}}",
        "identification.prior.factor=0.3",
    )
    dataset = off_centre("50 Hz" if filter_name.in_one_batch else "100 Hz")
    estimate = identify(with_settings(dataset, *settings), filter_name)
    assert status_of(estimate) == "completed"
    found = by_state(estimate)
    expected = dict(zip(("dvl_x", "dvl_y", "dvl_z", "rudder_trim", "elevator_trim"), (*ARM, *TRIM), strict=True))
    for symbol, value in expected.items():
        row = found[symbol]
        assert row.observed, symbol
        assert abs(row.estimate - value) < 4.0 * row.standard_deviation, symbol
        assert row.standard_deviation < 0.3 * abs(value), symbol
    trims = tuple(found[f"{fin}_trim"].estimate for fin in ("rudder", "elevator"))
    assert estimate.final_actuators() == (1.0, *trims)


@pytest.mark.slow
def test_an_arm_may_walk(off_centre, with_settings):
    settings = "identification.estimate={biases: [dvl_arm, fin_trim], dvl_arm: {axes: [x, y, z], walk: 1 mm/s^0.5}}"
    found = by_state(identify(with_settings(off_centre("50 Hz"), settings), FilterName.SMOOTHER))
    for symbol, value in zip(("dvl_x", "dvl_y", "dvl_z"), ARM, strict=True):
        row = found[symbol]
        assert abs(row.estimate - value) < 4.0 * row.standard_deviation, symbol
        # Only the last instants count; a constant over 60 s would be more accurate.
        assert 1e-3 < row.standard_deviation < 0.01, symbol


BALLAST = Ballast(excess_buoyancy=5.0, trim_moment=-1.5)


def buoyancy(parameters):
    return [f"vehicle.parameters.{symbol}={parameters[symbol]!r}" for symbol in ("B", "xB", "yB", "zB")]


@pytest.fixture(scope="module")
def ballasted(simulated_with, with_settings, experiment_with):
    """A vehicle whose file states another buoyancy, at another place, than it has."""
    stated = experiment_with().vehicle.known_parameters()

    direct = "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}", "sensors.gyroscope.rate=25 Hz"
    dataset = simulated_with("manoeuvre.duration=60 s", *direct, *buoyancy(BALLAST.added_to(stated)))
    return with_settings(dataset, *buoyancy(stated))


def assert_ballast_is_found(estimate, truth):
    assert status_of(estimate) == "completed"
    found = by_state(estimate)
    assert estimate.final_ballast() == (found["excess_buoyancy"].estimate, found["trim_moment"].estimate)
    for symbol, value in BALLAST._asdict().items():
        row = found[symbol]
        assert row.observed, symbol
        assert abs(row.estimate - value) < 4.0 * row.standard_deviation, symbol
        assert row.standard_deviation < 0.02 * abs(value), symbol
    for row in coefficient_results(estimate, truth, {}, SOUND):
        assert abs(row.estimate - row.true) < 4.0 * row.standard_deviation, row.coefficient


@pytest.mark.slow
def test_ballast_and_coefficients_are_estimated_together(ballasted, with_settings, filter_name):
    seeing = with_settings(ballasted, "identification.estimate.biases=[ballast]", "identification.prior.factor=0.3")
    assert_ballast_is_found(identify(seeing, filter_name), ballasted.truth)


def test_ballast_is_found_by_the_transition_of_the_paper(ballasted, with_settings):
    paper = "identification.ekf.transition=first_order", "identification.estimate.biases=[ballast]"
    assert_ballast_is_found(identify(with_settings(ballasted, *paper), FilterName.EKF), ballasted.truth)


@pytest.mark.parametrize("name", [FilterName.CKF, FilterName.EKF])
def test_ballast_that_walks_is_a_moving_state(ballasted, with_settings, name):
    asked = "{biases: [ballast], ballast: {buoyancy_walk: 1e-3 N/s^0.5, moment_walk: 1e-3 N*m/s^0.5}}"
    estimate = identify(with_settings(ballasted, f"identification.estimate={asked}"), name)
    assert estimate.state[-2:] == Ballast._fields
    assert_ballast_is_found(estimate, ballasted.truth)


def test_without_the_block_the_ballast_is_noticed(ballasted):
    estimate = identify(ballasted, FilterName.CKF)
    assert status_of(estimate).startswith("inconsistent")
    assert estimate.final_ballast() == NO_BALLAST


def test_walking_trim_and_one_axis_of_an_arm_are_states(off_centre, with_settings):
    asked = "{biases: [dvl_arm, fin_trim], fin_trim: {fins: [rudder], walk: 1e-4}}"
    estimate = identify(with_settings(off_centre("100 Hz"), f"identification.estimate={asked}"), FilterName.CKF)
    assert set(by_state(estimate)) == {"dvl_x", "rudder_trim"}
    assert estimate.state[-1] == "rudder_trim"


@pytest.mark.slow
def test_walking_ballast_differs_between_segments(simulated_with, with_settings, experiment_with):
    """Two dives one after the other, with 6 N and a moment of 2 N m between them."""
    stated = experiment_with().vehicle.known_parameters()
    slow = "manoeuvre.duration=25 s", "sensors.gyroscope.rate=10 Hz", "identification.coefficients=[Z_uwl, M_uwl]"
    direct = "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}", *slow
    each = [Ballast(4.0, -1.5), Ballast(-2.0, 0.5)]
    first, second = (simulated_with(*direct, f"seed={k}", *buoyancy(b.added_to(stated))) for k, b in enumerate(each))
    later, names = 40.0, ("dvl", "gyroscope", "attitude")
    inputs = replace(
        first.inputs,
        time=np.append(first.inputs.time, second.inputs.time + later),
        values=np.vstack([first.inputs.values, second.inputs.values]),
    )
    sensors = {
        name: replace(
            first.sensors[name],
            time=np.append(first.sensors[name].time, second.sensors[name].time + later),
            values=np.vstack([first.sensors[name].values, second.sensors[name].values]),
        )
        for name in names
    }
    asked = "{biases: [ballast], ballast: {buoyancy_walk: 1e-4, moment_walk: 1e-4}}"
    joined = with_settings(
        replace(first, inputs=inputs, sensors=sensors, truth=None),
        *buoyancy(stated),
        f"identification.estimate={asked}",
        "identification.use.longest_gap=5 s",
    )
    estimate = identify(joined, FilterName.SMOOTHER)
    assert estimate.completed
    rows = [estimate.state.index(symbol) for symbol in Ballast._fields]
    for at, true in zip((12.0, 52.0), each, strict=True):
        event = int(np.abs(estimate.time - at).argmin())
        error = (estimate.mean[event, rows] - true) / estimate.standard_deviation[event, rows]
        assert np.abs(error).max() < 4.0
        assert estimate.standard_deviation[event, rows[0]] < 0.5
