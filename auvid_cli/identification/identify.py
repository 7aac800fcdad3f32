"""Dataset -> Estimate: the augmented state, its prior, and the filter that is asked for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from time import perf_counter, thread_time

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Experiment, Identification
from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.dataset import SENSORS, Dataset, SensorRecord
from auvid_cli.data.estimate import Estimate, EstimateHeader, EstimatePart, Innovations, Outcome
from auvid_cli.errors import ConfigError
from auvid_cli.filters.extended import run_extended_filter
from auvid_cli.filters.point_sets import cubature, transformed, unscented
from auvid_cli.filters.problem import OK, PREDICTION, Belief, Ending, Receiver, Records, Timeline
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.identification.prior import prior_standard_deviations
from auvid_cli.identification.process import vehicle_process
from auvid_cli.identification.timeline import (
    build_timeline,
    initial_motion,
    measurement_model,
    measuring_sensors,
)
from auvid_cli.vehicle.coefficients import COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.dynamics import vehicle_constants
from auvid_cli.vehicle.parameters import MOTION

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FilterRun:
    """A filter set up on a dataset, ready to run.

    Attributes
    ----------
    header : EstimateHeader
    n_events : int
    filter : callable
        Runs it in scaled units: coefficients as multiples of their priors.
    """

    header: EstimateHeader
    n_events: int
    filter: Callable[[Receiver], Ending]
    _timeline: Timeline
    _prior: Belief
    _to_si: Array
    _measuring: dict[str, SensorRecord]

    def run(self, receive: Callable[[EstimatePart, int], None]) -> Outcome:
        """Filter the dataset.

        Parameters
        ----------
        receive : callable
            Told every part as it comes, and how many events are done. Of the states every
            ``identification.keep_every``-th is handed over, and the last; of the innovations all.

        Returns
        -------
        Outcome
            Of a filter that diverged: with the reason as its status.
        """
        timeline, every = self._timeline, self.header.experiment.identification.keep_every
        # Time of the filter alone, without that of whoever receives.
        filtering = np.zeros(2)

        def pass_on(start: int, records: Records) -> None:
            filtering[:] += _clocks()
            stop = start + len(records.mean)
            kept = np.arange(start, stop)
            kept = kept[(kept % every == 0) | (kept == stop - 1) & (stop == self.n_events)]
            part = EstimatePart(
                timeline.time[kept],
                records.mean[kept - start] * self._to_si,
                records.standard_deviation[kept - start] * self._to_si,
                self._by_sensor(start, records),
            )
            receive(part, stop)
            filtering[:] -= _clocks()

        filtering -= _clocks()
        ending = self.filter(pass_on)
        cpu_time, wall_time = (filtering + _clocks()).tolist()
        if ending.n_good == 0:
            # Failed at once: the last good state is the prior.
            mean, deviation = self._prior.mean * self._to_si, np.diag(self._prior.factor) * self._to_si
            none = {name: _no_innovations(record) for name, record in self._measuring.items()}
            receive(EstimatePart(timeline.time[:1], mean[None, :], deviation[None, :], none), 0)
        covariance = ending.covariance * np.outer(self._to_si, self._to_si)
        return Outcome(self._status(ending), covariance, ending.n_good, cpu_time, wall_time)

    def _by_sensor(self, start: int, records: Records) -> dict[str, Innovations]:
        timeline = self._timeline
        rows = slice(first := timeline.reading_offset[start], first + len(records.nis))
        time = timeline.time[np.searchsorted(timeline.reading_offset, np.arange(rows.start, rows.stop), "right") - 1]
        by_sensor = {}
        for sensor, (name, record) in enumerate(self._measuring.items()):
            own = (timeline.reading_sensor[rows] == sensor) & ~np.isnan(records.nis)
            width = len(SENSORS[name])
            by_sensor[name] = Innovations(
                time[own],
                records.innovation[own, :width],
                records.innovation_variance[own, :width],
                records.nis[own],
                record.standard_deviation,
            )
        return by_sensor

    def _status(self, ending: Ending) -> str:
        if ending.culprit == OK:
            return "completed"
        names, event = tuple(self._measuring), min(ending.n_good, self.n_events - 1)
        time = self._timeline.time[event]
        if ending.culprit == PREDICTION:
            last = self._timeline.reading_offset[event] - 1
            sensor = names[self._timeline.reading_sensor[max(last, 0)]]
            return (
                f"diverged at t = {time:.3f} s: after a reading of {sensor} the state or its covariance could not be "
                "propagated to this time"
            )
        return f"diverged at t = {time:.3f} s: the state was not finite after a reading of {names[ending.culprit]}"


def _clocks() -> Array:
    """Processor time of this thread and wall time, s."""
    return np.array([thread_time(), perf_counter()])


def _no_innovations(record: SensorRecord) -> Innovations:
    nothing = np.zeros((0, record.values.shape[1]))
    return Innovations(np.zeros(0), nothing, nothing, np.zeros(0), record.standard_deviation)


def set_up_filters(dataset: Dataset, filter_names: Sequence[FilterName]) -> list[FilterRun]:
    """Augmented state, prior and timeline of a dataset, and filters that share them; no truth is looked at.

    Raises
    ------
    ConfigError
        If a coefficient that is to be held has no value.
    DataError
        If no sensor measures motion.
    """
    experiment = dataset.experiment
    settings = experiment.identification
    estimated = settings.estimated()
    selection = np.array([SYMBOLS.index(symbol) for symbol in estimated])
    held = held_coefficients(experiment)
    priors = prior_standard_deviations(
        experiment.vehicle.size, settings.prior.factor, settings.prior.standard_deviation
    )
    scale = np.array([priors[symbol] for symbol in estimated])

    measuring = measuring_sensors(dataset)
    sensors = measurement_model(measuring, len(estimated))
    start, motion = initial_motion(dataset, measuring)
    timeline = build_timeline(dataset, measuring, start, settings.integration_step)
    process = vehicle_process(
        vehicle_constants(experiment.vehicle.known_parameters()),
        np.array([held.get(symbol, 0.0) for symbol in SYMBOLS]),
        selection,
        scale,
        settings.process_noise,
        exact=settings.ekf.transition == "exact",
    )
    spread = settings.initial_motion
    prior = Belief(
        np.concatenate([np.zeros(len(estimated)), motion]),
        np.diag([*np.ones(len(estimated)), *np.repeat([spread.velocity, spread.rate, spread.attitude], 3)]),
    )
    units = {c.symbol: c.unit for c in COEFFICIENTS}
    return [
        FilterRun(
            EstimateHeader(
                filter=name.value,
                experiment=experiment,
                state=(*estimated, *(quantity.symbol for quantity in MOTION)),
                unit=(*(units[symbol] for symbol in estimated), *(quantity.unit for quantity in MOTION)),
                held=held,
                dataset_sha256=dataset.sha256,
            ),
            timeline.time.size,
            partial(_chosen_filter(name, settings, prior.mean.size), process, sensors, timeline, prior),
            timeline,
            prior,
            np.concatenate([scale, np.ones(len(MOTION))]),
            measuring,
        )
        for name in filter_names
    ]


def identify(dataset: Dataset, filter_name: FilterName) -> Estimate:
    """Estimate coefficients and motion from a dataset, all in memory; see `set_up_filters` and `FilterRun`."""
    (run,), parts = set_up_filters(dataset, [filter_name]), []
    outcome = run.run(lambda part, done: parts.append(part))
    return Estimate.of(run.header, parts, outcome)


def _chosen_filter(name: FilterName, settings: Identification, n: int) -> Callable[..., Ending]:
    if name is FilterName.EKF:
        return run_extended_filter
    match name:
        case FilterName.CKF:
            point_set = cubature(n)
        case FilterName.TUKF:
            point_set = transformed(n)
        case FilterName.UKF:
            point_set = unscented(n, settings.ukf.alpha, settings.ukf.beta, settings.ukf.kappa)
    return partial(run_square_root_filter, point_set)


def held_coefficients(experiment: Experiment) -> dict[str, float]:
    """Values, SI, of the coefficients that are not estimated.

    Raises
    ------
    ConfigError
        If the vehicle states none for one of them.
    """
    estimated = experiment.identification.estimated()
    given = experiment.vehicle.coefficients.by_symbol()
    missing = [symbol for symbol in SYMBOLS if symbol not in estimated and symbol not in given]
    if missing:
        raise ConfigError(
            f"identification.coefficients leaves out {', '.join(missing)}, so the vehicle file must state "
            "a value at which to hold each of them"
        )
    return {symbol: given[symbol] for symbol in SYMBOLS if symbol not in estimated}
