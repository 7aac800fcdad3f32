"""Search space around a spiral."""

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from auvid_cli.config.manoeuvre import Envelope, Spiral
from auvid_cli.design.problem import baseline_spiral, search_space, standard_manoeuvres
from auvid_cli.errors import ConfigError
from auvid_cli.simulation.manoeuvres import make_plan


def space_of(experiment, duration=60.0):
    own = baseline_spiral(experiment, duration, None, None)
    return search_space(own, experiment.vehicle.size.length, 1.62, Envelope())


def test_start_is_near_spiral(space):
    own, start = space.base, space.manoeuvre(space.start())
    assert (start.turn_rate, start.pitch, start.speed) == pytest.approx((own.turn_rate, own.pitch, own.speed), rel=1e-5)
    assert start.autopilot.bandwidth == pytest.approx(own.autopilot.bandwidth)
    for channel, of_own in zip(start.excitation.channels(), own.excitation.channels(), strict=True):
        assert channel.amplitude == pytest.approx(of_own.amplitude)
    assert start.excitation.rudder.highest == pytest.approx(own.excitation.rudder.highest)


@pytest.fixture(scope="module")
def space(remus):
    return space_of(remus())


@pytest.mark.slow
@settings(max_examples=25)
@given(places=st.lists(st.floats(0.0, 1.0), min_size=15, max_size=15))
def test_every_point_is_valid_manoeuvre(space, places):
    manoeuvre = space.manoeuvre(np.array(places))
    assert (
        Spiral.model_validate(yaml.safe_load(yaml.safe_dump(manoeuvre.model_dump(mode="json", exclude_none=True))))
        == manoeuvre
    )
    signals = make_plan(manoeuvre.model_copy(update={"input_rate": 20.0})).feedforward
    assert np.abs(signals[:, :2]).max() <= 1.7 * manoeuvre.limits.fin_angle + 1e-6
    assert np.abs(signals[[0, -1]]).max() < 1e-9
    assert abs(manoeuvre.pitch) < Envelope().pitch


def test_spiral_without_roll_moment_gives_no_roll_variables(remus):
    space = space_of(remus("manoeuvre.excitation.roll_moment=null"))
    assert len(space.variables) == 12
    assert space.manoeuvre(space.start()).excitation.roll_moment is None


def test_standard_manoeuvres_keep_duration_and_fin_limits(remus):
    own = baseline_spiral(remus(), 60.0, 0.1, 0.5)
    assert (own.limits.fin_angle, own.limits.fin_rate) == (0.1, 0.5)
    for manoeuvre in standard_manoeuvres(own, 1.33).values():
        assert (manoeuvre.duration, manoeuvre.limits, manoeuvre.speed) == (60.0, own.limits, own.speed)
    assert standard_manoeuvres(own, 1.33)["zigzag"].rudder == 0.1


def test_other_manoeuvre_or_short_duration_raises_config_error(remus):
    with pytest.raises(ConfigError, match=r"type zigzag.*--set manoeuvre="):
        baseline_spiral(remus("manoeuvre=configs/manoeuvres/zigzag_20_20.yaml"), 60.0, None, None)
    with pytest.raises(ConfigError, match=r"--duration.*at least 20 s"):
        baseline_spiral(remus(), 5.0, None, None)


def test_limits_of_fins_and_propeller_cap_manoeuvre(remus):
    slow = remus(
        "vehicle.actuators.fins={saturation: 0.2, rate_limit: 0.3}", "vehicle.actuators.propeller={saturation: 9 N}"
    )
    limits = baseline_spiral(slow, 60.0, 0.1, 0.5).limits
    assert (limits.fin_angle, limits.fin_rate, limits.surge_force) == (0.1, 0.3, 9.0)
