"""Runs to be predicted, and models that predict them."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS

DEPTH = "sensors.depth={rate: 5 Hz, noise: 2 cm}"
FAST = "sensors.gyroscope.rate=50 Hz"
WHITE = "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}"
ZIGZAG = "manoeuvre={type: zigzag, duration: 80 s, speed: 3.9 m/s, rudder: 20 deg, heading: 20 deg, approach: 8 s}"


@pytest.fixture(scope="session")
def zigzag(simulated_with):
    """With white noise only; do not change its arrays."""
    return simulated_with(ZIGZAG, WHITE, DEPTH, FAST, "seed=33")


@pytest.fixture
def with_coefficients(hand_made):
    """Function: an estimate that ends with the given coefficients, each known to a share of its value."""

    def make(coefficients, share=1e-6, **changes):
        final = {symbol: (coefficients | changes)[symbol] for symbol in SYMBOLS}
        estimate = hand_made([0.0, 1.0], {symbol: [0.0, value] for symbol, value in final.items()})
        covariance = estimate.covariance.copy()
        covariance[:N_COEFFICIENTS, :N_COEFFICIENTS] = np.diag([(share * value) ** 2 for value in final.values()])
        return replace(estimate, covariance=covariance)

    return make
