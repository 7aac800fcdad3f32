"""What is said of process noise follows from the likelihood: less where there is less, more where there is more."""

import numpy as np
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.data.faults import Cause
from auvid_cli.evaluation.bounds import efficiency_warning, process_noise_score
from auvid_cli.filters.linear_smoother import LinearSmoothing
from auvid_cli.filters.noise_likelihood import log_likelihood, noise_scores_about, scaled
from auvid_cli.filters.smoother import follow_measurements
from auvid_cli.identification.noise import process_noises
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.run import identify

SHORT = "manoeuvre.duration=20 s", "sensors.attitude.source=direct"


def noise(size):
    return f"identification.process_noise={{velocity: {size}, rate: {size}, attitude: 1e-7}}"


def identified(simulated_with, *settings):
    dataset = simulated_with(*SHORT, *settings)
    return prepare(dataset), identify(dataset, FilterName.CKF)


@pytest.mark.slow
def test_where_nothing_disturbs_much_process_noise_is_told_to_be_lowered(simulated_with):
    prepared, estimate = identified(simulated_with, noise(0.03))
    assert process_noise_score(prepared, estimate) < -20.0
    assert "lower it" in efficiency_warning(prepared, estimate, [])


@pytest.mark.slow
def test_where_waves_push_little_process_noise_is_not_told_to_be_lowered(simulated_with):
    waves = "manoeuvre.disturbance.moment={standard_deviation: [0.2 N*m, 2 N*m, 2 N*m], time_constant: 0.3 s}"
    prepared, estimate = identified(simulated_with, waves, noise(1e-3))
    assert process_noise_score(prepared, estimate) > 3.5
    advice = efficiency_warning(prepared, estimate, [])
    assert "too small" in advice
    assert "lower" not in advice


def test_a_cause_that_was_found_stands_before_what_the_noise_is_worth(simulated_with):
    prepared, estimate = identified(simulated_with, noise(0.03))
    cause = Cause(100.0, "errors of gyroscope that last", "its bias", lasts=True)
    assert "lower" not in efficiency_warning(prepared, estimate, [cause])


def test_the_score_is_the_slope_of_the_likelihood(simulated_with):
    """Against differences of the likelihood itself, along one trajectory, all process noise times as much."""
    prepared = prepare(simulated_with(*SHORT, noise(1e-2)))
    augmented = augmented_problem(prepared)
    groups = [each.group for each in process_noises(augmented, prepared.experiment.identification)]
    joint, step = augmented.joint, 1e-3
    trajectory = follow_measurements(joint)

    def at(logarithm):
        problem = scaled(joint, groups, np.exp(logarithm * np.ones(len(groups))))
        smoothing = LinearSmoothing(problem)
        return log_likelihood(smoothing.filter(trajectory))

    scores = noise_scores_about(joint, groups, trajectory)
    assert scores.slope.sum() == pytest.approx((at(step) - at(-step)) / (2.0 * step), rel=0.05)
