"""A heading that swings away smoothly, which no step shows."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.simulation.simulate import simulate


def swing(column):
    """Function: 12 degrees away and back within 1.5 s, every 20 s from t = 50 s on."""

    def change(time, values):
        phase = np.where(time > 50.0, (time - 50.0) % 20.0, 20.0)
        values[:, column] += np.deg2rad(12.0) * np.where(phase < 1.5, np.sin(np.pi * phase / 1.5) ** 2, 0.0)

    return change


def fails_of(dataset):
    return {(check.subject, check.check): check.statistic for check in inspect_dataset(dataset).checks.failed()}


@pytest.mark.slow
@pytest.mark.parametrize(("sensor", "column", "symbol"), [("attitude", 2, "psi"), ("magnetometer", 0, "heading")])
def test_excursion_from_gyroscope_fails(sensor, column, symbol, sound_run, changed):
    fails = fails_of(changed(sound_run("long_spiral"), sensor, swing(column)))
    assert list(fails) == [(sensor, f"excursions of {symbol} from integrated r")]
    # At 50, 70, ..., 290 s, each beyond 4 degrees for about a second.
    assert fails[sensor, f"excursions of {symbol} from integrated r"].startswith("13, largest 1")
    assert "t = 50." in fails[sensor, f"excursions of {symbol} from integrated r"]


@pytest.mark.slow
def test_excursion_from_other_heading_fails_without_gyroscope(sound_run, changed):
    dataset = sound_run("long_spiral")
    sensors = {name: record for name, record in dataset.sensors.items() if name != "gyroscope"}
    bare = replace(dataset, sensors=sensors)
    assert fails_of(bare) == {}
    assert list(fails_of(changed(bare, "attitude", swing(2)))) == [("attitude", "excursions of psi from heading")]


def test_fast_yawing_is_no_excursion():
    """LAUV in a zigzag: up to 40 deg/s, of which half a cell of the comparison is degrees."""
    dataset = simulate(
        load_experiment(find_experiment("lauv"), ("manoeuvre=manoeuvres/zigzag_20_20.yaml", "manoeuvre.duration=80 s"))
    )
    assert np.rad2deg(np.abs(dataset.truth.motion[:, 5]).max()) > 30.0
    assert not any("excursions" in check for _, check in fails_of(dataset))
