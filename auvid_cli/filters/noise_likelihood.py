"""Likelihood of process and measurement noise.

In the linear problem about a trajectory, minus twice the log-likelihood of the measurements, with trajectory and
parameters integrated out, is ``sum(log S + e^2 / S)`` over the innovations e of variance S (Schweppe, IEEE Trans.
Autom. Control 11(1), 1965). `auvid_cli.filters.noise_search` maximises it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing, Trajectory, gauss_newton
from auvid_cli.filters.noise_scores import NoiseGroup, NoiseScores, noise_scores, with_time_constants
from auvid_cli.filters.problem import JointProblem
from auvid_cli.filters.process_noise import with_process_memory
from auvid_cli.filters.smoother import follow_measurements, most_probable

# Maximum number of passes for the first motion given the parameters of a part of the data.
_FIRST_PASSES = 5
# Size of the cache, as a multiple of the default. A cache of 1 repeats a third of the passes over 47 minutes.
_CACHES = 2
# Smallest mean NIS of a sensor for the start of a search; without noise it would be 0.
_MIN_NIS = 1e-12


class NoiseProgress(NamedTuple):
    """Progress of a search for the most likely noise."""

    passes: int  # through the data, for likelihoods and their slopes
    trajectories: int  # number of completed ones
    log_factor: Array  # shape (k,); the best so far
    log_likelihood: float  # with these, up to a constant of the data
    gain: float  # increase of the log-likelihood over that of factors of 1
    trajectory: Trajectory | None  # about which the likelihood is computed; none before the first is complete
    share: float  # approximate share of the whole search that is done
    converged: bool = False


def scaled(problem: JointProblem, groups: Sequence[NoiseGroup], factors: Array) -> JointProblem:
    """Return the problem with noise densities, standard deviations and time constants multiplied by factors."""
    process, variance, root = problem.process, problem.sensors.variance.copy(), problem.prior.factor.copy()
    for group, factor in zip(groups, factors.tolist(), strict=True):
        if group.rates:
            process = with_time_constants(process, group, factor)
        else:
            density = process.noise_density.copy()
            density[list(group.moving)] *= factor
            process = process._replace(noise_density=density)
        if group.is_stationary:
            for indices in problem.indices:
                root[indices[problem.n_parameters + np.array(group.moving)]] *= factor
        if group.sensor >= 0:
            variance[group.sensor] *= factor**2
    sensors, prior = problem.sensors._replace(variance=variance), problem.prior._replace(factor=root)
    return problem._replace(process=process, sensors=sensors, prior=prior)


OnPass = Callable[[NoiseProgress], None]


class TrajectoryStep(NamedTuple):
    """Step of the trajectory towards the marginal estimate."""

    trajectory: Trajectory
    gain: float  # increase of the log of the marginal posterior; computed in a coarse search, otherwise predicted
    objective: float  # minus twice the log of the marginal posterior after the step, up to a constant of the data


class NoiseLikelihood:
    """Log-likelihood as a function of log factors, about a trajectory."""

    def __init__(self, problem: JointProblem, groups: Sequence[NoiseGroup], on_pass: OnPass) -> None:
        self._problem, self._groups, self._on_pass = problem, groups, on_pass
        self._present, self.smoothing = problem, LinearSmoothing(problem, _CACHES)
        self.minimum = np.array([group.min_log_factor for group in groups])
        self.progress = NoiseProgress(0, 0, np.zeros(len(groups)), -np.inf, 0.0, None, 0.0)

    def set_share(self, share: float) -> None:
        """Set the approximate share of the whole search that is done."""
        self.progress = self.progress._replace(share=share)

    def filter(self, logarithms: Array, trajectory: Trajectory) -> Filtered | None:
        """Filter with scaled noise; None if the cost is not finite."""
        self._count_pass()
        self._scale(logarithms)
        return self.smoothing.filter(trajectory)

    def at(self, logarithms: Array, trajectory: Trajectory) -> float:
        """Return the log-likelihood; minus infinity if the cost is not finite."""
        filtered = self.filter(logarithms, trajectory)
        return -np.inf if filtered is None else log_likelihood(filtered)

    def most_probable(self, logarithms: Array, max_passes: int) -> Trajectory | None:
        """Return the most probable trajectory with scaled noise; None if there is none."""
        self._scale(logarithms)
        minima = most_probable(self._present, self.smoothing, max_passes, enough=1)
        return minima[0][0].trajectory if minima else None

    def motion_given(self, logarithms: Array, parameters: Array) -> Trajectory | None:
        """Return a motion near the most probable one given parameters, with scaled noise; None if there is none."""
        self._scale(logarithms)
        followed = follow_measurements(self._present)
        if followed is None:
            return None
        of_motion = LinearSmoothing(self._present, parameters_are_given=True)
        found = gauss_newton(of_motion, replace(followed, parameters=parameters), _FIRST_PASSES)
        return None if found is None else found[0].trajectory

    def scores(self, filtered: Filtered) -> NoiseScores:
        """Return the derivatives at the log factors of the last forward pass."""
        self._count_pass()
        return noise_scores(self.smoothing, filtered, self._present, self._groups)

    def start_from_innovations(self, filtered: Filtered) -> Array:
        """Return log factors for a start, from the mean NIS in a forward pass with factors of 1.

        The factor of a sensor is the root of its mean NIS. That of process noise is the geometric mean over the
        sensors, that of a time constant is 1.
        """
        n_sensors = self._problem.sensors.variance.shape[0]
        squares, counts = np.zeros(n_sensors), np.zeros(n_sensors)
        for _, timeline, about, forward_pass in self.smoothing.forward_passes(filtered):
            measured = np.isfinite(about.residual)
            sensor = np.broadcast_to(timeline.measurement_sensor[:, None], measured.shape)[measured]
            squares += np.bincount(sensor, forward_pass.error[measured] ** 2 / forward_pass.total[measured], n_sensors)
            counts += np.bincount(sensor, minlength=n_sensors)
        nis = np.divide(squares, counts, out=np.ones(n_sensors), where=counts > 0)
        of_sensor = 0.5 * np.log(np.maximum(nis, _MIN_NIS))
        mean = of_sensor[counts > 0].mean()
        of_group = [
            0.0 if group.rates else of_sensor[group.sensor] if group.sensor >= 0 else mean for group in self._groups
        ]
        return np.maximum(of_group, self.minimum)

    def one_step(
        self, filtered: Filtered, is_coarse: bool, history: list[tuple[Array, Array]] | None
    ) -> TrajectoryStep | None:
        """Return the next trajectory, one step closer to the marginal estimate; `history` as `integrate_out_motion`.

        None if the motion diverges. In a search that is not coarse, also if no step is accepted although the predicted
        decrease of the cost matters.
        """
        # Imported here, because `noise_scores_about` does not need this compiled code.
        from auvid_cli.filters.marginal import integrate_out_motion

        found = integrate_out_motion(
            self._present, self.smoothing, filtered, max_steps=1, rough_motion=not is_coarse, history=history
        )
        if found is None:
            return None
        stepped, convergence, gain, objective = found
        if stepped is filtered and convergence is not None and not convergence.is_negligible:
            return None
        if not is_coarse:
            # A rough objective can show no gain while the parameters still move.
            gain = 0.0 if convergence is None else 0.5 * convergence.cost_decrease
        return TrajectoryStep(stepped.trajectory, gain, objective)

    def set_process_memory(self, trajectory: Trajectory) -> None:
        """Set the memory of the process noise from the motion along a trajectory."""
        self._problem = with_process_memory(self._problem, trajectory.parameters, trajectory.moving)

    def _count_pass(self) -> None:
        self.progress = self.progress._replace(passes=self.progress.passes + 1)
        self._on_pass(self.progress)

    def _scale(self, logarithms: Array) -> None:
        self._present = scaled(self._problem, self._groups, np.exp(logarithms))
        self.smoothing.change_noise(self._present)


def log_likelihood(filtered: Filtered) -> float:
    """Return the log-likelihood of the measurements in a linear problem, up to a constant."""
    return -0.5 * (filtered.least + filtered.log_determinant)


def noise_scores_about(
    problem: JointProblem, groups: Sequence[NoiseGroup], trajectory: Trajectory
) -> NoiseScores | None:
    """Return the derivatives at factors of 1 about a trajectory; None if its cost is not finite."""
    likelihood = NoiseLikelihood(problem, groups, lambda progress: None)
    likelihood.set_process_memory(trajectory)
    filtered = likelihood.filter(np.zeros(len(groups)), trajectory)
    return None if filtered is None else likelihood.scores(filtered)
