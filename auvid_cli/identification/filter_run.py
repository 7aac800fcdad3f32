"""One filter on one dataset: the run, its record, and the score tests of faults after it."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from time import perf_counter, thread_time

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.estimate import EstimateChunk, EstimateHeader, Outcome
from auvid_cli.data.faults import Fault, FaultKind, FaultTest
from auvid_cli.data.innovations import Innovations
from auvid_cli.filters import problem
from auvid_cli.filters.problem import (
    AlternativeEstimate,
    FaultScores,
    FilterOutcome,
    Gaussian,
    Records,
    Timeline,
    segment_gaussian,
)
from auvid_cli.filters.square_root import Estimator
from auvid_cli.identification.prepared_data import FoundDelays
from auvid_cli.vehicle.parameters import SENSORS

Array = NDArray[np.float64]
# Of parameters that an unfinished iteration still moves, so many are named, and what counts as moving, in standard
# deviations.
_MOST_NAMED, _MOVES = 4, 0.1


def fault_tests(outcome: FilterOutcome, header: EstimateHeader, scale: Array) -> tuple[FaultTest, ...]:
    """Return the test of each fault that leaves a trace in the data, and of each alternative estimate.

    Parameters
    ----------
    outcome : FilterOutcome
        In scaled units.
    header : EstimateHeader
    scale : ndarray, shape (n,)
        SI value of one unit of each component of the state.
    """
    coefficients = header.coefficient_rows
    deviation = np.sqrt(np.diagonal(outcome.covariance))
    scores = [] if outcome.faults is None else _of_scores(outcome.faults, header, coefficients, deviation)
    others = (_of_other(other, header, coefficients, deviation, scale) for other in outcome.others)
    # The difference from a segment that alone has all information has no variance.
    return *scores, *(test for test in others if np.isfinite(test.standard_deviation))


def _of_scores(
    faults: FaultScores, header: EstimateHeader, coefficients: list[int], deviation: Array
) -> list[FaultTest]:
    spread = header.experiment.identification.estimate.delay.spread
    delays = [model for model in faults.labels if model.fault.kind in (FaultKind.INPUT_DELAY, FaultKind.SENSOR_DELAY)]
    faults = faults.conditional_on({model: spread for model in delays if model.state in header.state})
    # A fin that anticipates looks like one that is late: only what the delay of all inputs leaves is attributed to it.
    not_late = faults.conditional_on({model: spread for model in delays if not model.sensor})
    tests = []
    for model in faults.labels:
        own = not_late if model.answers else faults
        f = own.labels.index(model)
        # A fault that leaves no trace is not tested.
        if own.information[f, f] > 0.0:
            moved = np.abs(own.effect[coefficients, f]) / deviation[coefficients]
            sigma, worst = float(own.information[f, f] ** -0.5), int(moved.argmax())
            symbol = header.state[coefficients[worst]]
            size = float(own.score[f]) * sigma**2
            tests.append(FaultTest(model.fault, model.unit, size, sigma, symbol, float(moved[worst]) * sigma))
    return tests


def _of_other(
    other: AlternativeEstimate, header: EstimateHeader, coefficients: list[int], deviation: Array, scale: Array
) -> FaultTest:
    """Compare the coefficient that differs most."""
    worst = max(coefficients, key=lambda row: abs(other.difference[row]) / other.deviation[row])
    size, sigma = (float(values[worst] * scale[worst]) for values in (other.difference, other.deviation))
    moved = float(other.moved[worst] / deviation[worst])
    if other.begin is None:
        fault = Fault(FaultKind.ANOTHER_MINIMUM, f"{other.cost_increase:.3g}")
    else:
        fault = Fault(FaultKind.SEGMENT, f"{other.begin:g}")
    return FaultTest(fault, header.unit[worst], size, sigma, header.state[worst], moved)


@dataclass(frozen=True)
class FilterRun:
    """An estimator set up on a dataset, ready to run.

    Attributes
    ----------
    header : EstimateHeader
    span : tuple of float
        First and last time of the data, s.
    estimator : Estimator
        In scaled units: coefficients as multiples of their priors.
    segments : sequence of iterable of Timeline
    prior : Gaussian
        About their joint state.
    scale : ndarray, shape (n,)
        SI value of one unit of each component of the state.
    measuring : dict of SensorRecord
        By name, in the order of the estimator's sensors.
    delays : FoundDelays or None
        Found beside the estimator, which knows nothing of how unsure they are.
    """

    header: EstimateHeader
    span: tuple[float, float]
    estimator: Estimator
    segments: Sequence[Iterable[Timeline]]
    prior: Gaussian
    scale: Array
    measuring: dict[str, SensorRecord]
    delays: FoundDelays | None = None

    def run(self, on_chunk: Callable[[EstimateChunk], None]) -> Outcome:
        """Estimate from the dataset.

        Parameters
        ----------
        on_chunk : callable
            Told every chunk as it comes. Of the states every ``identification.keep_every``-th is handed
            over, and the last good one; of the innovations all.

        Returns
        -------
        Outcome
            Of an estimator that diverged: with the reason as its status.
        """
        course = _Course(self, on_chunk)
        course.clocks -= _clocks()
        outcome = self.estimator.estimate(self.segments, self.prior, course.take)
        course.clocks += _clocks()
        course.hand_over_the_last()
        covariance = outcome.covariance * np.outer(self.scale, self.scale)
        corrected = outcome.corrected * self.scale[: outcome.corrected.size]
        if self.delays is not None:
            covariance = self.delays.joint(covariance)
            corrected = self.delays.widened(corrected)
        ended = self._status(outcome, course), covariance, course.n_good, *course.clocks.tolist()
        return Outcome(
            *ended,
            faults=fault_tests(outcome, self.header, self.scale),
            corrected=dict(zip(self.header.state, corrected.tolist(), strict=False)),
        )

    def chunk(
        self, rows: tuple[Array, Array, Array], innovations: dict[str, Innovations], kept: slice = slice(None)
    ) -> EstimateChunk:
        """Convert a chunk to SI from time, mean and standard deviation in scaled units, with its innovations."""
        time, mean, deviation = (row[kept] for row in rows)
        states = mean * self.scale, deviation * self.scale
        return EstimateChunk(time, *(states if self.delays is None else self.delays.along(*states)), innovations)

    def by_sensor(self, timeline: Timeline, records: Records) -> dict[str, Innovations]:
        """Return the innovations of each sensor, of a chunk of the data."""
        n_measurements = len(records.nis)
        time = np.repeat(timeline.time, np.diff(timeline.measurement_offset))[:n_measurements]
        by_sensor = {}
        for sensor, (name, record) in enumerate(self.measuring.items()):
            used = (timeline.measurement_sensor[:n_measurements] == sensor) & ~np.isnan(records.nis)
            width = len(SENSORS[name])
            by_sensor[name] = Innovations(
                time[used],
                records.innovation[used, :width],
                records.innovation_variance[used, :width],
                records.nis[used],
                record.standard_deviation,
                weight=None if records.weight is None else records.weight[used, :width],
            )
        return by_sensor

    def _status(self, outcome: FilterOutcome, course: "_Course") -> str:
        names, at = tuple(self.measuring), f"diverged at t = {course.reached:.3f} s"
        match outcome.failure:
            case problem.OK:
                return "completed"
            case problem.NOT_CONVERGED:
                within = f"unconverged: it did not settle within identification.{self.estimator.limit}"
                return f"{within}; where it had got to is no estimate{self._seen(outcome, course)}"
            case problem.PREDICTION if self.estimator.in_one_batch:
                return f"{at}: no fit was found whose motion reaches the end of the data"
            case problem.PREDICTION:
                why = (
                    f"after a measurement of {names[course.sensor]} the state or its covariance could not be "
                    "propagated to this time"
                )
            case sensor:
                why = f"the state was not finite after a measurement of {names[sensor]}"
        return f"{at}: {why}{_state_of_the_factor(outcome, course.sigmas)}"

    def _seen(self, outcome: FilterOutcome, course: "_Course") -> str:
        """Say what was seen where an iteration had got to."""
        convergence = outcome.convergence
        assert convergence is not None, "whoever does not converge says how far that is"
        moves = np.abs(np.nan_to_num(convergence.step))
        largest = [row for row in np.argsort(-moves)[:_MOST_NAMED] if moves[row] >= _MOVES]
        moving = ", ".join(f"{self.header.state[row]} by {moves[row]:.2g}" for row in largest)
        seen = [
            f"the first {convergence.fraction:.0%} of the data were fitted" if convergence.fraction < 1.0 else "",
            f"NIS {course.mean_nis:.3g}",
            f"the cost may still fall by {convergence.cost_decrease:.2g}",
            f"of their standard deviations the next step moves {moving}"
            if moving
            else f"the next step moves no parameter by {_MOVES:g} of its standard deviation",
        ]
        return f" ({', '.join(filter(None, seen))})"


class _Course:
    """What is known of a run so far; `take` is what the estimator hands its chunks to.

    Attributes
    ----------
    n_good : int
        Events that went well.
    reached : float
        Time of the event after these, s.
    sensor : int
        Whose measurement was taken last.
    sigmas : float
        Size of the last innovation, standard deviations.
    squares, components : float
        Sum of the NIS so far, of so many components.
    clocks : ndarray, shape (2,)
        Processor and wall time of the estimator alone, without that of whoever takes them, s.
    """

    def __init__(self, run: FilterRun, on_chunk: Callable[[EstimateChunk], None]) -> None:
        self.n_good, self.reached, self.sensor, self.sigmas = 0, run.span[0], 0, np.nan
        self.squares, self.components = 0.0, 0
        self.clocks = np.zeros(2)
        self._run, self._on_chunk = run, on_chunk
        self._every = run.header.experiment.identification.keep_every
        # Before the first event the last good state is the prior.
        prior = segment_gaussian(run.prior, np.arange(run.scale.size))
        rows = np.array([self.reached]), prior.mean[None, :], np.diag(prior.factor)[None, :]
        self._latest = run.chunk(rows, {name: _no_innovations(record) for name, record in run.measuring.items()})

    def take(self, timeline: Timeline, records: Records) -> None:
        """Hand on a chunk of the data, and note how far it went well."""
        self.clocks += _clocks()
        good = len(records.mean)
        rows = timeline.time[:good], records.mean, records.standard_deviation
        kept = slice(-self.n_good % self._every, None, self._every)
        self._on_chunk(self._run.chunk(rows, self._run.by_sensor(timeline, records), kept))
        if good:
            self._latest = self._run.chunk(rows, self._latest.innovations, slice(good - 1, good))
        self.n_good += good
        self.reached = float(timeline.time[min(good, timeline.time.size - 1)])
        if measurements := timeline.measurement_offset[good]:
            self.sensor = int(timeline.measurement_sensor[measurements - 1])
        # Of the measurements at which it failed some may not have been looked at.
        judged = records.nis[np.isfinite(records.nis)]
        if judged.size:
            self.sigmas = float(np.sqrt(judged[-1]))
        self.squares += float(judged.sum())
        self.components += int(np.isfinite(records.innovation_variance).sum())
        self.clocks -= _clocks()

    @property
    def mean_nis(self) -> float:
        """Return the normalised innovation squared per component."""
        return self.squares / max(self.components, 1)

    def hand_over_the_last(self) -> None:
        """Hand on the last good state, unless it was kept anyway."""
        if self.n_good == 0 or (self.n_good - 1) % self._every:
            self._on_chunk(self._latest)


def _state_of_the_factor(outcome: FilterOutcome, sigmas: float) -> str:
    deviation = np.sqrt(np.diagonal(outcome.covariance))
    # Of the factor scaled to unit rows: what its own units do to it says nothing.
    condition = np.sqrt(np.linalg.cond(outcome.covariance / np.outer(deviation, deviation)))
    return f" (last innovation {sigmas:.3g} sigma, condition of the factor {condition:.2g})"


def _clocks() -> Array:
    """Return processor time of this thread and wall time, s."""
    return np.array([thread_time(), perf_counter()])


def _no_innovations(record: SensorRecord) -> Innovations:
    nothing = np.zeros((0, record.values.shape[1]))
    return Innovations(np.zeros(0), nothing, nothing, np.zeros(0), record.standard_deviation)
