"""The console log of an Iver2 on the surface: it can be read, and is of no use."""

import numpy as np
import pytest

from auvid_cli.data.dataset_file import read_dataset

pytestmark = pytest.mark.recorded

LOG = "iver2/20210609_105413_mongabay2_IVER2-218.csv"


@pytest.fixture(scope="module")
def dataset(recorded, imported):
    return imported(recorded / LOG, "iver2")


@pytest.mark.slow
def test_knots_counts_and_a_lost_hour_are_understood(recorded, dataset):
    found = read_dataset(dataset)
    # By hand from the text: minutes and seconds go over the hour, speed is in knots, a servo is centred at 128.
    lines = [line.split(",") for line in (recorded / LOG).read_text().splitlines()]
    names = [name.strip() for name in lines[0]]
    rows = [line for line in lines[1:] if line[0].strip()]
    clock, speed, top, bottom = (names.index(n) for n in ("Time", "Vehicle Speed (kn)", "Fin Yaw T", "Fin Yaw B"))
    minutes, seconds = zip(*(row[clock].split(":") for row in rows), strict=True)
    times = 60.0 * np.array(minutes, float) + np.array(seconds, float)
    times = times + 3600.0 * np.append(0, np.cumsum(np.diff(times) < 0.0))
    dvl = found.sensors["dvl"]
    np.testing.assert_allclose(dvl.time, times - times[0], atol=1e-9)
    np.testing.assert_allclose(dvl.values[:, 0], [float(row[speed]) * 1852.0 / 3600.0 for row in rows], atol=1e-12)
    counts = np.array([[float(row[fin]) for fin in (top, bottom)] for row in rows])
    rudder = np.deg2rad(0.25) * (128.0 - counts).mean(axis=1)
    np.testing.assert_allclose(found.inputs.values[:, 0], rudder, atol=1e-12)


@pytest.mark.slow
def test_inspection_says_why_it_is_unfit(inspected, dataset):
    found = inspected(dataset, code=1)
    failed = {key for key, row in found.items() if row["passed"] == "False"}
    assert failed == {("depth", "stuck"), ("dvl", "stuck"), ("attitude", "steps of psi")}
    # One measurement a second of a vehicle that turns in little more, and lay still for most of the time.
    for key in (("attitude", "fast enough"), ("dvl", "fast enough"), ("u", "under way"), ("depth", "rate")):
        assert found[key]["passed"] == ""
