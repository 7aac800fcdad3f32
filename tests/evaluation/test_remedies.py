"""What is said of filters that did not end well."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.data.faults import Fault, FaultTest
from auvid_cli.data.innovations import Innovations
from auvid_cli.evaluation.judgement import judge, judge_one

DIVERGED = "diverged at t = 3.000 s: the state was not finite"
ALL = ("ekf", "ckf", "tukf", "ukf", "output_error")
DVL, CURRENT = "identification.estimate.biases=[gyro, dvl]", "identification.estimate.biases=[current]"


@pytest.fixture
def ended(experiment_with, hand_made):
    """Function: an estimate that ended as it is said, with overrides of the settings."""

    def make(name, *overrides, status=DIVERGED):
        estimate = hand_made([0, 1], {"Y_url": [0.0, 3.0]}, status=status)
        return replace(estimate, filter=name, experiment=experiment_with(*overrides))

    return make


def belied(estimate):
    """The same with innovations three times as large as their standard deviation."""
    time = np.arange(300.0)
    ones = np.ones((300, 3))
    innovations = Innovations(time, 3.0 * ones, ones, np.full(300, 27.0), np.ones(3))
    return replace(estimate, innovations={"dvl": innovations}, status="completed")


def remedy(estimate):
    return judge_one(estimate, None).remedy


def test_filters_that_ended_well_need_nothing_but_a_judge(ended):
    assert {remedy(ended(name, DVL, status="completed")) for name in ALL} == {
        "run the smoother as well (--filter smoother, without identification.gate)"
    }


def test_a_wide_prior_is_to_be_narrowed_and_a_narrow_one_is_not(ended):
    assert remedy(ended("ekf")).startswith("narrow the prior (--set identification.prior.factor=1)")
    narrow = remedy(ended("ekf", "identification.prior.factor=0.5"))
    assert "--set" not in narrow
    assert "process noise" in narrow


@pytest.mark.parametrize(("setting", "named"), [(DVL, "if dvl is"), (CURRENT, "if current is")])
def test_blocks_that_make_a_dvl_nonlinear_need_a_narrower_prior_or_a_fit(setting, named, ended):
    for estimate in (ended("ckf", setting), belied(ended("ckf", setting))):
        assert named in remedy(estimate)
        assert "identification.prior.factor=0.3" in remedy(estimate)
        assert "--filter output_error" in remedy(estimate)
    narrow = remedy(ended("ckf", setting, "identification.prior.factor=0.3"))
    assert "prior.factor" not in narrow
    assert "--filter output_error" in narrow


def test_blocks_of_a_linear_sensor_ask_for_nothing_of_their_own(ended):
    assert "output_error" not in remedy(ended("ukf", "identification.estimate.biases=[gyro, thrust]"))


def test_innovations_that_belie_a_filter_have_many_causes(ended):
    assert "check stated noise" in remedy(belied(ended("ukf")))


def test_what_led_a_filter_astray_and_what_the_smoother_doubts_are_one_remedy(ended):
    fault = FaultTest(Fault.parse("bias of r"), "rad/s", 1.0, 0.1, "Y_url", 2.5)
    smoother = replace(ended("smoother", DVL, status="completed"), faults=(fault,))
    both = judge([smoother, belied(ended("ckf", DVL))])["ckf"].remedy
    assert both.startswith("if dvl is estimated")
    assert "the data look like a fault: bias of r" in both
    assert "check stated noise" not in both


def test_a_fit_is_not_told_of_the_factor_of_a_prior_that_it_does_not_use(ended):
    by_prior = remedy(ended("output_error", CURRENT, status=DIVERGED))
    assert by_prior.startswith("the data do not determine")
    assert "output_error.use_prior=true" in by_prior
    assert "factor" not in by_prior
    assert "use_prior" not in remedy(ended("output_error", "identification.output_error.use_prior=true"))


@pytest.mark.parametrize(("name", "limit"), [("output_error", "max_evaluations=200"), ("smoother", "max_passes=100")])
def test_a_fit_that_did_not_settle_is_given_more_steps_and_not_called_unstable(name, limit, ended):
    unsettled = ended(name, status="unconverged: out of steps")
    off = replace(unsettled, innovations=belied(unsettled).innovations)
    near = {"dvl": replace(off.innovations["dvl"], nis=np.full(300, 3.0))}
    assert limit in remedy(off)
    assert "larger than the noise" in remedy(off)
    assert ("noise=estimate" in remedy(off)) == (name == "smoother")
    assert "fix them" in remedy(replace(off, innovations=near))
    assert "unstable" not in remedy(off) + remedy(replace(off, innovations=near))


def test_smoother_with_sensor_errors_gets_no_advice_for_a_kalman_filter(ended):
    advice = remedy(ended("smoother", DVL, status="unconverged: out of steps"))
    assert "Kalman" not in advice
    assert "max_passes=100" in advice


def test_a_factor_says_nothing_of_a_prior_from_an_earlier_estimate(ended):
    without = remedy(ended("ekf", "identification.prior.from_estimate=earlier.h5"))
    assert "from_estimate" in without
    assert "factor" not in without


def with_large_innovations(estimate, begin, end):
    """The estimate with innovations twice as large as stated between two times, s, of 300 s."""
    time = np.arange(0.0, 300.0, 0.1)
    size = np.where((time >= begin) & (time < end), 2.0, 1.0)
    ones = np.ones((time.size, 3))
    innovations = Innovations(time, size[:, None] * ones, ones, 3.0 * size**2, np.ones(3))
    return replace(estimate, innovations={"dvl": innovations}, status="completed")


def test_ekf_inconsistent_at_the_start_only_is_explained_by_linearisation(ended):
    early = remedy(with_large_innovations(ended("ekf"), 0.0, 20.0))
    assert "linearises" in early
    assert "smoother" in early
    assert "linearises" not in remedy(with_large_innovations(ended("ekf"), 100.0, 120.0))
    assert "linearises" not in remedy(with_large_innovations(ended("ckf"), 0.0, 20.0))
