"""Run filters on a dataset: choose estimators by the settings, set them up, and record their estimates in SI."""

from collections.abc import Callable, Iterable, Iterator, Reversible, Sequence
from dataclasses import dataclass
from time import perf_counter, thread_time
from typing import assert_never

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.enums import FilterName
from auvid_cli.config.identification import Identification
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.data.estimate import Estimate, EstimateChunk, EstimateHeader, Outcome
from auvid_cli.data.faults import Fault, FaultKind
from auvid_cli.data.innovations import Innovations, InnovationStatistics
from auvid_cli.filters import problem
from auvid_cli.filters.estimators import (
    Estimator,
    ExtendedKalmanFilter,
    IteratedSmoother,
    OutputErrorMethod,
    SigmaPointFilter,
)
from auvid_cli.filters.problem import FilterOutcome, Gaussian, Records, Timeline, segment_gaussian
from auvid_cli.filters.workspace import cubature, transformed, unscented
from auvid_cli.identification.prepared_data import FoundDelays, PreparedData, prepare
from auvid_cli.identification.problem_setup import AugmentedProblem, Motion, augmented_problem
from auvid_cli.identification.process import first_order_transition
from auvid_cli.vehicle.parameters import SENSORS

# Largest number of parameters that the status of a run without convergence names.
_MAX_NAMED = 4
# Smallest step of a parameter that is named, in standard deviations.
_MIN_STEP = 0.1


def chosen_estimator(
    name: FilterName, augmented: AugmentedProblem, settings: Identification, start: Motion | None = None
) -> Estimator:
    """Return an estimator for a problem; the smoother starts from a motion if one is given."""
    n, process, sensors = len(augmented.layout.symbols), augmented.process, augmented.sensors
    match name:
        case FilterName.EKF:
            if settings.ekf.transition == "first_order":
                process = process._replace(transition=first_order_transition)
            return ExtendedKalmanFilter(name.value, process, sensors)
        case FilterName.CKF:
            return SigmaPointFilter(name.value, process, sensors, cubature(n))
        case FilterName.TUKF:
            return SigmaPointFilter(name.value, process, sensors, transformed(n))
        case FilterName.UKF:
            points = unscented(n, settings.ukf.alpha, settings.ukf.beta, settings.ukf.kappa)
            return SigmaPointFilter(name.value, process, sensors, points)
        case FilterName.SMOOTHER:
            # Imported here because only the smoother needs this compiled code.
            from auvid_cli.identification.fault_effects import VehicleFaults

            if settings.is_marginal:
                import auvid_cli.filters.marginal  # noqa: F401  # Compiled here, and not while filters run.
            delays = [block.name for block in settings.estimate.blocks() if block.is_delay]
            faults, max_passes = VehicleFaults(augmented, delays), settings.smoother.max_passes
            trajectory = None if start is None else start.trajectory(augmented)
            return IteratedSmoother(name.value, process, sensors, max_passes, faults, settings.is_marginal, trajectory)
        case FilterName.OUTPUT_ERROR:
            method, layout = settings.output_error, augmented.layout
            lower, upper = (np.full(augmented.prior.mean.size, limit) for limit in (-np.inf, np.inf))
            for symbol, limits in method.bounds.items():
                (row,) = layout.rows([symbol])
                lower[row], upper[row] = np.array(limits) / layout.scale[row]
            bounds = lower, upper
            return OutputErrorMethod(name.value, process, sensors, method.max_evaluations, bounds, method.use_prior)
        case _:
            assert_never(name)


@dataclass(frozen=True)
class FilterRun:
    """An estimator set up on a dataset, ready to run."""

    header: EstimateHeader
    span: tuple[float, float]  # first and last time of the data, s
    estimator: Estimator  # in scaled units: coefficients as multiples of their prior standard deviations
    segments: Sequence[Reversible[Timeline]]
    prior: Gaussian  # prior of the joint state of the segments
    scale: Array  # shape (n,); SI value of one unit of each component of the state
    measuring: dict[str, SensorRecord]  # by name, in the order of the estimator's sensors
    # Estimated delays. They are not part of the state; their uncertainty is added to the estimate here.
    delays: FoundDelays | None = None

    def run(self, on_chunk: Callable[[EstimateChunk], None]) -> Outcome:
        """Run the estimator.

        Parameters
        ----------
        on_chunk : callable
            Called with each chunk of the estimate. It has every ``identification.keep_every``-th state, the last valid
            state, and all innovations.

        Returns
        -------
        Outcome
            Its status has the reason if the estimator diverged.
        """
        progress = _Progress(self, on_chunk)
        progress.clocks -= _clocks()
        outcome = self.estimator.estimate(self.segments, self.prior, progress.add)
        progress.clocks += _clocks()
        progress.finish()
        covariance = outcome.covariance * np.outer(self.scale, self.scale)
        corrected = outcome.corrected * self.scale[: outcome.corrected.size]
        if self.delays is not None:
            covariance = self.delays.joint(covariance)
            corrected = self.delays.widened(corrected)
        tests, considered, explained = (), None, dict[str, InnovationStatistics]()
        if outcome.faults is not None or outcome.others:
            from auvid_cli.identification.fault_effects import fault_tests, sizes_within_tolerances

            tests, considered = fault_tests(outcome, self.header, self.scale, progress.whole_faults)
            if outcome.faults is not None and outcome.without_faults is not None:
                whole, n = progress.whole_faults, progress.n_components
                sizes = sizes_within_tolerances(outcome.faults, self.header, whole, n)
                if sizes is not None:
                    explained = self._statistics(outcome.without_faults(sizes))
        return Outcome(
            self._status(outcome, progress),
            covariance,
            progress.n_valid,
            *progress.clocks.tolist(),
            faults=tests,
            considered=considered,
            explained=explained,
            note=self._note(outcome, progress),
            corrected=dict(zip(self.header.state, corrected.tolist(), strict=False)),
        )

    def chunk(
        self, rows: tuple[Array, Array, Array], innovations: dict[str, Innovations], kept: slice = slice(None)
    ) -> EstimateChunk:
        """Return a chunk in SI from time, mean and standard deviation in scaled units, and innovations."""
        time, mean, deviation = (row[kept] for row in rows)
        states = mean * self.scale, deviation * self.scale
        return EstimateChunk(time, *(states if self.delays is None else self.delays.along(*states)), innovations)

    def by_sensor(self, timeline: Timeline, records: Records) -> dict[str, Innovations]:
        """Return the innovations of each sensor in a chunk of the data."""
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

    def _statistics(self, chunks: Iterable[tuple[Timeline, Records]]) -> dict[str, InnovationStatistics]:
        """Return the statistics of the innovations of each sensor."""
        found = dict[str, InnovationStatistics]()
        for timeline, records in chunks:
            for name, innovations in self.by_sensor(timeline, records).items():
                if innovations.time.size:
                    statistics = innovations.statistics(found[name].sums.start if name in found else None)
                    found[name] = found[name].plus(statistics) if name in found else statistics
        return found

    def _status(self, outcome: FilterOutcome, progress: "_Progress") -> str:
        names, diverged = tuple(self.measuring), f"diverged at t = {progress.reached:.3f} s"
        match outcome.failure:
            case problem.OK:
                return "completed"
            case problem.NOT_CONVERGED:
                limit = f"did not converge within identification.{self.estimator.limit}; result discarded"
                return f"unconverged: {limit} ({self._distance_from_convergence(outcome, progress)})"
            case problem.PREDICTION if self.estimator.in_one_batch:
                return f"{diverged}: no motion of any fit reaches the end of the data"
            case problem.PREDICTION:
                why = (
                    f"state and covariance could not be propagated to this time after a measurement of "
                    f"{names[progress.sensor]}"
                )
            case sensor:
                why = f"the state was not finite after a measurement of {names[sensor]}"
        deviation = np.sqrt(np.diagonal(outcome.covariance))
        # Scaled to unit rows, because the units of the states would dominate.
        condition = np.sqrt(np.linalg.cond(outcome.covariance / np.outer(deviation, deviation)))
        last = f"last innovation {progress.last_innovation:.3g} sigma"
        return f"{diverged}: {why} ({last}, condition of the factor {condition:.2g})"

    def _note(self, outcome: FilterOutcome, progress: "_Progress") -> str:
        """Return that an iteration ended before its last steps, which no longer matter; empty if it did not."""
        if outcome.failure != problem.OK or outcome.convergence is None:
            return ""
        return f"ended where the rest no longer matters ({self._distance_from_convergence(outcome, progress)})"

    def _distance_from_convergence(self, outcome: FilterOutcome, progress: "_Progress") -> str:
        convergence = outcome.convergence
        assert convergence is not None, "an estimator that did not converge reports how far it is from convergence"
        steps = np.abs(np.nan_to_num(convergence.step))
        largest = [row for row in np.argsort(-steps)[:_MAX_NAMED] if steps[row] >= _MIN_STEP]
        moving = ", ".join(f"{self.header.state[row]} by {steps[row]:.2g}" for row in largest)
        parts = [
            f"NIS {progress.mean_nis:.3g}",
            f"predicted decrease of the cost {convergence.cost_decrease:.2g}",
            f"the next step moves {moving} standard deviations"
            if moving
            else f"the next step moves no parameter by {_MIN_STEP:g} standard deviations",
        ]
        if convergence.fraction < 1.0:
            parts.insert(0, f"only the first {convergence.fraction:.0%} of the data were fitted")
        return ", ".join(parts)


# Terms that are linear in speed, and the coefficients of which they may be a part.
_LINEAR = {"X_u": "X_u|u|", "M_q": "M_uql", "N_r": "N_url"}


class _Progress:
    """Progress of a run; the estimator passes its chunks to `add`.

    Attributes
    ----------
    n_valid : int
        Number of events without failure so far.
    reached : float
        Time of the next event, s.
    sensor : int
        Row of the sensor of the last measurement.
    last_innovation : float
        Size of the last innovation, in standard deviations.
    nis_sum : float
        Sum of the normalised innovations squared.
    n_components : int
        Number of components in that sum.
    speed_sum : float
        Sum of the surge speed over the valid events, m/s.
    clocks : ndarray, shape (2,)
        Processor and wall time of the estimator without that of `on_chunk`, s.
    """

    def __init__(self, run: FilterRun, on_chunk: Callable[[EstimateChunk], None]) -> None:
        self.n_valid, self.reached, self.sensor, self.last_innovation = 0, run.span[0], 0, np.nan
        self.nis_sum, self.n_components, self.speed_sum = 0.0, 0, 0.0
        self.clocks = np.zeros(2)
        self._run, self._on_chunk = run, on_chunk
        self._every = run.header.experiment.identification.keep_every
        # Before the first event the last valid state is the prior.
        prior = segment_gaussian(run.prior, np.arange(run.scale.size))
        rows = np.array([self.reached]), prior.mean[None, :], np.diag(prior.factor)[None, :]
        self._latest = run.chunk(rows, {name: _no_innovations(record) for name, record in run.measuring.items()})

    def add(self, timeline: Timeline, records: Records) -> None:
        """Pass a chunk of the data on, and note how far the filter came."""
        self.clocks += _clocks()
        valid = len(records.mean)
        rows = timeline.time[:valid], records.mean, records.standard_deviation
        kept = slice(-self.n_valid % self._every, None, self._every)
        self._on_chunk(self._run.chunk(rows, self._run.by_sensor(timeline, records), kept))
        if valid:
            self._latest = self._run.chunk(rows, self._latest.innovations, slice(valid - 1, valid))
        self.n_valid += valid
        self.speed_sum += float(np.abs(records.mean[:, self._run.header.state.index("u")]).sum())
        self.reached = float(timeline.time[min(valid, timeline.time.size - 1)])
        if measurements := timeline.measurement_offset[valid]:
            self.sensor = int(timeline.measurement_sensor[measurements - 1])
        # Measurements after a failure have no NIS.
        nis = records.nis[np.isfinite(records.nis)]
        if nis.size:
            self.last_innovation = float(np.sqrt(nis[-1]))
        self.nis_sum += float(nis.sum())
        self.n_components += int(np.isfinite(records.innovation_variance).sum())
        self.clocks -= _clocks()

    @property
    def mean_nis(self) -> float:
        """Return the normalised innovation squared per component."""
        return self.nis_sum / max(self.n_components, 1)

    @property
    def whole_faults(self) -> dict[Fault, float]:
        """Return sizes of faults: damping that is all linear in speed, and no thrust, at the mean speed, SI."""
        header, speed = self._run.header, self.speed_sum / max(self.n_valid, 1)
        final = header.held | dict(zip(header.state, self._latest.mean[-1].tolist(), strict=True))
        damping = ((Fault(FaultKind.MISSING_TERM, term), symbol) for term, symbol in _LINEAR.items())
        linear = {fault: abs(final[symbol]) * speed for fault, symbol in damping}
        return linear | {Fault(FaultKind.THRUST_FADE): 1.0 / speed if speed else 0.0}

    def finish(self) -> None:
        """Pass the last valid state on, unless it was kept anyway."""
        if self.n_valid == 0 or (self.n_valid - 1) % self._every:
            self._on_chunk(self._latest)


def _clocks() -> Array:
    """Return processor time of this thread and wall time, s."""
    return np.array([thread_time(), perf_counter()])


def _no_innovations(record: SensorRecord) -> Innovations:
    nothing = np.zeros((0, record.values.shape[1]))
    return Innovations(np.zeros(0), nothing, nothing, np.zeros(0), record.standard_deviation)


class _Watched:
    """Chunks of the data with a call before each; may be iterated many times, in both directions."""

    def __init__(self, timelines: Reversible[Timeline], before_each: Callable[[], None]) -> None:
        self._timelines, self._before_each = timelines, before_each

    def __iter__(self) -> Iterator[Timeline]:
        return self._watched(iter(self._timelines))

    def __reversed__(self) -> Iterator[Timeline]:
        return self._watched(reversed(self._timelines))

    def _watched(self, timelines: Iterator[Timeline]) -> Iterator[Timeline]:
        for timeline in timelines:
            self._before_each()
            yield timeline


def set_up_filters(
    prepared: PreparedData,
    filter_names: Sequence[FilterName],
    before_each: Callable[[], None] = lambda: None,
    start: Motion | None = None,
) -> list[FilterRun]:
    """Return estimators that share a dataset's augmented state, prior and timeline; its truth is not used.

    Parameters
    ----------
    prepared : PreparedData
    filter_names : sequence of FilterName
    before_each : callable
        Called before each chunk of the data in each pass. An exception from it ends the estimator.
    start : Motion, optional
        Of a similar model, with which the smoother starts.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    """
    experiment, delays = prepared.experiment, prepared.delays
    settings = experiment.identification
    settings.check_filters(filter_names)
    augmented = augmented_problem(prepared)
    layout = augmented.layout
    delay_symbols = () if delays is None else delays.symbols
    segments = [_Watched(segment.timelines, before_each) for segment in augmented.segments]
    return [
        FilterRun(
            EstimateHeader(
                filter=name.value,
                experiment=experiment,
                state=(*layout.symbols, *delay_symbols),
                unit=(*layout.units, *("s" for _ in delay_symbols)),
                held=augmented.held,
                dataset_sha256=prepared.dataset.sha256,
            ),
            augmented.span,
            chosen_estimator(name, augmented, settings, start),
            segments,
            augmented.prior,
            layout.scale,
            augmented.measuring,
            delays,
        )
        for name in filter_names
    ]


def resolve_settings(prepared: PreparedData) -> PreparedData:
    """Return the data with settings that state the estimated delays and noise levels, where settings ask for these.

    Delays are estimated first, because a timing error looks like noise; then the noise levels; then the delays again.

    Raises
    ------
    ConfigError, DataError
        As `auvid_cli.identification.noise.tune_noise` and `auvid_cli.identification.delays.estimate_delays`.
    """
    settings = prepared.experiment.identification
    if not settings.estimates_delays:
        return _with_tuned_noise(prepared)
    # Imported here, as in `_with_tuned_noise`, because few runs need this compiled code.
    from auvid_cli.identification.delays import estimate_delays

    prepared = estimate_delays(prepared)
    return prepared if settings.noise == "stated" else estimate_delays(_with_tuned_noise(prepared))


def _with_tuned_noise(prepared: PreparedData) -> PreparedData:
    if prepared.experiment.identification.noise == "stated":
        return prepared
    from auvid_cli.identification.noise import tune_noise

    return prepared.with_settings(tune_noise(prepared)[0].experiment)


def identify(
    dataset: Dataset,
    filter_name: FilterName,
    start: Motion | None = None,
    before_each: Callable[[], None] = lambda: None,
) -> Estimate:
    """Estimate coefficients and motion from a dataset in memory; see `set_up_filters` and `FilterRun`."""
    (run,), chunks = set_up_filters(resolve_settings(prepare(dataset)), [filter_name], before_each, start), []
    outcome = run.run(chunks.append)
    return Estimate.of(run.header, chunks, outcome)
