"""What is said of filters that did not end well."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.data.innovations import Innovations
from auvid_cli.report.remedies import remedies

from .conftest import make_estimate

DIVERGED = "diverged at t = 3.000 s: the state was not finite"
ALL = ("ekf", "ckf", "tukf", "ukf", "output_error")
DVL, CURRENT = "identification.estimate.biases=[gyro, dvl]", "identification.estimate.biases=[current]"


@pytest.fixture
def ended(experiment_with):
    """Function: an estimate that ended as it is said, with overrides of the settings."""

    def make(name, *overrides, status=DIVERGED):
        return replace(make_estimate(name), experiment=experiment_with(*overrides), status=status)

    return make


def belied(estimate):
    """The same with innovations three times as large as their standard deviation."""
    time = np.arange(300.0)
    ones = np.ones((300, 3))
    innovations = Innovations(time, 3.0 * ones, ones, np.full(300, 27.0), np.ones(3))
    return replace(estimate, innovations={"dvl": innovations}, status="completed")


def test_filters_that_ended_well_need_nothing(ended):
    assert remedies([ended(name, DVL, status="completed") for name in ALL]) == []


def test_a_wide_prior_is_to_be_narrowed_and_a_narrow_one_is_not(ended):
    (line,) = remedies([ended("ekf"), ended("tukf"), ended("ckf", status="completed")])
    assert line.startswith("EKF, TUKF: narrow the prior (--set identification.prior.factor=1)")
    (line,) = remedies([ended("ekf", "identification.prior.factor=0.5")])
    assert "--set" not in line
    assert "process noise" in line


@pytest.mark.parametrize(("setting", "named"), [(DVL, "with dvl to"), (CURRENT, "with current to")])
def test_blocks_that_make_a_dvl_nonlinear_need_a_narrower_prior_or_a_fit(setting, named, ended):
    for estimate in (ended("ckf", setting), belied(ended("ckf", setting))):
        (line,) = remedies([estimate])
        assert line.startswith("CKF: ")
        assert named in line
        assert "identification.prior.factor=0.3" in line
        assert "--filter output_error" in line
    (line,) = remedies([ended("ckf", setting, "identification.prior.factor=0.3")])
    assert "prior.factor" not in line
    assert "--filter output_error" in line


def test_blocks_of_a_linear_sensor_ask_for_nothing_of_their_own(ended):
    (line,) = remedies([ended("ukf", "identification.estimate.biases=[gyro, thrust]")])
    assert "output_error" not in line


def test_innovations_that_belie_a_filter_have_many_causes(ended):
    assert remedies([belied(ended("ukf"))]) == []


def test_a_fit_is_not_told_of_the_factor_of_a_prior_that_it_does_not_use(ended):
    unsettled = "unconverged: the fit did not settle"
    for status in (DIVERGED, unsettled):
        (line,) = remedies([ended("output_error", CURRENT, status=status)])
        assert line.startswith("OE: the data do not determine")
        assert "output_error.use_prior=true" in line
        assert "factor" not in line
    (line,) = remedies([ended("output_error", "identification.output_error.use_prior=true")])
    assert "use_prior" not in line


def test_a_factor_says_nothing_of_a_prior_from_an_earlier_estimate(ended):
    (line,) = remedies([ended("ekf", "identification.prior.from_estimate=earlier.h5")])
    assert "from_estimate" in line
    assert "factor" not in line
