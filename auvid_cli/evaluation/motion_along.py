"""The motion along some data: the true one of a simulation, and the most probable with some coefficients held."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing, gauss_newton
from auvid_cli.filters.smoother import follow_measurements
from auvid_cli.identification.augmented import AugmentedProblem, augmented_problem
from auvid_cli.identification.prepared_data import PreparedData

Array = NDArray[np.float64]

# Instants beyond those between which a spline is wanted.
_NEIGHBOURS = 8
# Share of the prior's spread that parameters keep which are held, and passes through the data to find the rest.
_HELD, _PASSES = 1e-4, 20


class ProbableMotion(NamedTuple):
    """The most probable motion of data with some parameters held, and the linear problem about it.

    Attributes
    ----------
    prepared : PreparedData
    augmented : AugmentedProblem
    smoothing : LinearSmoothing
    filtered : Filtered
    """

    prepared: PreparedData
    augmented: AugmentedProblem
    smoothing: LinearSmoothing
    filtered: Filtered

    def motion(self) -> Callable[[Array], Array]:
        """Return it as a function of the times of events, shape (n, 9)."""
        rows = self.augmented.layout.moving_rows_of("motion")
        time = [timeline.time for segment in self.augmented.segments for timeline in segment.timelines]
        motion = [chunk[:, rows] for chunks in self.filtered.trajectory.moving for chunk in chunks]
        return _between(np.concatenate(time), np.concatenate(motion))


def probable_motion(prepared: PreparedData, values: Mapping[str, float]) -> ProbableMotion | None:
    """Find the most probable motion with some parameters held, and along with it the others: a current, a trim.

    Parameters
    ----------
    prepared : PreparedData
    values : mapping
        Of coefficients and other parameters, SI, by symbol: those that are held.

    Returns
    -------
    ProbableMotion or None
        None where no motion follows the data with these values and the process noise of the settings.
    """
    augmented = augmented_problem(prepared)
    layout, prior = augmented.layout, augmented.prior
    held = [row for row, symbol in enumerate(layout.symbols[: layout.n_parameters]) if symbol in values]
    mean, factor = prior.mean.copy(), prior.factor.copy()
    mean[held] = [values[layout.symbols[row]] / layout.scale[row] for row in held]
    factor[held] *= _HELD
    known = augmented.joint._replace(prior=prior._replace(mean=mean, factor=factor))
    # What a current does would else pass for slip, and noise that a trajectory follows would seem to move the vehicle.
    if (start := follow_measurements(known)) is None or (
        found := gauss_newton(LinearSmoothing(known), start, _PASSES)
    ) is None:
        return None
    trajectory, smoothing = found[0].trajectory, LinearSmoothing(known._replace(prior=prior._replace(mean=mean)))
    parameters = trajectory.parameters.copy()
    parameters[held] = mean[held]
    filtered = smoothing.filter(replace(trajectory, parameters=parameters))
    return None if filtered is None else ProbableMotion(prepared, augmented, smoothing, filtered)


def true_motion(prepared: PreparedData) -> Callable[[Array], Array] | None:
    """Return the true motion as a function of times, shape (n, 9); None without truth."""
    truth = prepared.dataset.truth
    return None if truth is None else _between(truth.time, truth.motion)


def true_initial_motions(prepared: PreparedData) -> list[Array] | None:
    """Return the true motion next to where each segment starts, shape (9,); None without truth."""
    truth = prepared.dataset.truth
    if truth is None:
        return None
    starts = [segment.timelines.span[0] for segment in prepared.segments]
    return [truth.motion[np.argmin(np.abs(truth.time - start))] for start in starts]


def _between(time: Array, motion: Array) -> Callable[[Array], Array]:
    def at(times: Array) -> Array:
        # A spline of a run of hours would take more memory than the run.
        first, last = np.searchsorted(time, times[[0, -1]])
        near = slice(max(first - _NEIGHBOURS, 0), last + _NEIGHBOURS)
        return CubicSpline(time[near], motion[near])(times)

    return at
