"""Allan deviation against the closed forms of IEEE Std 952-1997, annex C."""

import numpy as np
import pytest

from auvid_cli.inspection.single_sensor import allan_deviation, bias_instability

STEP = 0.1


def test_allan_deviation_of_white_noise_falls_with_root_of_time(rng):
    times, deviation = allan_deviation(rng.standard_normal(200_000), STEP, points=10)
    short = times < 100.0
    np.testing.assert_allclose(deviation[short], np.sqrt(STEP / times[short]), rtol=0.1)


def test_allan_deviation_of_ramp_grows_with_time():
    times, deviation = allan_deviation(0.3 * STEP * np.arange(5000), STEP, points=10)
    np.testing.assert_allclose(deviation, 0.3 * times / np.sqrt(2.0), rtol=1e-9)


def test_bias_instability_of_random_walk_plus_white_noise(rng):
    # sigma^2 = N^2 / tau + K^2 tau / 3 has its least at sqrt(3) N / K, where it is 2 N K / sqrt(3).
    white, walk = 1.0 * np.sqrt(STEP), 0.05
    rate = white / STEP * rng.standard_normal(400_000) + walk * np.sqrt(STEP) * np.cumsum(rng.standard_normal(400_000))
    instability = bias_instability(rate, STEP)
    assert instability is not None
    value, time = instability
    assert time == pytest.approx(np.sqrt(3.0) / 0.05, rel=0.5)
    assert value * np.sqrt(2.0 * np.log(2.0) / np.pi) == pytest.approx(np.sqrt(2.0 * 0.05 / np.sqrt(3.0)), rel=0.15)
