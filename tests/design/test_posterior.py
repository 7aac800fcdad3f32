"""Predicted accuracy of the coefficients after a run."""

import numpy as np
import pytest

from auvid_cli.design.posterior import filter_assumptions, predict_posterior
from auvid_cli.evaluation.bounds import bounds_at, information_with_process_noise, probable_motion
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.simulation.manoeuvres import make_plan
from auvid_cli.simulation.motion import simulate_motion
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import N_MOTION


@pytest.fixture
def run(experiment_with):
    """Function: the experiment and its posterior, of a short spiral."""

    def posterior(*overrides, assumptions=None):
        experiment = experiment_with("manoeuvre.duration=30 s", "sensors.attitude.source=direct", *overrides)
        manoeuvre = experiment.manoeuvre.model_copy(update={"input_rate": 20.0})
        plan = make_plan(manoeuvre)
        truth = simulate_motion(experiment.vehicle, manoeuvre, plan, np.zeros((plan.time.size, 6)), 0.025)
        return experiment, predict_posterior(truth, assumptions or filter_assumptions(experiment))

    return posterior


OWN_TERMS = (
    "vehicle.terms=[{name: K_up, row: K, factors: [u, p], value: -2}, {name: X_vr, row: X, factors: [v, r], value: 20}]"
)


@pytest.mark.parametrize("overrides", [(), (OWN_TERMS,)], ids=["the 22", "own terms"])
def test_posterior_matches_linear_smoother_about_measured_motion(run, overrides):
    """Another algorithm: square roots, at every measurement, about a trajectory that follows noisy data."""
    experiment, posterior = run(*overrides)
    assert posterior.deviation.shape[1] == len(SYMBOLS) + 2 * len(overrides)
    about = probable_motion(prepare(simulate(experiment)), experiment.vehicle.all_coefficients())
    assert about is not None
    information = information_with_process_noise(about)
    prior = filter_assumptions(experiment).prior_std
    matrix = information.matrix / np.outer(information.prior_std, information.prior_std) + np.diag(prior**-2)
    covariance = np.linalg.inv(matrix)
    ratio = posterior.deviation[-1] / np.sqrt(np.diagonal(covariance))
    assert np.abs(np.log(ratio)).max() < 0.15
    assert abs(np.log(ratio).mean()) < 0.03


@pytest.mark.slow
def test_posterior_without_process_noise_equals_bound_of_unstable_vehicle(remus):
    """An integrated motion would diverge from that of the doublets by rounding: a tenth too optimistic."""
    doublets = (
        "manoeuvre=manoeuvres/doublets.yaml",
        "manoeuvre.speed=1.54 m/s",
        "manoeuvre.duration=60 s",
        "sensors.attitude.source=direct",
    )
    experiment = remus(*doublets)
    dataset = simulate(experiment)
    truth = simulate_motion(
        experiment.vehicle,
        experiment.manoeuvre,
        make_plan(experiment.manoeuvre),
        np.zeros((dataset.truth.time.size, 6)),
    )
    assumptions = filter_assumptions(experiment)._replace(noise_density=np.zeros(N_MOTION))
    deviation = predict_posterior(truth, assumptions).deviation[-1]
    bound = bounds_at(prepare(dataset), dataset.truth.coefficients).of_data
    np.testing.assert_allclose([bound[symbol] for symbol in SYMBOLS], deviation, rtol=0.01)


def test_earlier_information_adds_to_information_of_run(run):
    """Independent information as large as the run's own gives twice that plus the prior's."""
    experiment, first = run()
    prior = filter_assumptions(experiment).prior_std
    earlier = np.linalg.inv(first.covariance) - np.diag(prior**-2)
    assumptions = filter_assumptions(experiment, earlier)
    before = np.diagonal(assumptions.covariance) * prior**2
    np.testing.assert_allclose(before, np.diagonal(first.covariance), rtol=1e-4)
    _, both = run(assumptions=assumptions)
    summed = np.linalg.inv(2.0 * earlier + np.diag(prior**-2))
    np.testing.assert_allclose(both.deviation[-1], np.sqrt(np.diagonal(summed)), rtol=0.02)


def test_fixed_coefficients_stay_fixed_with_earlier_information(experiment_with):
    experiment = experiment_with("identification.coefficients=[N_uudr, N_url]")
    assumptions = filter_assumptions(experiment, np.eye(len(SYMBOLS)))
    few = [SYMBOLS.index(symbol) for symbol in ("N_uudr", "N_url")]
    others = np.delete(np.arange(len(SYMBOLS)), few)
    assert not assumptions.covariance[others].any()
    assert not assumptions.covariance[:, others].any()
    assert (np.diagonal(assumptions.covariance)[few] < 1.0).all()


def test_fixed_coefficients_improve_the_others(run):
    _, of_all = run()
    _, of_few = run("identification.coefficients=[N_uudr, N_url]")
    few = [SYMBOLS.index(symbol) for symbol in ("N_uudr", "N_url")]
    held = np.delete(np.arange(len(SYMBOLS)), few)
    assert not of_few.deviation[:, held].any()
    assert (of_few.deviation[-1, few] < of_all.deviation[-1, few]).all()


def test_missing_sensor_increases_deviation(run):
    _, posterior = run()
    _, blind = run("sensors.dvl=null")
    assert (blind.deviation[-1] > posterior.deviation[-1]).all()


def test_deviation_falls_with_time_and_rises_with_process_noise(run):
    _, posterior = run()
    assert (np.diff(posterior.deviation, axis=0) < 1e-9 * posterior.deviation[0]).all()
    _, noisier = run("identification.process_noise={velocity: 1e-3, rate: 1e-3, attitude: 1e-4}")
    assert (noisier.deviation[-1] > posterior.deviation[-1]).all()
