"""Estimators as objects: what they are called, whether they take all data in one batch, and their settings."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.problem import Belief, Ending, Process, Receiver, Sensors, Timeline
from auvid_cli.filters.segments import one_after_the_other

Array = NDArray[np.float64]

# Filters one stretch of data: process, sensors, timelines, prior, receiver.
FilterStretch = Callable[[Process, Sensors, Iterable[Timeline], Belief, Receiver], Ending]


class Estimator(Protocol):
    """What finds the joint state of stretches of data."""

    @property
    def name(self) -> str:
        """By which commands, settings and files know it."""
        ...

    @property
    def in_one_batch(self) -> bool:
        """Whether it goes through all data many times, instead of from measurement to measurement."""
        ...

    def estimate(self, stretches: Sequence[Iterable[Timeline]], prior: Belief, receive: Receiver) -> Ending:
        """Estimate the joint state of stretches, see `auvid_cli.filters.segments`, and hand over what is found."""
        ...


@dataclass(frozen=True)
class KalmanFilter:
    """A filter that goes from measurement to measurement, and from stretch to stretch.

    Attributes
    ----------
    name : str
    process : Process
    sensors : Sensors
    filter_stretch : callable
        Such as `run_extended_filter`, or `run_square_root_filter` with a set of points.
    """

    name: str
    process: Process
    sensors: Sensors
    filter_stretch: FilterStretch
    in_one_batch = False

    def estimate(self, stretches: Sequence[Iterable[Timeline]], prior: Belief, receive: Receiver) -> Ending:
        """Filter one stretch after the other."""
        run = partial(self.filter_stretch, self.process, self.sensors)
        return one_after_the_other(run, self.process.noise_density.size, stretches, prior, receive)


@dataclass(frozen=True)
class OutputErrorMethod:
    """The fit of motions left to themselves; see `auvid_cli.filters.output_error`.

    Attributes
    ----------
    name : str
    process : Process
    sensors : Sensors
    max_evaluations : int
    bounds : tuple of ndarray, shape (n,)
        Lower and upper, of the joint state.
    use_prior : bool
    """

    name: str
    process: Process
    sensors: Sensors
    max_evaluations: int
    bounds: tuple[Array, Array]
    use_prior: bool
    in_one_batch = True

    def estimate(self, stretches: Sequence[Iterable[Timeline]], prior: Belief, receive: Receiver) -> Ending:
        """Fit all stretches at once."""
        # No other estimator needs scipy's optimisers.
        from auvid_cli.filters.output_error import run_output_error

        problem = self.process, self.sensors, stretches, prior, receive
        return run_output_error(*problem, self.max_evaluations, self.bounds, self.use_prior)
