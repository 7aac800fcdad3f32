import numpy as np
import pytest

from auvid_cli.inspection.kinematic_relations import fit


def test_gain_equals_least_squares_for_gaussian_noise(rng):
    x, other, noise = rng.standard_normal((3, 4000))
    x += 0.8 * other
    y = 2.5 * x - 3.0 * other + 7.0 + 0.1 * noise
    fitted = fit(y, x, [other], 1)
    assert fitted is not None
    exact = np.linalg.lstsq(np.stack([x, other, np.ones(4000)], axis=1), y)[0][0]
    # Huber's weights leave 95 % of the efficiency.
    assert fitted.gain == pytest.approx(exact, abs=2.0 * fitted.error)
    assert fitted.gain == pytest.approx(2.5, abs=5.0 * fitted.error)
    # sigma / (sqrt(n) spread), and of x what `other` does not explain.
    assert fitted.error == pytest.approx(0.1 / np.sqrt(4000), rel=0.1)
    assert fitted.spread == pytest.approx(1.0, rel=0.05)
    assert fitted.correlation == pytest.approx(2.5 / np.hypot(2.5, 0.1), abs=1e-3)


def test_constant_regressor_is_fitted_without_constant(rng):
    other, noise = rng.standard_normal((2, 4000))
    x = 1.0 + 0.01 * rng.standard_normal(4000)
    y = 0.3 * x - 3.0 * other + 0.1 * noise
    fitted = fit(y, x, [other], 1, constant=False)
    assert fitted is not None
    assert fitted.gain == pytest.approx(np.linalg.lstsq(np.stack([x, other], axis=1), y)[0][0], abs=fitted.error)
    assert fitted.error == pytest.approx(0.1 / np.sqrt(4000), rel=0.1)


def test_gain_is_robust_against_outliers(rng):
    x, noise = rng.standard_normal((2, 5000))
    y = -x + 0.1 * noise
    y[::10] += 50.0 * x[::10]
    fitted = fit(y, x, [], 1)
    assert fitted is not None
    assert fitted.gain == pytest.approx(-1.0, abs=0.03)


def test_missing_or_short_data_give_no_fit(rng):
    x, noise = rng.standard_normal((2, 1000))
    y = 3.0 * x
    y[::3] = np.nan
    fitted = fit(y, x, [], 1)
    assert fitted is not None
    assert fitted.gain == pytest.approx(3.0, rel=1e-12)
    assert fit(y, x, [], 100) is None
    constant = fit(noise, np.ones(1000), [], 1)
    assert constant is not None
    assert constant.spread == constant.correlation == 0.0


def test_samples_within_a_window_count_once(rng):
    x, noise = rng.standard_normal((2, 4000))
    alone, together = fit(x + noise, x, [], 1), fit(x + noise, x, [], 100)
    assert alone is not None
    assert together is not None
    assert together.error == pytest.approx(10.0 * alone.error, rel=0.05)
