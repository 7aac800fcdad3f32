"""Dataset -> Estimate: the augmented state, its prior, and the filter that is asked for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter, thread_time

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Experiment, Identification
from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.dataset import SENSORS, Dataset, SensorRecord
from auvid_cli.data.estimate import Estimate, EstimateHeader, EstimatePart, Innovations, Outcome
from auvid_cli.errors import ConfigError
from auvid_cli.filters import problem
from auvid_cli.filters.point_sets import cubature, transformed, unscented
from auvid_cli.filters.problem import Belief, Ending, Receiver, Records, Timeline
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.identification.biases import constant_errors, sensor_errors, walking_errors
from auvid_cli.identification.prior import earlier_belief, prior_standard_deviations
from auvid_cli.identification.process import vehicle_process
from auvid_cli.identification.timeline import (
    Timelines,
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
            if len(records.nis):
                sigmas = float(np.sqrt(records.nis[-1]))
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
        deviation = np.sqrt(np.diagonal(ending.covariance))
        # Of the factor scaled to unit rows: what its own units do to it says nothing.
        condition = np.sqrt(np.linalg.cond(ending.covariance / np.outer(deviation, deviation)))
        detail = f" (last innovation {sigmas:.3g} sigma, condition of the factor {condition:.2g})"
        match ending.culprit:
            case problem.OK:
                return "completed"
            case problem.PREDICTION:
                return (
                    f"diverged at t = {time:.3f} s: after a reading of {names[heard]} the state or its covariance "
                    f"could not be propagated to this time{detail}"
                )
            case sensor:
                return (
                    f"diverged at t = {time:.3f} s: the state was not finite after a reading of {names[sensor]}{detail}"
                )


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

    errors = sensor_errors(settings.estimate)
    constant, walking = constant_errors(errors), walking_errors(errors)
    units = {c.symbol: c.unit for c in COEFFICIENTS}
    blocks = [(symbol, units[symbol]) for symbol in estimated]
    blocks += [(error.symbol, error.unit) for error in constant]
    blocks += [(quantity.symbol, quantity.unit) for quantity in MOTION]
    blocks += [(error.symbol, error.unit) for error in walking]
    state, unit = zip(*blocks, strict=True)

    measuring = measuring_sensors(dataset)
    sensors = measurement_model(measuring, state, errors, np.inf if settings.gate is None else settings.gate)
    start, motion = initial_motion(dataset, measuring)
    data = Timelines(dataset, measuring, start, settings.integration_step)
    process = vehicle_process(
        vehicle_constants(experiment.vehicle.known_parameters()),
        np.array([held.get(symbol, 0.0) for symbol in SYMBOLS]),
        selection,
        scale,
        settings.process_noise,
        settings.ekf.transition == "exact",
        errors,
    )
    spread = settings.initial_motion
    known, factor = np.zeros(len(estimated)), np.eye(len(estimated))
    if settings.prior.from_estimate is not None:
        known, factor = earlier_belief(Path(settings.prior.from_estimate), dataset, estimated, scale)
    prior = Belief(
        np.concatenate([known, np.zeros(len(constant)), motion, np.zeros(len(walking))]),
        np.diag(
            [
                *np.ones(len(estimated)),
                *(error.spread for error in constant),
                *np.repeat([spread.velocity, spread.rate, spread.attitude], 3),
                *(error.spread for error in walking),
            ]
        ),
    )
    prior.factor[: len(estimated), : len(estimated)] = factor
    return [
        FilterRun(
            EstimateHeader(
                filter=name.value,
                experiment=experiment,
                state=state,
                unit=unit,
                held=held,
                dataset_sha256=dataset.sha256,
            ),
            data.span,
            partial(_chosen_filter(name, settings, prior.mean.size), process, sensors, data, prior),
            prior,
            np.concatenate([scale, np.ones(len(state) - len(estimated))]),
            measuring,
        )
        for name in filter_names
    ]


def identify(dataset: Dataset, filter_name: FilterName) -> Estimate:
    """Estimate coefficients and motion from a dataset, all in memory; see `set_up_filters` and `FilterRun`."""
    (run,), parts = set_up_filters(dataset, [filter_name]), []
    outcome = run.run(parts.append)
    return Estimate.of(run.header, parts, outcome)


def _chosen_filter(name: FilterName, settings: Identification, n: int) -> Callable[..., Ending]:
    if name is FilterName.EKF:
        # filterpy is slow to load and large, and no other filter needs it.
        from auvid_cli.filters.extended import run_extended_filter

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
