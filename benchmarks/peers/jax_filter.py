"""dynamax's unscented and extended filters, on the equations of motion in JAX."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from dynamax.nonlinear_gaussian_ssm import ParamsNLGSSM, UKFHyperParams, extended_kalman_filter, unscented_kalman_filter

from auvid_cli.vehicle.parameters import N_MOTION
from benchmarks.peers.plain_dynamics import Vehicle, advance, vehicle_of
from benchmarks.peers.problem import N_COEFFICIENTS, Answer, Peer, Problem

_WANTED = ["filtered_means", "filtered_covariances"]

jax.config.update("jax_enable_x64", True)


def _arrays(problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return emissions, inputs and process noise by event.

    An emission has nine components. Those that are absent measure nothing: their rows of the measurement are zero.
    All are divided by their standard deviation, because dynamax adds 1e-9 to the variance of the innovation.
    """
    n = len(problem.events)
    emissions, weights = np.zeros((n, N_MOTION)), np.zeros((n, N_MOTION))
    for row, event in enumerate(problem.events):
        deviation = np.sqrt(event.variance)
        place = event.measured - N_COEFFICIENTS
        emissions[row, place], weights[row, place] = event.measurement / deviation, 1.0 / deviation
    steps = np.array([[*event.held, event.duration] for event in problem.events])
    return emissions, np.hstack([steps, weights]), np.stack([event.process_noise for event in problem.events])


def _parameters(problem: Problem, vehicle: Vehicle, process_noise: Any) -> ParamsNLGSSM:
    return ParamsNLGSSM(
        initial_mean=jnp.asarray(problem.prior.mean),
        initial_covariance=jnp.asarray(problem.covariance),
        dynamics_function=lambda state, given: advance(state, given[4], given[:4], vehicle, jnp),
        dynamics_covariance=process_noise,
        emission_function=lambda state, given: given[5:] * state[N_COEFFICIENTS:],
        emission_covariance=jnp.eye(N_MOTION),
    )


def _filter(problem: Problem, *, unscented: bool) -> Callable[[], Answer]:
    vehicle = vehicle_of(problem.process)
    alpha, beta, kappa = problem.unscented
    arrays = tuple(jnp.asarray(array) for array in _arrays(problem))

    @jax.jit
    def filtered(emissions: Any, inputs: Any, process_noise: Any) -> tuple[Any, Any]:
        model = _parameters(problem, vehicle, process_noise)
        if unscented:
            settings = UKFHyperParams()._replace(alpha=alpha, beta=beta, kappa=kappa)
            result = unscented_kalman_filter(model, emissions, settings, inputs, output_fields=_WANTED)
        else:
            result = extended_kalman_filter(model, emissions, inputs, output_fields=_WANTED)
        means, covariances = result.filtered_means, result.filtered_covariances
        assert means is not None
        assert covariances is not None
        return means[-1], covariances[-1]

    def run() -> Answer:
        mean, covariance = filtered(*arrays)
        return Answer(np.asarray(mean), np.asarray(covariance))

    return run


_ABSENT = (
    "dynamax has measurements of one fixed size. Here it has nine components, with a row of zeros for each component "
    "that an event lacks. Measurements are divided by their standard deviation, because dynamax adds 1e-9 to the "
    "variance of every innovation. Compilation is not included: see above."
)

PEERS = (
    Peer(
        "EKF, exact transition",
        "dynamax",
        "JAX",
        "ekf exact",
        partial(_filter, unscented=False),
        compiles=True,
        note=_ABSENT,
    ),
    Peer("UKF", "dynamax", "JAX", "ukf", partial(_filter, unscented=True), compiles=True, note=_ABSENT),
)
