"""Errors on a model's own data, carried to others: closed forms."""

import numpy as np
import pytest

from auvid_cli.validation.motion_prediction import SignalSize
from auvid_cli.validation.prediction_errors import error_growth
from auvid_cli.validation.predictions import HORIZONS, Sample, Target
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS


def signal(deviation, spread):
    return SignalSize(deviation, spread**2 + deviation**2)


def samples(symbol, horizon, errors, variance):
    target = Target(horizon, MOTION_SYMBOLS.index(symbol), 1.0, 0.0, 0.0)
    return [Sample(target, np.array([error]), 0.0, variance) for error in errors]


def test_excess_variance_grows_with_motion():
    own = {"v": signal(0.01, 0.1), "u": signal(0.01, 0.1)}
    errors = [*samples("v", 1.0, [0.3, -0.5] * 20, 0.04), *samples("v", 5.0, [0.1] * 40, 0.04)]
    growth = error_growth(errors, errors, own)
    assert growth.variance["v", 0.5] == 0.0
    # Never less than at a shorter horizon, to the longest.
    assert [growth.variance["v", h] for h in HORIZONS if h >= 1.0] == pytest.approx([0.17 - 0.04] * 6)
    other = {"v": signal(0.01, 0.3), "u": signal(0.01, 0.1)}
    assert growth.in_motion(other)["v", 1.0] == pytest.approx(0.13 * 9.0, rel=0.05)
    assert growth.in_motion(own)["v", 1.0] == pytest.approx(0.13)


def test_surge_errors_grow_with_squared_turns():
    own, other = ({"u": signal(0.01, 0.1), "r": signal(0.01, spread)} for spread in (0.1, 0.2))
    for symbol, expected in {"u": 16.0 * 0.09, "p": 4.0 * 0.09}.items():
        sizes = [{symbol: signal(0.01, 0.1)} | each for each in (own, other)]
        errors = samples(symbol, 1.0, [0.3] * 40, 1e-6)
        growth = error_growth(errors, errors, sizes[0])
        assert growth.in_motion(sizes[1])[symbol, 1.0] == pytest.approx(expected, rel=0.05)
        assert growth.in_motion(sizes[0])[symbol, 1.0] == pytest.approx(0.09, rel=1e-4)


def test_surge_errors_grow_with_surge():
    own, other = ({"u": signal(0.01, spread), "r": signal(0.01, 0.1)} for spread in (0.1, 0.2))
    errors = samples("u", 1.0, [0.3] * 40, 1e-6)
    assert error_growth(errors, errors, own).in_motion(other)["u", 1.0] == pytest.approx(4.0 * 0.09, rel=0.05)


def test_expected_or_few_errors_have_no_excess():
    own = {"v": signal(0.01, 0.1)}
    for errors in (samples("v", 1.0, [0.1] * 40, 0.04), samples("v", 1.0, [0.5] * 10, 0.04)):
        assert set(error_growth(errors, errors, own).variance.values()) == {0.0}


def test_process_noise_is_subtracted_for_any_motion():
    own, still, livelier = ({"v": signal(0.01, spread)} for spread in (0.1, 0.0, 0.3))
    plain, noisy = (samples("v", 1.0, [0.5, -0.5] * 20, variance) for variance in (0.04, 0.1))
    growth = error_growth(plain, noisy, own)
    assert growth.by_process_noise["v", 1.0] == pytest.approx(0.06)
    # Excess over predictions with process noise: for equal motion, none, and three times as much.
    for sizes, scale in ((own, 1.0), (still, 0.01), (livelier, 9.0)):
        expected = max(scale * (0.25 - 0.04) - 0.06, 0.0)
        assert growth.in_motion(sizes)["v", 1.0] == pytest.approx(expected, rel=0.1, abs=1e-9)


def test_mean_error_is_independent_of_motion():
    """As that of a weight or a trim that the model lacks; what comes and goes with the motion, goes with it."""
    own, still, livelier = ({"w": signal(0.01, spread)} for spread in (0.1, 0.0, 0.3))
    errors = samples("w", 1.0, [0.7, 0.3] * 20, 1e-6)
    growth = error_growth(errors, errors, own)
    for sizes, expected in ((own, 0.29), (still, 0.25 + 0.01 * 0.04), (livelier, 9.0 * 0.29)):
        assert growth.in_motion(sizes)["w", 1.0] == pytest.approx(expected, rel=0.06)


def test_small_excess_at_all_horizons_is_significant(rng):
    """Squares of 40 errors scatter by a fifth: two fifths too much are chance, but not seven times."""
    own, errors = {"v": signal(0.01, 0.1)}, rng.standard_normal(40)
    errors *= np.sqrt(1.4 / np.mean(errors**2))
    one, all_of_them = (
        [sample for h in horizons for sample in samples("v", h, rng.permutation(errors), 1.0)]
        for horizons in (HORIZONS[:1], HORIZONS)
    )
    assert error_growth(one, one, own).variance["v", 50.0] == 0.0
    assert error_growth(all_of_them, all_of_them, own).variance["v", 50.0] == pytest.approx(0.4)


def test_small_excess_counts_next_to_a_significant_one(rng):
    errors = rng.standard_normal(280)
    errors /= np.sqrt(np.mean(errors**2))
    by_horizon = dict(zip(HORIZONS, errors.reshape(7, 40), strict=True))

    def growth(**excess):
        own = {symbol: signal(0.01, 0.1) for symbol in excess}
        made = [
            sample
            for symbol, more in excess.items()
            for horizon, drawn in by_horizon.items()
            for sample in samples(symbol, horizon, np.sqrt(1.0 + more) * drawn, 1.0)
        ]
        return error_growth(made, made, own).variance

    # The mean of 280 squares has a standard error of sqrt(2 / 280), 0.085.
    assert growth(v=0.25)["v", 50.0] == 0.0
    assert growth(v=0.25, r=0.05)["v", 50.0] == 0.0
    with_yaw = growth(v=0.25, r=1.0)
    assert with_yaw["v", 50.0] > 0.2
    assert with_yaw["r", 50.0] > 0.9
