"""Coefficients that data do not need, against the evidence of a linear model in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from auvid_cli.fitting.candidates import needless_coefficients
from auvid_cli.identification.states import coefficient_priors

SYMBOLS = "N_r|r|", "N_v|v|"
SETTINGS = "identification.prior={mean: vehicle}", "vehicle.coefficients.N_r|r|=0", "vehicle.coefficients.N_v|v|=0"


def posterior(regressors, measured, widths):
    """Mean and covariance of coefficients with zero prior means, from measurements with noise of size 1."""
    covariance = np.linalg.inv(regressors.T @ regressors + np.diag(widths**-2.0))
    return covariance @ regressors.T @ measured, covariance


def evidence(regressors, measured, widths):
    """Log-likelihood of the measurements with the coefficients integrated out."""
    covariance = np.eye(measured.size) + (regressors * widths**2) @ regressors.T
    return multivariate_normal.logpdf(measured, cov=covariance)


@pytest.fixture
def estimated(hand_made, experiment_with):
    """Function: an estimate of both coefficients from regressors and measurements."""

    def estimate(regressors, measured, widths):
        mean, covariance = posterior(regressors, measured, widths)
        made = hand_made(np.arange(2.0), {s: [value, value] for s, value in zip(SYMBOLS, mean, strict=True)})
        full = made.covariance.copy()
        full[:2, :2] = covariance
        deviation = np.tile(np.sqrt(np.diag(full)), (2, 1))
        settings = experiment_with(*SETTINGS)
        return replace(made, covariance=full, standard_deviation=deviation, experiment=settings)

    return estimate


@pytest.fixture
def widths(experiment_with):
    """Prior standard deviations."""
    settings = experiment_with(*SETTINGS)
    priors = coefficient_priors(settings.vehicle, settings.identification.prior)
    return np.array([priors[symbol].standard_deviation for symbol in SYMBOLS])


@pytest.mark.parametrize("seed", range(12))
def test_coefficients_are_needless_if_evidence_in_closed_form_says_so(estimated, widths, seed):
    rng = np.random.default_rng(seed)
    regressors = rng.normal(size=(40, 2)) * rng.choice([0.03, 1.0, 30.0], 2) / widths
    true = widths * rng.choice([0.0, 1.0], 2)
    measured = regressors @ true + rng.normal(size=40)
    full = evidence(regressors, measured, widths)
    # Evidence of the model without some coefficients, less that of the full one.
    without = {
        (): 0.0,
        (SYMBOLS[0],): evidence(regressors[:, 1:], measured, widths[1:]) - full,
        (SYMBOLS[1],): evidence(regressors[:, :1], measured, widths[:1]) - full,
        SYMBOLS: multivariate_normal.logpdf(measured, cov=np.eye(40)) - full,
    }
    first = max([SYMBOLS[:1], SYMBOLS[1:]], key=lambda symbols: without[symbols])
    expected = set()
    if without[first] > 1.0:
        expected = set(SYMBOLS if without[SYMBOLS] - without[first] > 1.0 else first)
    assert set(needless_coefficients(estimated(regressors, measured, widths))) == expected


def test_only_unknown_zeros_of_the_vehicle_file_can_be_needless(estimated, widths, experiment_with):
    made = estimated(np.random.default_rng(0).normal(size=(40, 2)) / widths, np.zeros(40), widths)
    assert needless_coefficients(made)
    for changes in (
        SETTINGS[1:],  # the prior is at zero, whatever the file states
        (SETTINGS[0], "vehicle.coefficients.N_r|r|=-10", "vehicle.coefficients.N_v|v|=-10"),
    ):
        assert needless_coefficients(replace(made, experiment=experiment_with(*changes))) == ()
