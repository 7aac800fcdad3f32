from collections.abc import Callable

import pytest

from auvid_cli.config.enums import shipped_configs

SENSORS = """\
sensors:
  gyroscope: {rate: 100 Hz, range: 0.2 deg/s}
  accelerometer: {rate: 100 Hz, range: 0.003 g}
  magnetometer: {rate: 10 Hz, range: 1.5 deg}
  dvl:
    rate: 7 Hz
    noise: 0.1 cm/s
  attitude: ahrs
"""
MANOEUVRE = """\
manoeuvre:
  type: spiral
  duration: 300 s
  speed: 3.9 m/s
  turn_rate: 8 deg/s
  pitch: -10 deg
"""


@pytest.fixture(scope="session")
def experiment_text() -> Callable[[str], str]:
    """Text of a small valid experiment by the name of a shipped vehicle."""
    vehicles = shipped_configs() / "vehicles"
    return lambda vehicle: f"name: small\nvehicle: {vehicles / vehicle}.yaml\n{SENSORS}{MANOEUVRE}"


@pytest.fixture
def text(experiment_text) -> str:
    """A small valid experiment."""
    return experiment_text("remus100")
