"""Actuators with dynamics: simulated, and modelled by the estimators."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.simulation.manoeuvres import make_plan
from auvid_cli.simulation.motion import simulate_motion

FINS = (
    "{dead_band: 1 deg, saturation: 18 deg, rate_limit: 30 deg/s, time_constant: 0.1 s, "
    "stall: {angle: 12 deg, slope: -0.3}}"
)
OWN = (
    f"vehicle.actuators.fins={FINS}",
    "vehicle.actuators.propeller={dead_band: 2 N, saturation: 400 N, rate_limit: 60 N/s, time_constant: 0.3 s}",
    "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}",
    "manoeuvre.duration=60 s",
    "manoeuvre.input_rate=100 Hz",
)


@pytest.fixture(scope="module")
def run(simulated_with):
    return simulated_with(*OWN)


def test_estimators_see_what_acted_in_the_simulation(experiment_with, simulated_with):
    """Unmodelled offsets of the fins add to it."""
    overrides = *OWN, "manoeuvre.duration=20 s", "manoeuvre.fin_trim={rudder: 2 deg, elevator: -1 deg}"
    experiment, dataset = experiment_with(*overrides), simulated_with(*overrides)
    trim, plan = np.array([*np.deg2rad([2.0, -1.0]), 0.0, 0.0]), make_plan(experiment.manoeuvre)
    plan.feedforward[:] += trim
    nothing = np.zeros((plan.time.size, 6))
    truth = simulate_motion(experiment.vehicle, experiment.manoeuvre, plan, nothing, trim=trim)
    assert_allclose(truth.commands - trim, dataset.inputs.values, atol=1e-12)
    assert np.abs(truth.inputs - truth.commands).max(axis=0)[:3] == pytest.approx([0.1, 0.1, 20.0], rel=5.0)
    (segment,) = prepare(dataset).segments
    for timeline in segment.timelines:
        seen = timeline.inputs[timeline.substep_input]
        start = np.append(timeline.time[0], timeline.time[0] + np.cumsum(timeline.substep_duration))[:-1]
        assert start.size == len(seen)
        acted = truth.inputs[np.searchsorted(truth.time, start + 1e-6, side="right") - 1]
        assert_allclose(seen, acted - trim, atol=1e-9)


@pytest.mark.slow
def test_modelled_actuators_remove_the_bias(run, with_settings):
    true, unaware = run.truth.coefficients, with_settings(run, "vehicle.actuators={}")
    fins = "Y_uudr", "Z_uude", "M_uude", "N_uudr"

    def far(data):
        estimate = identify(data, FilterName.CKF)
        assert estimate.status == "completed"
        found = estimate.final_coefficients()
        deviation = dict(zip(estimate.state, estimate.standard_deviation[-1], strict=True))
        return {s: abs(found[s] - true[s]) / deviation[s] for s in true}

    assert max(far(run).values()) < 4.0
    assert max(far(unaware)[s] for s in fins) > 20.0


def test_ideal_actuators_change_nothing(simulated_with):
    plain, harmless = (
        simulated_with("manoeuvre.duration=10 s"),
        simulated_with("manoeuvre.duration=10 s", "vehicle.actuators.fins={saturation: 80 deg}"),
    )
    assert np.array_equal(plain.truth.motion, harmless.truth.motion)
    assert np.array_equal(plain.inputs.values, harmless.inputs.values)
    assert replace(plain.inputs, values=harmless.inputs.values).time is plain.inputs.time
