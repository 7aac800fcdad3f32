"""How many independent errors a series is worth, against series of which that is known."""

import numpy as np
import pytest

from auvid_cli.validation.results import independent_errors


def test_errors_of_white_noise_count_each(rng):
    assert np.mean([independent_errors(rng.standard_normal(200)) for _ in range(50)]) > 0.85 * 200


def test_of_errors_that_last_there_are_fewer(rng):
    """Each keeps a share k of the last: by the variance of their mean they are (1 - k) / (1 + k) of their number."""
    kept, found = 0.6, []
    for _ in range(100):
        errors = [rng.standard_normal()]
        for _ in range(400):
            errors.append(kept * errors[-1] + np.sqrt(1.0 - kept**2) * rng.standard_normal())
        found.append(independent_errors(np.array(errors)))
    assert np.mean(found) == pytest.approx(401 * (1.0 - kept) / (1.0 + kept), rel=0.15)


@pytest.mark.parametrize("errors", [np.ones(100), np.zeros(100), np.full(1, 2.0)])
def test_one_error_from_every_start_is_about_one(errors):
    assert independent_errors(errors) < 2.5


def test_errors_that_alternate_are_no_more_than_they_are():
    assert independent_errors(np.tile([1.0, -1.0], 50)) == 100.0
