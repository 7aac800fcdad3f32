"""Limits of a run, and options that relax them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.config.manoeuvre import Envelope
from auvid_cli.config.units import parse_quantity
from auvid_cli.design.trials import Extent, least_speed, limit_excess, measure_extent, options_to_relax, with_margin
from auvid_cli.errors import ConfigError
from auvid_cli.simulation.motion import Truth

UNITS = {"box": "m", "depth": "m", "pitch": "rad", "roll": "rad", "speed": "m/s", "energy": "J"}


def test_extent_covers_track_and_speed_after_start():
    time = np.arange(5.0)
    motion, position = np.zeros((5, 9)), np.zeros((5, 3))
    motion[:, 0], motion[:, 6], motion[:, 7] = [0.1, 1.5, 1.4, 1.3, 1.6], [0, -0.4, 0.2, 0, 0], [0, 0, 0.1, -0.3, 0]
    position[:, 0], position[:, 1], position[:, 2] = [0, 5, 9, 7, 3], [0, -4, -9, -12, -8], [0, -1, 2, 4, 3]
    inputs = np.zeros((5, 4))
    # Each input holds until the next time; the last one never acts.
    inputs[:, 2] = [100.0, -40.0, 50.0, 0.0, 999.0]
    truth = Truth(time, inputs, inputs, motion, position, np.zeros((5, 6)), np.zeros(0), np.zeros(0))
    assert measure_extent(truth, fade_in=1.0) == Extent(12.0, 5.0, 0.3, 0.4, 1.3, 140.0)


numbers = st.floats(0.05, 1.4)


@given(st.builds(Extent, st.floats(1, 900), st.floats(1, 90), numbers, numbers, st.floats(0.05, 3), st.floats(1, 1e5)))
def test_suggested_limits_let_run_pass(extent):
    envelope, slowest = Envelope(energy=2e4), 0.6
    named = options_to_relax([extent], envelope, slowest)
    options = [option.strip().split(" ", 1) for option in named.split(",")] if named else []
    limits = {name.lstrip("-"): text.strip("'") for name, text in options}
    assert {*limits} == {name for name, share in limit_excess(extent, envelope, slowest).items() if share > 0.0}
    values = {name: parse_quantity(text, UNITS[name]) for name, text in limits.items()}
    relaxed = envelope.model_copy(update=values)
    assert not any(limit_excess(extent, relaxed, values.get("speed", slowest)).values())


def test_limits_with_margin_are_stricter_by_five_percent():
    envelope = Envelope(energy=2e4)
    tighter, faster = with_margin(envelope, 0.6)
    edge = Extent(tighter.box, tighter.depth, tighter.pitch, tighter.roll, faster, tighter.energy)
    assert not any(limit_excess(edge, envelope, 0.6).values())
    outside = limit_excess(
        Extent(envelope.box, envelope.depth, envelope.pitch, envelope.roll, 0.6, envelope.energy), tighter, faster
    )
    assert all(share > 0.04 for share in outside.values())


def test_least_speed_above_cruise_raises_config_error(remus):
    with pytest.raises(ConfigError, match=r"1\.6 m/s.*--speed"):
        least_speed(Envelope(speed=1.6), remus().manoeuvre)
    assert least_speed(Envelope(), remus().manoeuvre) == pytest.approx(0.4 * 1.54)
