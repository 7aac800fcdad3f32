"""A DVL to another scale than the depth, where the vehicle dives."""

import pytest

from auvid_cli.inspection.inspect import inspect_dataset

MULTISINE = "manoeuvre=manoeuvres/multisine.yaml"
DEPTH = "sensors.depth={{rate: {} Hz, noise: 1 cm}}"


@pytest.fixture(scope="module")
def scale_of(simulated_with, changed):
    """Return a function: check of a run with a depth sensor of a rate, with velocities multiplied by a factor."""

    def run(*settings, rate=10, factor=1.0):
        dataset = simulated_with(MULTISINE, DEPTH.format(rate), *settings).without_truth()

        def scale(time, values):
            values *= factor

        checks = inspect_dataset(changed(dataset, "dvl", scale)).checks
        (found,) = (check for check in checks if check.check == "scale by depth")
        return found

    return run


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.98, 1.02])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_velocity_scale_is_noted_with_its_size(factor, seed, scale_of):
    assert scale_of(f"seed={seed}").passed
    found = scale_of(f"seed={seed}", factor=factor)
    assert found.passed is None
    assert float(found.statistic.split()[2]) == pytest.approx(1.0 / factor, abs=0.006)
    assert "[dvl]" in found.advice


LEVEL = "manoeuvre={type: lawnmower, duration: 120 s, speed: 3.9 m/s, leg: 30 s, turn_rate: 6 deg/s}"


@pytest.mark.parametrize(
    ("settings", "rate", "why"),
    [((LEVEL,), 10, "hardly dives"), ((), 1, "too seldom")],
    ids=["a level survey", "a slow depth"],
)
def test_velocity_scale_is_undetermined_without_evidence(settings, rate, why, scale_of):
    found = scale_of(*settings, rate=rate, factor=1.02)
    assert found.passed is None
    assert found.statistic.startswith("undetermined")
    assert why in found.statistic
