"""A DVL to another scale than the depth, where the vehicle dives."""

from functools import cache

import numpy as np
import pytest

from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.inspection.kinematic_relations import Grid, Signals
from auvid_cli.inspection.velocity import velocity_checks

from .conftest import ATTITUDE

MULTISINE = "manoeuvre=manoeuvres/multisine.yaml"
DEPTH = "sensors.depth={{rate: {} Hz, noise: 1 cm}}"


@pytest.fixture(scope="module")
def scale_of(simulated_with, changed):
    """Return a function: check of a run with a depth sensor of a rate, with velocities multiplied by a factor."""

    simulated = cache(
        lambda *settings: simulated_with(MULTISINE, ATTITUDE, "sensors.gyroscope.rate=50 Hz", *settings).without_truth()
    )

    def run(*settings, rate=10, factor=1.0):
        dataset = simulated(DEPTH.format(rate), *settings)

        def scale(time, values):
            values *= factor

        checks = inspect_dataset(changed(dataset, "dvl", scale)).checks
        (found,) = (check for check in checks if check.check == "scale by depth")
        return found

    return run


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_velocity_scale_is_noted_with_its_size(seed, scale_of):
    assert scale_of(f"seed={seed}").passed
    for factor in (0.98, 1.02):
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


def test_heading_offset_larger_than_the_sway_is_undetermined(rng):
    """Steady turns: slip takes back what an offset of 25 degrees would add, so that v stays small."""
    cells, slope = 6000, np.tan(np.deg2rad(25.0))
    r = np.full(cells, 0.1)
    u = 1.5 + 0.2 * rng.standard_normal(cells)
    r = r + 0.02 * rng.standard_normal(cells)
    v = slope * u - slope * (r / 0.1) * u
    zeros = dict.fromkeys(("rudder", "elevator", "surge_force", "roll_moment"), np.zeros(cells))
    signals = Signals(Grid(0.0, 0.1, cells), zeros | {"u": u, "v": v, "r": r}, dict.fromkeys("uvr", 0.1))
    (offset,) = (check for check in velocity_checks(signals, 2.0, None) if check.check == "heading offset")
    assert offset.passed is None
    assert offset.statistic == "undetermined: v is too small for 25 deg"
