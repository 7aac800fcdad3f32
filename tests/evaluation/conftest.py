"""Estimates made by hand."""

import numpy as np
import pytest

from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.innovations import Innovations
from auvid_cli.vehicle.coefficients import SYMBOLS


@pytest.fixture
def truth_of():
    """Function: a truth with the given coefficients, 0 for the others, and no motion."""

    def make(**coefficients):
        nothing = np.zeros(0)
        values = dict.fromkeys(SYMBOLS, 0.0) | coefficients
        return TruthRecord(nothing, nothing.reshape(0, 9), nothing.reshape(0, 3), values)

    return make


@pytest.fixture
def innovations_of(rng):
    """Function: innovations with the given variance in fact and as stated."""

    def make(count, components, actual, claimed):
        innovation = np.sqrt(actual) * rng.standard_normal((count, components))
        variance = np.full((count, components), claimed)
        nis = (innovation**2 / variance).sum(axis=1)
        return Innovations(np.arange(float(count)), innovation, variance, nis, np.full(components, np.sqrt(claimed)))

    return make
