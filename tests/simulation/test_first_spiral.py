"""First spiral: vehicles of all sizes can follow it, and it is scaled to them."""

import numpy as np
import pytest
import yaml

from auvid_cli.config.enums import shipped_configs
from auvid_cli.config.loading import parse_vehicle
from auvid_cli.config.manoeuvre import Spiral
from auvid_cli.config.outline import derived_vehicle_yaml, outline_of_options
from auvid_cli.errors import ConfigError
from auvid_cli.simulation.first_folder import cruising_speed, first_spiral, spiral_lines


def outlined(length, diameter, mass, span, area, **others):
    options = {"length": length, "diameter": diameter, "mass": mass, "fin_span": span, "fin_area": area} | others
    return parse_vehicle(derived_vehicle_yaml(outline_of_options(options).drawing("boat")), "boat")


def shipped(name):
    return parse_vehicle((shipped_configs() / "vehicles" / name).read_text(encoding="utf-8"), name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("outline", "speed"),
    [
        ((0.5, 0.12, 4.4, 0.05, 0.0025), 1.0),
        ((1, 0.2, 22, 0.08, 0.006), 1.5),
        ((2, 0.2, 60, 0.1, 0.012), 1.5),
        ((2, 0.2, 60, 0.1, 0.012), 3.0),
        ((5, 0.6, 1200, 0.3, 0.08), 2.0),
    ],
)
def test_vehicle_of_outline_stays_upright_and_near_its_speed(outline, speed):
    spiral = first_spiral(outlined(*outline), speed)
    assert spiral.excitation == 1.0
    assert spiral.roll < np.deg2rad(45.0)
    assert spiral.pitch < np.deg2rad(60.0)
    assert 0.7 * speed < spiral.speed[0] < speed < spiral.speed[1] < 1.3 * speed
    # It descends at about 10 degrees.
    assert 0.08 * 300 * speed < spiral.depth < 0.3 * 300 * speed


@pytest.mark.slow
def test_shipped_vehicle_follows_full_spiral_at_cruising_speed(vehicle_file):
    vehicle = shipped(vehicle_file)
    speed = cruising_speed(vehicle)
    assert speed is not None
    assert first_spiral(vehicle, speed).excitation == 1.0


def test_fast_vehicle_gets_less_excitation(monkeypatch):
    monkeypatch.setattr("auvid_cli.simulation.first_folder.MIN_DURATION", 60.0)
    vehicle = outlined(1, 0.2, 22, 0.08, 0.006)
    assert 0.0 < first_spiral(vehicle, 4.0).excitation < 1.0
    with pytest.raises(ConfigError, match=r"boat: .*spiral at 20 m/s"):
        first_spiral(vehicle, 20.0)


@pytest.mark.slow
def test_message_has_slenderness_of_short_vehicle(monkeypatch):
    monkeypatch.setattr("auvid_cli.simulation.first_folder.MIN_DURATION", 60.0)
    with pytest.raises(ConfigError, match=r"2\.5 diameters long; expected 4 to 15"):
        first_spiral(outlined(1, 0.4, 80, 0.1, 0.012), 6.0)
    with pytest.raises(ConfigError, match=r"and size$"):
        first_spiral(outlined(1, 0.2, 22, 0.08, 0.006), 20.0)


def test_frequencies_scale_with_speed_and_forces_with_its_square():
    vehicle = outlined(2, 0.2, 60, 0.1, 0.012)
    slow, fast = (Spiral.model_validate(yaml.safe_load("\n".join(spiral_lines(vehicle, v, 1.0)))) for v in (1.0, 2.0))
    assert fast.turn_rate == pytest.approx(2.0 * slow.turn_rate, rel=0.01)
    assert slow.excitation.rudder is not None
    assert fast.excitation.rudder is not None
    assert fast.excitation.rudder.highest == pytest.approx(2.0 * slow.excitation.rudder.highest, rel=0.01)
    assert slow.excitation.surge_force is not None
    assert fast.excitation.surge_force is not None
    assert fast.excitation.surge_force.amplitude == pytest.approx(4.0 * slow.excitation.surge_force.amplitude, rel=0.01)
    assert fast.excitation.roll_moment == slow.excitation.roll_moment
    gentle = Spiral.model_validate(yaml.safe_load("\n".join(spiral_lines(vehicle, 1.0, 0.5))))
    assert gentle.turn_rate == pytest.approx(0.5 * slow.turn_rate, rel=0.01)


def test_cruising_speed_of_shipped_vehicle_is_published_trim_speed():
    # Prestero: 1.54 m/s; da Silva et al.: 1.43 m/s.
    assert cruising_speed(shipped("remus100.yaml")) == pytest.approx(1.54, abs=0.01)
    assert cruising_speed(shipped("lauv.yaml")) == pytest.approx(1.43, abs=0.001)
