"""Limits of a run, and what would let it pass."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.config.manoeuvre import Envelope
from auvid_cli.config.units import parse_quantity
from auvid_cli.design.envelope import Extent, least_speed, limit_excess, measure_extent, options_to_relax, with_margin
from auvid_cli.errors import ConfigError
from auvid_cli.simulation.motion import Truth

UNITS = {"box": "m", "depth": "m", "pitch": "rad", "roll": "rad", "speed": "m/s", "energy": "J"}


def test_an_extent_is_that_of_the_track_and_of_the_speed_after_the_start():
    time = np.arange(5.0)
    motion, position = np.zeros((5, 9)), np.zeros((5, 3))
    motion[:, 0], motion[:, 6], motion[:, 7] = [0.1, 1.5, 1.4, 1.3, 1.6], [0, -0.4, 0.2, 0, 0], [0, 0, 0.1, -0.3, 0]
    position[:, 0], position[:, 1], position[:, 2] = [0, 5, 9, 7, 3], [0, -4, -9, -12, -8], [0, -1, 2, 4, 3]
    inputs = np.zeros((5, 4))
    # Each holds to the next time, the last no longer.
    inputs[:, 2] = [100.0, -40.0, 50.0, 0.0, 999.0]
    truth = Truth(time, inputs, inputs, motion, position, np.zeros((5, 6)), np.zeros(0), np.zeros(0))
    assert measure_extent(truth, fade_in=1.0) == Extent(12.0, 5.0, 0.3, 0.4, 1.3, 140.0)


numbers = st.floats(0.05, 1.4)


@given(st.builds(Extent, st.floats(1, 900), st.floats(1, 90), numbers, numbers, st.floats(0.05, 3), st.floats(1, 1e5)))
def test_with_the_limits_that_are_named_a_run_passes(extent):
    envelope, slowest = Envelope(energy=2e4), 0.6
    named = options_to_relax([extent], envelope, slowest)
    options = [option.strip().split(" ", 1) for option in named.split(",")] if named else []
    limits = {name.lstrip("-"): text.strip("'") for name, text in options}
    assert {*limits} == {name for name, share in limit_excess(extent, envelope, slowest).items() if share > 0.0}
    values = {name: parse_quantity(text, UNITS[name]) for name, text in limits.items()}
    relaxed = envelope.model_copy(update=values)
    assert not any(limit_excess(extent, relaxed, values.get("speed", slowest)).values())


def test_what_passes_with_a_margin_passes_without(remus):
    envelope = Envelope(energy=2e4)
    tighter, faster = with_margin(envelope, 0.6)
    edge = Extent(tighter.box, tighter.depth, tighter.pitch, tighter.roll, faster, tighter.energy)
    assert not any(limit_excess(edge, envelope, 0.6).values())
    outside = limit_excess(
        Extent(envelope.box, envelope.depth, envelope.pitch, envelope.roll, 0.6, envelope.energy), tighter, faster
    )
    assert all(share > 0.04 for share in outside.values())


def test_a_least_speed_above_the_cruise_excludes_every_run(remus):
    with pytest.raises(ConfigError, match=r"1\.6 m/s is not below the 1\.54 m/s of the manoeuvre: lower --speed"):
        least_speed(Envelope(speed=1.6), remus().manoeuvre)
    assert least_speed(Envelope(), remus().manoeuvre) == pytest.approx(0.4 * 1.54)
