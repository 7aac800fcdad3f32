"""Estimates made by hand."""

import numpy as np
import pytest

from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import Estimate, Innovations
from auvid_cli.vehicle.coefficients import COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.parameters import MOTION


@pytest.fixture
def hand_made(experiment_with):
    """Function: an estimate with a given course of each coefficient named; the others are held at 0."""

    def make(time, courses, status="completed", innovations=None):
        units = {c.symbol: c.unit for c in COEFFICIENTS}
        state = (*courses, *(q.symbol for q in MOTION))
        mean = np.zeros((len(time), len(state)))
        mean[:, : len(courses)] = np.transpose(list(courses.values()))
        return Estimate(
            filter="tukf",
            experiment=experiment_with(),
            state=state,
            unit=(*(units[symbol] for symbol in courses), *(q.unit for q in MOTION)),
            time=np.asarray(time, dtype=float),
            mean=mean,
            standard_deviation=np.full(mean.shape, 0.25),
            covariance=0.0625 * np.eye(len(state)),
            innovations=innovations or {},
            held={symbol: 0.0 for symbol in SYMBOLS if symbol not in courses},
            status=status,
            steps=len(time),
            cpu_time=1.0,
            wall_time=1.0,
            dataset_sha256="",
        )

    return make


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

    def make(count, components, actual, stated):
        innovation = np.sqrt(actual) * rng.standard_normal((count, components))
        variance = np.full((count, components), stated)
        nis = (innovation**2 / variance).sum(axis=1)
        return Innovations(np.arange(float(count)), innovation, variance, nis, np.full(components, np.sqrt(stated)))

    return make
