"""A DVL away from the accelerometer is found by what turning adds to it."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.inspection.inspect import inspect_dataset


@pytest.fixture(scope="module", params=[("spiral", "ahrs"), ("zigzag_20_20", "direct")], ids="-".join)
def dataset(request, sound_run):
    return sound_run(*request.param)


def moved_ahead(dataset, metres):
    """The dataset with the velocity of another place: ``v + x r`` and ``w - x q``, by the gyroscope, smoothed."""
    dvl, gyroscope = dataset.sensors["dvl"], dataset.sensors["gyroscope"]
    values, weights = dvl.values.copy(), np.ones(9) / 9.0
    q, r = (
        np.interp(dvl.time, gyroscope.time, np.convolve(gyroscope.values[:, column], weights, "same"))
        for column in (1, 2)
    )
    values[:, 1] += metres * r
    values[:, 2] -= metres * q
    return replace(dataset, sensors=dataset.sensors | {"dvl": replace(dvl, values=values)})


def lever_arm(dataset):
    checks = inspect_dataset(dataset).checks
    (check,) = [check for check in checks if check.check == "lever arm"]
    return check, checks.failed()


@pytest.mark.slow
@pytest.mark.parametrize("metres", [0.5, -1.0])
def test_lever_arm_is_noted_with_its_size(metres, dataset):
    check, fails = lever_arm(moved_ahead(dataset, metres))
    assert fails == []
    assert check.passed is None
    distances = [float(part.split(" +- ")[0].split()[-1]) for part in check.statistic.split(", ")]
    assert distances == pytest.approx([metres, metres], abs=0.1)
    assert "position" in check.advice


@pytest.mark.slow
def test_stated_accelerometer_position_explains_lever_arm(dataset):
    accelerometer = replace(dataset.sensors["accelerometer"], position=(-0.5, 0.0, 0.0))
    stated = replace(dataset, sensors=dataset.sensors | {"accelerometer": accelerometer})
    check, _ = lever_arm(moved_ahead(stated, 0.5))
    assert check.passed is True
    assert lever_arm(stated)[0].passed is None


@pytest.mark.slow
def test_wrong_sign_of_sway_is_no_lever_arm(dataset, changed):
    def turn(time, values):
        values[:, 1] *= -1.0

    checks = inspect_dataset(changed(dataset, "dvl", turn)).checks
    assert [check.check for check in checks.failed()] == ["v against accelerometer"]
    assert "lever arm" not in {check.check for check in checks}


def test_lever_arm_needs_accelerometer(dataset):
    sensors = {name: record for name, record in dataset.sensors.items() if name != "accelerometer"}
    checks = inspect_dataset(replace(moved_ahead(dataset, 0.5), sensors=sensors)).checks
    assert "lever arm" not in {check.check for check in checks}
