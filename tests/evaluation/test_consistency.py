"""Normalised innovations on sequences whose consistency is known."""

import numpy as np
import pytest

from auvid_cli.evaluation.innovations import mean_nis, sensor_consistency
from auvid_cli.evaluation.judgement import status_of
from auvid_cli.identification.run import identify


def estimate_with(hand_made, **innovations):
    return hand_made([0, 1], {"Y_url": [0, 1]}, innovations=innovations)


@pytest.mark.parametrize(("actual", "claimed", "expected"), [(4.0, 4.0, 1.0), (4.0, 1.0, 4.0), (1.0, 4.0, 0.25)])
def test_nis_per_component_is_the_ratio_of_variances(actual, claimed, expected, hand_made, innovations_of):
    estimate = estimate_with(hand_made, dvl=innovations_of(3000, 3, actual, claimed))
    (result,) = sensor_consistency(estimate)
    # 9000 squares: a standard deviation of 1.5 percent.
    assert result.mean_nis == pytest.approx(expected, rel=0.07)
    assert (result.sensor, result.measurements) == ("dvl", 3000)
    assert mean_nis(estimate) == result.mean_nis


def test_missing_components_do_not_count(hand_made, innovations_of):
    record = innovations_of(4, 3, 1.0, 1.0)
    record.innovation[:] = 2.0
    for values in (record.innovation, record.variance):
        values[1, 0] = values[2, :] = np.nan
    nis = np.nansum(record.innovation**2, axis=1)
    nis[2] = np.nan
    record.nis[:] = nis
    (result,) = sensor_consistency(estimate_with(hand_made, dvl=record))
    assert result.mean_nis == pytest.approx(4.0)
    assert result.measurements == 3


def test_a_sensor_without_measurements_has_no_nis(hand_made, innovations_of):
    estimate = estimate_with(hand_made, dvl=innovations_of(0, 3, 1.0, 1.0))
    assert np.isnan(sensor_consistency(estimate)[0].mean_nis)
    assert np.isnan(mean_nis(estimate))


def test_the_total_weighs_components_alike(hand_made, innovations_of):
    many, few = innovations_of(90, 1, 1.0, 1.0), innovations_of(10, 1, 1.0, 1.0)
    many.nis[:], few.nis[:] = 1.0, 11.0
    assert mean_nis(estimate_with(hand_made, dvl=many, attitude=few)) == pytest.approx(2.0)


@pytest.mark.parametrize("actual", [0.1, 1.0, 1.3])
def test_innovations_no_larger_than_stated_pass(actual, hand_made, innovations_of):
    estimate = estimate_with(hand_made, dvl=innovations_of(3000, 3, actual, 1.0))
    assert status_of(estimate) == "completed"


def test_one_sensor_whose_innovations_are_too_large_is_named(hand_made, innovations_of):
    good, bad = innovations_of(3000, 3, 1.0, 1.0), innovations_of(300, 3, 4.0, 1.0)
    said = status_of(estimate_with(hand_made, gyroscope=good, dvl=bad))
    assert said.startswith("inconsistent")
    assert "dvl" in said
    assert "gyroscope" not in said


def test_divergence_is_the_status_whatever_the_innovations(hand_made, innovations_of):
    status = "diverged at t = 2.000 s: why"
    bad = {"dvl": innovations_of(300, 3, 9.0, 1.0)}
    assert status_of(hand_made([0, 1], {"Y_url": [0, 1]}, status, bad)) == status


@pytest.mark.slow
def test_the_wrong_vehicle_is_called_inconsistent(simulated_with, filter_name, with_settings):
    """Roll inertia and righting moment far from what they are: no coefficient makes up for that."""
    run = simulated_with("manoeuvre.duration=8 s", "sensors.attitude.rate=25 Hz", "sensors.gyroscope.rate=25 Hz")
    wrong = with_settings(run, "vehicle.parameters.Ixx=4 kg*m^2", "vehicle.parameters.zG=3 cm")
    assert status_of(identify(wrong, filter_name)).startswith(("inconsistent", "diverged", "unconverged"))


@pytest.mark.slow
def test_filters_on_white_noise_are_consistent(simulated_with, filter_name):
    """A direct attitude sensor, so that no sensor's error is correlated in time."""
    dataset = simulated_with(
        "manoeuvre.duration=60 s", "identification.ekf.transition=exact",
        "sensors.attitude={source: direct, rate: 20 Hz, noise: 0.1 deg}", "sensors.gyroscope.rate=25 Hz",
    )  # fmt: skip
    for result in sensor_consistency(identify(dataset, filter_name)):
        # n measurements of 3 components: the mean has a standard deviation of sqrt(2 / 3 n).
        spread = np.sqrt(2.0 / (3 * result.measurements))
        assert result.mean_nis == pytest.approx(1.0, abs=5 * spread + 0.02), result.sensor
