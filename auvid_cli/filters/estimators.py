"""Estimators as objects: what they are called, and their settings."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.point_sets import PointSet
from auvid_cli.filters.problem import FilterOutcome, Gaussian, OnChunk, Process, Sensors, Timeline
from auvid_cli.filters.segments import JointProblem, one_after_the_other
from auvid_cli.filters.square_root import run_square_root_filter

if TYPE_CHECKING:
    from auvid_cli.filters.fault_scores import Faults

Array = NDArray[np.float64]


class Estimator(Protocol):
    """What finds the joint state of segments of data."""

    @property
    def name(self) -> str:
        """Return the name by which commands, settings and files know it."""
        ...

    @property
    def in_one_batch(self) -> bool:
        """Say whether it fits all data at once, instead of going from measurement to measurement."""
        ...

    @property
    def limit(self) -> str:
        """Name the setting that limits its iterations, with its value; empty if there is none."""
        ...

    def estimate(self, segments: Sequence[Iterable[Timeline]], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Estimate the joint state of segments, see `auvid_cli.filters.segments`, and hand over what is found."""
        ...


@dataclass(frozen=True)
class KalmanFilter(ABC):
    """A filter that goes from measurement to measurement, and from segment to segment.

    Attributes
    ----------
    name : str
    process : Process
    sensors : Sensors
    """

    name: str
    process: Process
    sensors: Sensors
    in_one_batch = False
    limit = ""

    @abstractmethod
    def filter_segment(self, timelines: Iterable[Timeline], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Filter one segment, from a Gaussian about its own state."""

    def estimate(self, segments: Sequence[Iterable[Timeline]], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Filter one segment after the other."""
        problem = JointProblem(self.process, self.sensors, segments, prior)
        return one_after_the_other(self.filter_segment, problem, on_chunk)


class ExtendedKalmanFilter(KalmanFilter):
    """The EKF, with whatever transition its process has; see `auvid_cli.filters.extended`."""

    def filter_segment(self, timelines: Iterable[Timeline], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Filter one segment, from a Gaussian about its own state."""
        # filterpy is slow to load and large, and no other filter needs it.
        from auvid_cli.filters.extended import run_extended_filter

        return run_extended_filter(self.process, self.sensors, timelines, prior, on_chunk)


@dataclass(frozen=True)
class SigmaPointFilter(KalmanFilter):
    """A filter with a set of sigma points; see `auvid_cli.filters.square_root`.

    Attributes
    ----------
    points : PointSet
        For the dimension of the state of a segment.
    """

    points: PointSet

    def filter_segment(self, timelines: Iterable[Timeline], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Filter one segment, from a Gaussian about its own state."""
        return run_square_root_filter(self.points, self.process, self.sensors, timelines, prior, on_chunk)


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

    @property
    def limit(self) -> str:
        """Name the setting that limits its iterations, with its value."""
        return f"output_error.max_evaluations = {self.max_evaluations}"

    def estimate(self, segments: Sequence[Iterable[Timeline]], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Fit all segments at once."""
        # No other estimator needs scipy's optimisers.
        from auvid_cli.filters.output_error import run_output_error

        problem = JointProblem(self.process, self.sensors, segments, prior)
        return run_output_error(problem, on_chunk, self.max_evaluations, self.bounds, self.use_prior)


@dataclass(frozen=True)
class IteratedSmoother:
    """The most probable trajectory and parameters; see `auvid_cli.filters.smoother`.

    Attributes
    ----------
    name : str
    process : Process
    sensors : Sensors
    max_passes : int
    faults : Faults
        To test for, about the answer.
    marginal : bool
        Whether its parameters are the most probable whatever the motion was.
    """

    name: str
    process: Process
    sensors: Sensors
    max_passes: int
    faults: "Faults"
    marginal: bool
    in_one_batch = True

    @property
    def limit(self) -> str:
        """Name the setting that limits its iterations, with its value."""
        return f"smoother.max_passes = {self.max_passes}"

    def estimate(self, segments: Sequence[Iterable[Timeline]], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Smooth all segments at once."""
        # What it is compiled from serves no other estimator.
        from auvid_cli.filters.smoother import run_smoother

        problem = JointProblem(self.process, self.sensors, segments, prior)
        return run_smoother(problem, on_chunk, self.max_passes, self.faults, self.marginal)
