"""How many independent errors a series is worth, against series of which that is known."""

import numpy as np
import pytest

from auvid_cli.validation.results import independent_errors


def test_white_errors_are_independent(rng):
    assert np.mean([independent_errors(rng.standard_normal(200)) for _ in range(50)]) > 0.85 * 200


def test_autocorrelated_errors_count_less(rng):
    """Each keeps a share k of the last: by the variance of their mean they are (1 - k) / (1 + k) of their number."""
    kept, found = 0.6, []
    for _ in range(100):
        errors = [rng.standard_normal()]
        for _ in range(400):
            errors.append(kept * errors[-1] + np.sqrt(1.0 - kept**2) * rng.standard_normal())
        found.append(independent_errors(np.array(errors)))
    assert np.mean(found) == pytest.approx(401 * (1.0 - kept) / (1.0 + kept), rel=0.15)


@pytest.mark.parametrize("errors", [np.ones(100), np.zeros(100), np.full(1, 2.0)])
def test_constant_error_counts_once(errors):
    assert independent_errors(errors) < 2.5


def test_alternating_errors_count_at_most_their_number():
    assert independent_errors(np.tile([1.0, -1.0], 50)) == 100.0
