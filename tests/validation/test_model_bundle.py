from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.validation.initial_states import drawn_models, models_of
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS


@pytest.fixture
def estimate(hand_made):
    made = hand_made([0.0, 1.0], {"X_u|u|": [-1.0, -3.0], "N_uvl": [2.0, 4.0]})
    return replace(made, held=made.held | {"Y_uvl": -20.0})


def test_prior_is_zero_except_held_values(estimate):
    models = models_of(estimate)
    assert models.identified["X_u|u|"] == -3.0
    assert (models.prior["X_u|u|"], models.prior["N_uvl"], models.prior["Y_uvl"]) == (0.0, 0.0, -20.0)
    assert set(models.prior) == set(SYMBOLS)


def test_prior_from_earlier_estimate_is_first_mean(estimate, experiment_with):
    later = replace(estimate, experiment=experiment_with("identification.prior.from_estimate=earlier.h5"))
    assert models_of(later).prior["X_u|u|"] == -1.0
    # A fit has no beginning.
    assert models_of(replace(later, filter="output_error")).prior is None


def test_draws_have_the_mean_and_the_covariance_of_the_estimate(estimate, rng):
    covariance = estimate.covariance.copy()
    covariance[:2, :2] = [[0.04, 0.054], [0.054, 0.09]]
    drawn, errors, _ = drawn_models(replace(estimate, covariance=covariance), 20_000, rng)
    assert drawn.shape == (20_000, N_COEFFICIENTS)
    assert not errors.any()
    columns = [SYMBOLS.index("X_u|u|"), SYMBOLS.index("N_uvl")]
    assert_allclose(drawn[:, columns].mean(axis=0), [-3.0, 4.0], atol=0.01)
    assert_allclose(np.cov(drawn[:, columns].T), covariance[:2, :2], rtol=0.05)
    assert_allclose(drawn[:, SYMBOLS.index("Y_uvl")], -20.0)


def test_draws_use_corrected_standard_deviation(estimate, rng):
    nominal = estimate.standard_deviation[-1, estimate.state.index("X_u|u|")]
    assert nominal**2 == pytest.approx(estimate.covariance[0, 0])
    drawn, *_ = drawn_models(replace(estimate, corrected={"X_u|u|": 3.0 * nominal}), 20_000, rng)
    assert drawn[:, SYMBOLS.index("X_u|u|")].std() == pytest.approx(3.0 * nominal, rel=0.05)


def test_coefficients_are_drawn_with_thrust_and_ballast(estimate, rng):
    """The data determine their sum: a coefficient drawn alone is ten times as uncertain as given its ballast."""
    covariance = np.zeros((len(estimate.state) + 2,) * 2)
    covariance[:-2, :-2] = estimate.covariance
    covariance[0, 0], covariance[-2, -2], covariance[-1, -1] = 0.04, 0.01, 9.0
    covariance[0, -1] = covariance[-1, 0] = -0.995 * 0.2 * 3.0
    state = (*estimate.state, "thrust_scale", "excess_buoyancy")
    mean = np.hstack([estimate.mean, np.tile([-0.5, 5.0], (len(estimate.mean), 1))])
    known = replace(estimate, state=state, mean=mean, covariance=covariance)
    drawn, errors, _ = drawn_models(known, 20_000, rng)
    # With a force that acts half as strongly as stated.
    assert_allclose(errors.std(axis=0), [0.1 / 0.5, 0.0, 0.0, 3.0, 0.0], rtol=0.05)
    together = drawn[:, SYMBOLS.index("X_u|u|")] + 0.2 / 3.0 * errors[:, 3]
    assert together.std() == pytest.approx(0.2 * np.sqrt(2.0 * (1.0 - 0.995)), rel=0.05)
    alone, errors, _ = drawn_models(known, 20_000, rng, left_out={"thrust_scale", "excess_buoyancy"})
    assert not errors.any()
    assert alone[:, SYMBOLS.index("X_u|u|")].std() == pytest.approx(0.2, rel=0.05)


@pytest.mark.parametrize("block", [[[0.04, 0.07], [0.07, 0.09]], [[np.inf, 0.0], [0.0, 0.09]]])
def test_invalid_covariance_gives_no_draws(estimate, rng, block):
    covariance = estimate.covariance.copy()
    covariance[:2, :2] = block
    assert drawn_models(replace(estimate, covariance=covariance), 5, rng) is None
