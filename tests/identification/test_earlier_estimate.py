"""A prior from an earlier estimate of other data."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.data.estimate_file import new_estimate
from auvid_cli.errors import DataError, FileError
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify, set_up_filters
from auvid_cli.identification.states import earlier_gaussian
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS


@pytest.fixture
def written(tmp_path):
    """Function: run a filter and write its estimate."""

    def write(dataset, name=FilterName.CKF) -> Path:
        (run,) = set_up_filters(prepare(dataset), [name])
        path = tmp_path / f"{name}.h5"
        with new_estimate(path, run.header) as writer:
            writer.finish(run.run(writer.append))
        return path

    return write


@pytest.mark.slow
def test_earlier_coefficients_and_covariance_are_the_prior(short_run, short_estimates, written):
    path = written(short_run)
    earlier = short_estimates[FilterName.CKF]
    scale = np.linspace(1.0, 3.0, N_COEFFICIENTS)
    mean, factor = earlier_gaussian(path, short_run, SYMBOLS, scale, np.zeros(N_COEFFICIENTS))
    assert_allclose(mean * scale, earlier.mean[-1, :N_COEFFICIENTS])
    assert_allclose(
        (factor @ factor.T) * np.outer(scale, scale),
        earlier.covariance[:N_COEFFICIENTS, :N_COEFFICIENTS],
        rtol=1e-9,
        atol=1e-12,
    )


def test_coefficients_missing_in_the_earlier_estimate_keep_their_prior(short_run, written, with_settings):
    path = written(with_settings(short_run, "identification.coefficients=[X_u|u|, N_uudr]"))
    mean, factor = earlier_gaussian(path, short_run, SYMBOLS, np.ones(N_COEFFICIENTS), np.full(N_COEFFICIENTS, 0.3))
    known = [SYMBOLS.index("X_u|u|"), SYMBOLS.index("N_uudr")]
    others = np.setdiff1d(np.arange(N_COEFFICIENTS), known)
    assert np.all(mean[others] == 0.3)
    assert np.all(np.diag(factor)[others] == 1.0)
    assert np.all(mean[known] != 0.3)


@pytest.mark.slow
def test_a_second_run_on_new_data_knows_more(simulated_with, short_run, short_estimates, written, with_settings):
    other = simulated_with("manoeuvre.duration=60 s", "seed=9")
    path = written(short_run)
    alone = identify(other, FilterName.TUKF)
    both = identify(with_settings(other, f"identification.prior.from_estimate={path}"), FilterName.TUKF)
    first = short_estimates[FilterName.CKF]
    smaller = np.minimum(alone.standard_deviation[-1, :N_COEFFICIENTS], first.standard_deviation[-1, :N_COEFFICIENTS])
    assert np.all(both.standard_deviation[-1, :N_COEFFICIENTS] < 1.02 * smaller)
    # Two independent halves of the information: variances add like parallel resistors, roughly.
    assert np.median(both.standard_deviation[-1, :N_COEFFICIENTS] / smaller) < 0.9
    true = np.array([other.truth.coefficients[symbol] for symbol in SYMBOLS])
    assert (np.abs(both.mean[-1, :N_COEFFICIENTS] - true) / both.standard_deviation[-1, :N_COEFFICIENTS]).max() < 5.0


def test_the_same_data_twice_are_refused(short_run, written, with_settings):
    known = replace(short_run, sha256="abc0" * 16)
    path = written(known)
    with pytest.raises(DataError, match="this very dataset"):
        identify(with_settings(known, f"identification.prior.from_estimate={path}"), FilterName.CKF)


def test_a_missing_file_is_refused(short_run, with_settings, tmp_path):
    dataset = with_settings(short_run, f"identification.prior.from_estimate={tmp_path / 'nothing.h5'}")
    with pytest.raises(FileError, match=r"nothing.h5"):
        identify(dataset, FilterName.CKF)


def test_diverged_estimate_is_refused_as_prior(short_run, written, with_settings):
    path = written(with_settings(short_run, "identification.prior.factor=300"))
    with pytest.raises(DataError, match="diverged"):
        identify(with_settings(short_run, f"identification.prior.from_estimate={path}"), FilterName.CKF)
