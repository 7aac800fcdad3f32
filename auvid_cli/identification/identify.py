"""Dataset -> Estimate: the augmented state, its prior, and the filter that is asked for."""

from collections.abc import Callable
from functools import partial
from time import perf_counter, thread_time

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Experiment, Identification
from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.dataset import SENSORS, Dataset, SensorRecord
from auvid_cli.data.estimate import Estimate, Innovations
from auvid_cli.errors import ConfigError
from auvid_cli.filters.extended import run_extended_filter
from auvid_cli.filters.point_sets import cubature, transformed, unscented
from auvid_cli.filters.problem import OK, PREDICTION, Belief, History, Timeline
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


def identify(
    dataset: Dataset,
    filter_name: FilterName,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Estimate:
    """Estimate coefficients and motion from a dataset; its truth, if any, is not looked at.

    Parameters
    ----------
    dataset : Dataset
    filter_name : FilterName
    progress : callable
        Told how many events are done, and of how many, now and then.

    Returns
    -------
    Estimate
        In SI units. A filter that diverges yields the part before, with the reason as its status.

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
    deviations = prior_standard_deviations(
        experiment.vehicle.size, settings.prior.factor, settings.prior.standard_deviation
    )
    scale = np.array([deviations[symbol] for symbol in estimated])

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

    run = _chosen_filter(filter_name, settings, prior.mean.size)
    cpu_start, wall_start = thread_time(), perf_counter()
    history = run(process, sensors, timeline, prior, progress)
    cpu_time, wall_time = thread_time() - cpu_start, perf_counter() - wall_start

    units = {c.symbol: c.unit for c in COEFFICIENTS}
    to_si = np.concatenate([scale, np.ones(len(MOTION))])
    good = history.n_good
    time, mean, deviation = timeline.time[:good], history.records.mean[:good], history.records.standard_deviation[:good]
    if good == 0:
        # Failed at once: the last good state is the prior.
        time, mean, deviation = timeline.time[:1], prior.mean[None, :], np.diag(prior.factor)[None, :]
    return Estimate(
        filter=filter_name.value,
        experiment=experiment,
        state=(*estimated, *(quantity.symbol for quantity in MOTION)),
        unit=(*(units[symbol] for symbol in estimated), *(quantity.unit for quantity in MOTION)),
        time=time,
        mean=mean * to_si,
        standard_deviation=deviation * to_si,
        covariance=history.covariance * np.outer(to_si, to_si),
        innovations=_by_sensor(history, timeline, measuring),
        held=held,
        status=_status(history, timeline, tuple(measuring)),
        cpu_time=cpu_time,
        wall_time=wall_time,
        dataset_sha256=dataset.sha256,
    )


def _chosen_filter(name: FilterName, settings: Identification, n: int) -> Callable[..., History]:
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


def _by_sensor(history: History, timeline: Timeline, measuring: dict[str, SensorRecord]) -> dict[str, Innovations]:
    event = np.repeat(np.arange(timeline.time.size), np.diff(timeline.reading_offset))
    by_sensor = {}
    for sensor, (name, record) in enumerate(measuring.items()):
        rows = (timeline.reading_sensor == sensor) & (event <= history.n_good)
        width = len(SENSORS[name])
        by_sensor[name] = Innovations(
            timeline.time[event[rows]],
            history.records.innovation[rows, :width],
            history.records.innovation_variance[rows, :width],
            history.records.nis[rows],
            record.standard_deviation,
        )
    return by_sensor


def _status(history: History, timeline: Timeline, names: tuple[str, ...]) -> str:
    if history.culprit == OK:
        return "completed"
    time = timeline.time[min(history.n_good, timeline.time.size - 1)]
    if history.culprit == PREDICTION:
        last = timeline.reading_offset[min(history.n_good, timeline.time.size - 1)] - 1
        sensor = names[timeline.reading_sensor[max(last, 0)]]
        return (
            f"diverged at t = {time:.3f} s: after a reading of {sensor} the state or its covariance could not be "
            "propagated to this time"
        )
    return f"diverged at t = {time:.3f} s: the state was not finite after a reading of {names[history.culprit]}"
