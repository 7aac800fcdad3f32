"""All estimators as objects with the same method."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Reversible, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from auvid_cli.arrays import Array
from auvid_cli.filters.problem import (
    FilterOutcome,
    Gaussian,
    JointProblem,
    OnChunk,
    Process,
    Sensors,
    Timeline,
    filter_sequentially,
)
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import PointSet

if TYPE_CHECKING:
    from auvid_cli.filters.linear_smoother import Trajectory
    from auvid_cli.filters.signatures import Faults


class Estimator(Protocol):
    """Estimator of the joint state of all segments."""

    @property
    def name(self) -> str:
        """Name in commands, settings and files."""
        ...

    @property
    def in_one_batch(self) -> bool:
        """Whether it fits all data at once, instead of one measurement after another."""
        ...

    @property
    def limit(self) -> str:
        """Setting that limits its iterations, with its value; empty for a filter."""
        ...

    def estimate(self, segments: Sequence[Reversible[Timeline]], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Estimate the joint state of segments, and pass records to `on_chunk`."""
        ...


@dataclass(frozen=True)
class KalmanFilter(ABC):
    """Recursive filter of one segment after another."""

    name: str
    process: Process
    sensors: Sensors
    in_one_batch = False
    limit = ""

    @abstractmethod
    def filter_segment(self, timelines: Iterable[Timeline], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Filter one segment from a prior of its own state."""

    def estimate(self, segments: Sequence[Reversible[Timeline]], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Filter one segment after the other."""
        problem = JointProblem(self.process, self.sensors, segments, prior)
        return filter_sequentially(self.filter_segment, problem, on_chunk)


class ExtendedKalmanFilter(KalmanFilter):
    """The EKF with the transition of its process; see `auvid_cli.filters.ekf`."""

    def filter_segment(self, timelines: Iterable[Timeline], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Filter one segment from a prior of its own state."""
        # filterpy is slow to load, and no other filter needs it.
        from auvid_cli.filters.ekf import run_extended_filter

        return run_extended_filter(self.process, self.sensors, timelines, prior, on_chunk)


@dataclass(frozen=True)
class SigmaPointFilter(KalmanFilter):
    """Filter with a sigma-point set for the state of a segment."""

    points: PointSet

    def filter_segment(self, timelines: Iterable[Timeline], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Filter one segment from a prior of its own state."""
        return run_square_root_filter(self.points, self.process, self.sensors, timelines, prior, on_chunk)


@dataclass(frozen=True)
class OutputErrorMethod:
    """Output-error method; see `auvid_cli.filters.output_error.run_output_error` for its settings."""

    name: str
    process: Process
    sensors: Sensors
    max_evaluations: int
    bounds: tuple[Array, Array]
    use_prior: bool
    in_one_batch = True

    @property
    def limit(self) -> str:
        """Setting that limits its iterations, with its value."""
        return f"output_error.max_evaluations = {self.max_evaluations}"

    def estimate(self, segments: Sequence[Reversible[Timeline]], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Fit all segments at once."""
        # No other estimator needs scipy's optimisers.
        from auvid_cli.filters.output_error import run_output_error

        problem = JointProblem(self.process, self.sensors, segments, prior)
        return run_output_error(problem, on_chunk, self.max_evaluations, self.bounds, self.use_prior)


@dataclass(frozen=True)
class IteratedSmoother:
    """Iterated smoother; see `auvid_cli.filters.smoother.run_smoother` for its settings."""

    name: str
    process: Process
    sensors: Sensors
    max_passes: int
    faults: "Faults"
    marginal: bool
    start: "Trajectory | None" = None
    in_one_batch = True

    @property
    def limit(self) -> str:
        """Setting that limits its iterations, with its value."""
        return f"smoother.max_passes = {self.max_passes}"

    def estimate(self, segments: Sequence[Reversible[Timeline]], prior: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        """Smooth all segments at once."""
        # Its compiled code serves no other estimator.
        from auvid_cli.filters.smoother import run_smoother

        problem = JointProblem(self.process, self.sensors, segments, prior)
        return run_smoother(problem, on_chunk, self.max_passes, self.faults, self.marginal, self.start)
