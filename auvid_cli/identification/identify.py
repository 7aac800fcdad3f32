"""Dataset -> Estimate by the filter that is asked for."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from time import perf_counter, thread_time

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Identification
from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.dataset import SENSORS, Dataset, SensorRecord
from auvid_cli.data.estimate import Estimate, EstimateHeader, EstimatePart, Innovations, Outcome
from auvid_cli.filters import problem
from auvid_cli.filters.point_sets import cubature, transformed, unscented
from auvid_cli.filters.problem import Belief, Ending, Receiver, Records, Timeline
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.stretches import of_stretch, one_after_the_other
from auvid_cli.identification.augmented import AugmentedProblem, augmented_problem
from auvid_cli.identification.process import first_order_transition

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FilterRun:
    """A filter set up on a dataset, ready to run.

    Attributes
    ----------
    header : EstimateHeader
    span : tuple of float
        First and last time of the data it filters, s.
    filter : callable
        Runs it in scaled units: coefficients as multiples of their priors.
    """

    header: EstimateHeader
    span: tuple[float, float]
    filter: Callable[[Receiver], Ending]
    _prior: Belief
    _to_si: Array
    _measuring: dict[str, SensorRecord]

    def run(self, receive: Callable[[EstimatePart], None]) -> Outcome:
        """Filter the dataset.

        Parameters
        ----------
        receive : callable
            Told every part as it comes. Of the states every ``identification.keep_every``-th is handed
            over, and the last good one; of the innovations all.

        Returns
        -------
        Outcome
            Of a filter that diverged: with the reason as its status.
        """
        every = self.header.experiment.identification.keep_every
        n_good, reached, heard, sigmas = 0, self.span[0], 0, np.nan
        # Before the first event the last good state is the prior.
        prior = np.array([reached]), self._prior.mean[None, :], np.diag(self._prior.factor)[None, :]
        latest = self._part(prior, {name: _no_innovations(record) for name, record in self._measuring.items()})
        # Time of the filter alone, without that of whoever receives.
        filtering = np.zeros(2)

        def pass_on(timeline: Timeline, records: Records) -> None:
            nonlocal n_good, reached, heard, sigmas, latest
            filtering[:] += _clocks()
            good = len(records.mean)
            rows = timeline.time[:good], records.mean, records.standard_deviation
            receive(self._part(rows, self._by_sensor(timeline, records), slice(-n_good % every, None, every)))
            if good:
                latest = self._part(rows, latest.innovations, slice(good - 1, good))
            n_good += good
            reached = float(timeline.time[min(good, timeline.time.size - 1)])
            if readings := timeline.reading_offset[good]:
                heard = int(timeline.reading_sensor[readings - 1])
            # Of the readings at which it failed some may not have been looked at.
            judged = records.nis[np.isfinite(records.nis)]
            if judged.size:
                sigmas = float(np.sqrt(judged[-1]))
            filtering[:] -= _clocks()

        filtering -= _clocks()
        ending = self.filter(pass_on)
        cpu_time, wall_time = (filtering + _clocks()).tolist()
        if n_good == 0 or (n_good - 1) % every:
            receive(latest)
        covariance = ending.covariance * np.outer(self._to_si, self._to_si)
        return Outcome(self._status(ending, reached, heard, sigmas), covariance, n_good, cpu_time, wall_time)

    def _part(
        self, rows: tuple[Array, Array, Array], innovations: dict[str, Innovations], kept: slice = slice(None)
    ) -> EstimatePart:
        time, mean, deviation = (row[kept] for row in rows)
        return EstimatePart(time, mean * self._to_si, deviation * self._to_si, innovations)

    def _by_sensor(self, timeline: Timeline, records: Records) -> dict[str, Innovations]:
        n_readings = len(records.nis)
        time = np.repeat(timeline.time, np.diff(timeline.reading_offset))[:n_readings]
        by_sensor = {}
        for sensor, (name, record) in enumerate(self._measuring.items()):
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

    def _status(self, ending: Ending, time: float, heard: int, sigmas: float) -> str:
        names = tuple(self._measuring)
        match ending.culprit:
            case problem.OK:
                return "completed"
            case problem.NOT_CONVERGED:
                limit = self.header.experiment.identification.output_error.max_evaluations
                return (
                    "unconverged: the fit did not settle within identification.output_error.max_evaluations = "
                    f"{limit}; where it had got to is no estimate"
                )
            case problem.PREDICTION if self.header.filter == FilterName.OUTPUT_ERROR:
                return f"diverged at t = {time:.3f} s: no fit was found whose motion reaches the end of the data"
            case problem.PREDICTION:
                return (
                    f"diverged at t = {time:.3f} s: after a reading of {names[heard]} the state or its covariance "
                    f"could not be propagated to this time{_state_of_the_factor(ending, sigmas)}"
                )
            case sensor:
                return (
                    f"diverged at t = {time:.3f} s: the state was not finite after a reading of {names[sensor]}"
                    f"{_state_of_the_factor(ending, sigmas)}"
                )


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


class _Watched:
    """Parts of the data, with something to be done before each is handed out."""

    def __init__(self, timelines: Iterable[Timeline], before_each: Callable[[], None]) -> None:
        self._timelines, self._before_each = timelines, before_each

    def __iter__(self) -> Iterator[Timeline]:
        for timeline in self._timelines:
            self._before_each()
            yield timeline


def set_up_filters(
    dataset: Dataset, filter_names: Sequence[FilterName], before_each: Callable[[], None] = lambda: None
) -> list[FilterRun]:
    """Filters that share a dataset's augmented state, prior and timeline; no truth is looked at.

    Parameters
    ----------
    dataset : Dataset
    filter_names : sequence of FilterName
    before_each : callable
        Called whenever a filter asks for the next part of the data, of which a fit asks many times. What it raises ends
        that filter.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    """
    settings = dataset.experiment.identification
    settings.check_filters(filter_names)
    augmented = augmented_problem(dataset)
    stretches = [_Watched(stretch.timelines, before_each) for stretch in augmented.stretches]
    return [
        FilterRun(
            EstimateHeader(
                filter=name.value,
                experiment=dataset.experiment,
                state=augmented.layout.symbols,
                unit=augmented.layout.units,
                held=augmented.held,
                dataset_sha256=dataset.sha256,
            ),
            augmented.span,
            partial(_chosen_filter(name, augmented, settings), stretches, augmented.prior),
            of_stretch(augmented.prior, augmented.places[0]),
            augmented.layout.scale,
            augmented.measuring,
        )
        for name in filter_names
    ]


def identify(dataset: Dataset, filter_name: FilterName) -> Estimate:
    """Estimate coefficients and motion from a dataset, all in memory; see `set_up_filters` and `FilterRun`."""
    (run,), parts = set_up_filters(dataset, [filter_name]), []
    outcome = run.run(parts.append)
    return Estimate.of(run.header, parts, outcome)


def _chosen_filter(
    name: FilterName, augmented: AugmentedProblem, settings: Identification
) -> Callable[[Sequence[Iterable[Timeline]], Belief, Receiver], Ending]:
    """What takes stretches, a prior about their joint state, and a receiver."""
    process, n = augmented.process, len(augmented.layout.symbols)
    match name:
        case FilterName.EKF:
            # filterpy is slow to load and large, and no other filter needs it.
            from auvid_cli.filters.extended import run_extended_filter as run

            if settings.ekf.transition == "first_order":
                process = process._replace(transition=first_order_transition)
        case FilterName.OUTPUT_ERROR:
            # Nor do they need scipy's optimisers.
            from auvid_cli.filters.output_error import run_output_error

            stated = settings.output_error
            return partial(
                run_output_error,
                process,
                augmented.sensors,
                max_evaluations=stated.max_evaluations,
                bounds=_bounds(augmented, stated.bounds),
                use_prior=stated.use_prior,
            )
        case FilterName.CKF:
            run = partial(run_square_root_filter, cubature(n))
        case FilterName.TUKF:
            run = partial(run_square_root_filter, transformed(n))
        case FilterName.UKF:
            points = unscented(n, settings.ukf.alpha, settings.ukf.beta, settings.ukf.kappa)
            run = partial(run_square_root_filter, points)
    return partial(one_after_the_other, partial(run, process, augmented.sensors), process.noise_density.size)


def _bounds(augmented: AugmentedProblem, stated: dict[str, tuple[float, float]]) -> tuple[Array, Array]:
    """Lower and upper bounds of the scaled joint state, of which coefficients may have some."""
    lower, upper = np.full(augmented.prior.mean.size, -np.inf), np.full(augmented.prior.mean.size, np.inf)
    for symbol, limits in stated.items():
        place = augmented.layout.row(symbol)
        lower[place], upper[place] = np.array(limits) / augmented.layout.scale[place]
    return lower, upper
