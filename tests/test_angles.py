"""Angles modulo a turn."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.arrays import wrap


@pytest.mark.parametrize(("angle", "wrapped"), [(0, 0), (4, 4 - 2 * np.pi), (-4, 2 * np.pi - 4), (7, 7 - 2 * np.pi)])
def test_wrapped_angles_by_hand(angle, wrapped):
    assert wrap(np.array([float(angle)]))[0] == wrap(float(angle)) == pytest.approx(wrapped)


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_lie_within_half_a_turn_and_point_the_same_way(angle):
    wrapped = wrap(angle)
    assert -np.pi - 1e-11 <= wrapped <= np.pi + 1e-11
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-11)
