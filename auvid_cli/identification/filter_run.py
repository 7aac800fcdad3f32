"""An estimator set up on a dataset: running it, and putting what it finds into SI units, part by part."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from time import perf_counter, thread_time

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.estimate import EstimateHeader, EstimatePart, Outcome
from auvid_cli.data.innovations import Innovations
from auvid_cli.filters import problem
from auvid_cli.filters.estimators import Estimator
from auvid_cli.filters.problem import Belief, Ending, Records, Timeline
from auvid_cli.filters.segments import of_stretch
from auvid_cli.vehicle.parameters import SENSORS

Array = NDArray[np.float64]


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
    stretches : sequence of iterable of Timeline
    prior : Belief
        About their joint state.
    scale : ndarray, shape (n,)
        SI value of one unit of each component of the state.
    measuring : dict of SensorRecord
        By name, in the order of the estimator's sensors.
    """

    header: EstimateHeader
    span: tuple[float, float]
    estimator: Estimator
    stretches: Sequence[Iterable[Timeline]]
    prior: Belief
    scale: Array
    measuring: dict[str, SensorRecord]

    def run(self, receive: Callable[[EstimatePart], None]) -> Outcome:
        """Estimate from the dataset.

        Parameters
        ----------
        receive : callable
            Told every part as it comes. Of the states every ``identification.keep_every``-th is handed
            over, and the last good one; of the innovations all.

        Returns
        -------
        Outcome
            Of an estimator that diverged: with the reason as its status.
        """
        course = _Course(self, receive)
        course.clocks -= _clocks()
        ending = self.estimator.estimate(self.stretches, self.prior, course.take)
        course.clocks += _clocks()
        course.hand_over_the_last()
        covariance = ending.covariance * np.outer(self.scale, self.scale)
        return Outcome(self._status(ending, course), covariance, course.n_good, *course.clocks.tolist())

    def part(
        self, rows: tuple[Array, Array, Array], innovations: dict[str, Innovations], kept: slice = slice(None)
    ) -> EstimatePart:
        """Time, mean and standard deviation in scaled units, of which some rows are kept, with innovations."""
        time, mean, deviation = (row[kept] for row in rows)
        return EstimatePart(time, mean * self.scale, deviation * self.scale, innovations)

    def by_sensor(self, timeline: Timeline, records: Records) -> dict[str, Innovations]:
        """Return the innovations of each sensor, of a part of the data."""
        n_readings = len(records.nis)
        time = np.repeat(timeline.time, np.diff(timeline.reading_offset))[:n_readings]
        by_sensor = {}
        for sensor, (name, record) in enumerate(self.measuring.items()):
            own = (timeline.reading_sensor[:n_readings] == sensor) & ~np.isnan(records.nis)
            width = len(SENSORS[name])
            by_sensor[name] = Innovations(
                time[own],
                records.innovation[own, :width],
                records.innovation_variance[own, :width],
                records.nis[own],
                record.standard_deviation,
            )
        return by_sensor

    def _status(self, ending: Ending, course: "_Course") -> str:
        names, at = tuple(self.measuring), f"diverged at t = {course.reached:.3f} s"
        match ending.culprit:
            case problem.OK:
                return "completed"
            case problem.NOT_CONVERGED:
                limit = self.header.experiment.identification.output_error.max_evaluations
                return (
                    "unconverged: the fit did not settle within identification.output_error.max_evaluations = "
                    f"{limit}; where it had got to is no estimate"
                )
            case problem.PREDICTION if self.estimator.in_one_batch:
                return f"{at}: no fit was found whose motion reaches the end of the data"
            case problem.PREDICTION:
                why = (
                    f"after a reading of {names[course.sensor]} the state or its covariance could not be propagated "
                    "to this time"
                )
            case sensor:
                why = f"the state was not finite after a reading of {names[sensor]}"
        return f"{at}: {why}{_state_of_the_factor(ending, course.sigmas)}"


class _Course:
    """What is known of a run so far; `take` is what the estimator hands its parts to.

    Attributes
    ----------
    n_good : int
        Events that went well.
    reached : float
        Time of the event after these, s.
    sensor : int
        Whose reading was taken last.
    sigmas : float
        Size of the last innovation, standard deviations.
    clocks : ndarray, shape (2,)
        Processor and wall time of the estimator alone, without that of whoever receives, s.
    """

    def __init__(self, run: FilterRun, receive: Callable[[EstimatePart], None]) -> None:
        self.n_good, self.reached, self.sensor, self.sigmas = 0, run.span[0], 0, np.nan
        self.clocks = np.zeros(2)
        self._run, self._receive = run, receive
        self._every = run.header.experiment.identification.keep_every
        # Before the first event the last good state is the prior.
        prior = of_stretch(run.prior, np.arange(run.scale.size))
        rows = np.array([self.reached]), prior.mean[None, :], np.diag(prior.factor)[None, :]
        self._latest = run.part(rows, {name: _no_innovations(record) for name, record in run.measuring.items()})

    def take(self, timeline: Timeline, records: Records) -> None:
        """Hand on a part of the data, and note how far it went well."""
        self.clocks += _clocks()
        good = len(records.mean)
        rows = timeline.time[:good], records.mean, records.standard_deviation
        kept = slice(-self.n_good % self._every, None, self._every)
        self._receive(self._run.part(rows, self._run.by_sensor(timeline, records), kept))
        if good:
            self._latest = self._run.part(rows, self._latest.innovations, slice(good - 1, good))
        self.n_good += good
        self.reached = float(timeline.time[min(good, timeline.time.size - 1)])
        if readings := timeline.reading_offset[good]:
            self.sensor = int(timeline.reading_sensor[readings - 1])
        # Of the readings at which it failed some may not have been looked at.
        judged = records.nis[np.isfinite(records.nis)]
        if judged.size:
            self.sigmas = float(np.sqrt(judged[-1]))
        self.clocks -= _clocks()

    def hand_over_the_last(self) -> None:
        """Hand on the last good state, unless it was kept anyway."""
        if self.n_good == 0 or (self.n_good - 1) % self._every:
            self._receive(self._latest)


def _state_of_the_factor(ending: Ending, sigmas: float) -> str:
    deviation = np.sqrt(np.diagonal(ending.covariance))
    # Of the factor scaled to unit rows: what its own units do to it says nothing.
    condition = np.sqrt(np.linalg.cond(ending.covariance / np.outer(deviation, deviation)))
    return f" (last innovation {sigmas:.3g} sigma, condition of the factor {condition:.2g})"


def _clocks() -> Array:
    """Processor time of this thread and wall time, s."""
    return np.array([thread_time(), perf_counter()])


def _no_innovations(record: SensorRecord) -> Innovations:
    nothing = np.zeros((0, record.values.shape[1]))
    return Innovations(np.zeros(0), nothing, nothing, np.zeros(0), record.standard_deviation)
