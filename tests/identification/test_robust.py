"""Outliers on all sensors, and fits that weigh them down."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.data.estimate_file import read_estimate, write_estimate
from auvid_cli.evaluation.innovations import innovation_checks, sensor_consistency
from auvid_cli.evaluation.judgement import status_of
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.coefficients import SYMBOLS

N = len(SYMBOLS)
WHITE = (
    "manoeuvre.duration=20 s",
    "manoeuvre.initial_speed=2 m/s",
    "manoeuvre.excitation.fade_in=2 s",
    "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}",
    "sensors.gyroscope.rate=50 Hz",
)
BATCH = tuple(name for name in FilterName if name.in_one_batch)


@pytest.fixture(scope="module")
def clean(simulated_with):
    return simulated_with(*WHITE)


@pytest.fixture(scope="module")
def with_outliers(clean):
    """The same with 1 % of the measurements of each sensor 20 of its standard deviations off."""
    rng, sensors = np.random.default_rng(1), {}
    for name, record in clean.sensors.items():
        values = record.values.copy()
        wild = rng.random(len(values)) < 0.01
        values[wild] += 20.0 * record.standard_deviation * rng.choice([-1.0, 1.0], (wild.sum(), values.shape[1]))
        sensors[name] = replace(record, values=values)
    return replace(clean, sensors=sensors)


@pytest.fixture(scope="module", params=BATCH, ids=[name.value for name in BATCH])
def estimates(request, clean, with_outliers, with_settings):
    """Return estimates: plain with clean data, robust with clean data, robust with outliers."""
    robust = (with_settings(data, "identification.robust=huber") for data in (clean, with_outliers))
    return [identify(data, request.param) for data in (clean, *robust)]


@pytest.mark.slow
def test_outliers_move_no_coefficient_by_a_standard_deviation(estimates):
    plain, _, wild = estimates
    deviation = plain.standard_deviation[-1, :N]
    assert np.abs((wild.mean - plain.mean)[-1, :N] / deviation).max() < 1.0
    assert status_of(wild) == "completed"


@pytest.mark.slow
def test_clean_data_lose_little(estimates):
    plain, robust, _ = estimates
    assert plain.innovations["dvl"].weight is None
    ratio = (robust.standard_deviation / plain.standard_deviation)[-1, :N]
    assert (ratio > 1.0).all()
    assert (ratio < 1.015).all()


@pytest.mark.slow
def test_weights_and_counts_are_reported_by_sensor(estimates, with_outliers, tmp_path):
    *_, wild = estimates
    write_estimate(tmp_path / "estimate.h5", wild)
    back = read_estimate(tmp_path / "estimate.h5")
    for row in sensor_consistency(back):
        weight = wild.innovations[row.sensor].weight
        assert np.array_equal(back.innovations[row.sensor].weight, weight)
        present = np.isfinite(wild.innovations[row.sensor].innovation)
        assert row.rejected == (weight[present] < 0.5).sum()
        assert 0.005 < row.rejected / present.sum() < 0.02
        assert row.mean_weight == pytest.approx(weight[present].mean())
        assert row.mean_nis == pytest.approx(1.0, abs=0.2)
    told = [check for check in innovation_checks(with_outliers, back) if check.check == "robust"]
    assert len(told) == len(back.innovations)
    assert all("weighted less than half" in check.statistic for check in told)
