"""Errors on a model's own data, carried to others: closed forms."""

import numpy as np
import pytest

from auvid_cli.validation.error_growth import error_growth
from auvid_cli.validation.horizon_prediction import HORIZONS, Sample, Target
from auvid_cli.validation.signals import SignalSize
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS


def signal(deviation, spread):
    return SignalSize(deviation, spread**2 + deviation**2)


def samples(symbol, horizon, errors, variance):
    target = Target(horizon, MOTION_SYMBOLS.index(symbol), 1.0, 0.0, 0.0)
    return [Sample(target, np.array([error]), 0.0, variance) for error in errors]


def test_what_exceeds_the_stated_variance_grows_with_the_motion():
    own = {"v": signal(0.01, 0.1), "u": signal(0.01, 0.1)}
    errors = [*samples("v", 1.0, [0.3, -0.5] * 20, 0.04), *samples("v", 5.0, [0.1] * 40, 0.04)]
    growth = error_growth(errors, own)
    assert growth.variance["v", 0.5] == 0.0
    # Never less than at a shorter horizon, to the longest.
    assert [growth.variance["v", h] for h in HORIZONS if h >= 1.0] == pytest.approx([0.17 - 0.04] * 6)
    other = {"v": signal(0.01, 0.3), "u": signal(0.01, 0.1)}
    assert growth.in_motion(other)["v", 1.0] == pytest.approx(0.13 * 9.0, rel=0.05)
    assert growth.in_motion(own)["v", 1.0] == pytest.approx(0.13)


def test_turns_carry_errors_of_surge():
    own, other = ({"u": signal(0.01, 0.1), "r": signal(0.01, spread)} for spread in (0.1, 0.2))
    growth = error_growth(samples("u", 1.0, [0.3] * 40, 0.0), own)
    assert growth.in_motion(other)["u", 1.0] == pytest.approx(4.0 * 0.09, rel=0.05)


def test_errors_that_are_expected_or_few_add_nothing():
    own = {"v": signal(0.01, 0.1)}
    for errors in (samples("v", 1.0, [0.1] * 40, 0.04), samples("v", 1.0, [0.5] * 10, 0.04)):
        assert set(error_growth(errors, own).variance.values()) == {0.0}
