"""Faults that the simulation itself makes are named for what they are."""

import pytest

from auvid_cli.inspection.inspect import inspect_dataset


def judged(simulated_with, *overrides):
    """Verdicts by subject and name, and those that failed."""
    checks = inspect_dataset(simulated_with("sensors.attitude.source=direct", *overrides)).checks
    return {(check.subject, check.check): check for check in checks}, checks.failed()


@pytest.mark.slow
def test_outliers_fail_as_spikes(simulated_with):
    settings = ("sensors.dvl.outlier_probability=0.01", "sensors.dvl.outlier_size=1 m/s")
    checks, fails = judged(simulated_with, *settings)
    assert [(check.subject, check.check) for check in fails] == [("dvl", "spikes")]
    # 2100 measurements, of which 21 are wild, give or take.
    assert 10 <= int(checks["dvl", "spikes"].statistic.split(";")[0]) <= 32


@pytest.mark.slow
def test_dropouts_count_as_missing(simulated_with):
    checks, fails = judged(simulated_with, "sensors.gyroscope.dropout_probability=0.2")
    assert fails == []
    missing = checks["gyroscope", "missing"]
    assert missing.passed is None
    assert float(missing.statistic.split("%")[0]) == pytest.approx(20.0, abs=1.0)


@pytest.mark.slow
def test_coarse_sensor_shows_quantisation(simulated_with):
    # 0.01 rad/s is 8.6 times 0.2 deg/s / 3, the stated noise.
    checks, fails = judged(simulated_with, "sensors.gyroscope.quantisation=0.01 rad/s")
    assert fails == []
    quantisation = checks["gyroscope", "quantisation"]
    assert quantisation.passed is None
    assert "p 8.59" in quantisation.statistic


@pytest.mark.slow
def test_more_noise_than_stated_is_noted(simulated_with):
    settings = ("sensors.gyroscope.noise=1 deg/s", "sensors.gyroscope.standard_deviation=0.2 deg/s")
    checks, fails = judged(simulated_with, "sensors.gyroscope.range=null", *settings)
    assert fails == []
    floor = checks["gyroscope", "noise floor"]
    assert floor.passed is None
    assert float(floor.statistic.split(",")[0].split()[1]) == pytest.approx(5.0, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [8.0, -8.0])
def test_rotated_dvl_shows_heading_offset(degrees, simulated_with):
    checks, fails = judged(simulated_with, f"sensors.dvl.mounting_yaw={degrees} deg")
    assert fails == []
    offset = checks["dvl", "heading offset"]
    assert offset.passed is None
    # Turned to starboard it sees the way ahead to port.
    assert float(offset.statistic.split()[0]) == pytest.approx(-degrees, abs=1.0)


@pytest.mark.slow
def test_excitation_states_rms_of_inputs(simulated_with):
    """RMS about the mean and peak of what was commanded, cell means of 0.1 s."""
    dataset = simulated_with("sensors.attitude.source=direct")
    (check,) = [c for c in inspect_dataset(dataset).checks if (c.subject, c.check) == ("rudder", "excitation")]
    rudder = dataset.inputs.values[:, 0] * 57.29577951308232
    said = [float(part.split()[1]) for part in check.statistic.replace("about the mean, ", "").split("deg")[:2]]
    assert said[0] == pytest.approx(rudder.std(), rel=0.02)
    assert said[1] == pytest.approx(abs(rudder).max(), rel=0.02)


@pytest.mark.slow
def test_drifting_gyroscope_shows_bias_instability(simulated_with):
    checks, _ = judged(simulated_with, "sensors.gyroscope.drift=0.05 deg/s/s^0.5")
    assert any(name.startswith("bias instability") for _, name in checks)
