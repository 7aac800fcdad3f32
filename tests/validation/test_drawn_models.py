"""Models drawn from an estimate: coefficients and known quantities together, against their joint covariance."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.data.faults import ConsideredErrors, Fault, FaultKind
from auvid_cli.validation.initial_states import drawn_models

HELD, INERTIA, MASS = 2.0, 0.5, 0.1
EFFECT = np.array([[0.3, -4.0, 0.0], [0.0, 0.0, 5.0]])


@pytest.fixture
def estimate(hand_made):
    faults = Fault(FaultKind.HELD_COEFFICIENT, "M_uql"), Fault(FaultKind.PARAMETER, "Iyy"), Fault(FaultKind.MASS)
    covariance = np.diag([HELD**2, INERTIA**2, MASS**2])
    considered = ConsideredErrors(faults, ("kg*m/rad", "kg*m^2", "kg"), covariance, EFFECT, np.ones(2))
    one = hand_made([0, 1], {"Y_url": [0.0, 3.0], "N_url": [0.0, -2.0]})
    return replace(one, considered=considered)


def test_coefficients_are_drawn_with_known_quantities(estimate, rng):
    """Less the effect of the drawn quantities, coefficients vary as the data allow."""
    draws = drawn_models(estimate, 20_000, rng)
    symbols = estimate.coefficient_set.symbols
    y, n, held = (draws.coefficients[:, symbols.index(symbol)] for symbol in ("Y_url", "N_url", "M_uql"))
    inertia, mass = (np.array([own[symbol] for own in draws.parameters]) for symbol in ("Iyy", "m"))
    sizes = np.column_stack([held, inertia, mass])
    assert len(np.unique(sizes, axis=0)) == 10
    assert_allclose(np.sqrt(np.mean(sizes**2, axis=0)), [HELD, INERTIA, MASS], rtol=0.8)
    for values, mean, effect in ((y, 3.0, EFFECT[0]), (n, -2.0, EFFECT[1])):
        by_data = values - mean - sizes @ effect
        assert_allclose([by_data.mean(), by_data.std()], [0.0, 0.25], atol=0.01)
