"""Identify: choose the estimators by their settings and run them on prepared data."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.enums import FilterName
from auvid_cli.config.identification import Identification
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate, EstimateHeader
from auvid_cli.filters.problem import Timeline
from auvid_cli.filters.square_root import (
    Estimator,
    ExtendedKalmanFilter,
    IteratedSmoother,
    OutputErrorMethod,
    SigmaPointFilter,
)
from auvid_cli.filters.workspace import cubature, transformed, unscented
from auvid_cli.identification.filter_run import FilterRun
from auvid_cli.identification.prepared_data import PreparedData, prepare
from auvid_cli.identification.problem_setup import AugmentedProblem, augmented_problem
from auvid_cli.identification.process import first_order_transition

Array = NDArray[np.float64]


def chosen_estimator(name: FilterName, augmented: AugmentedProblem, settings: Identification) -> Estimator:
    """Set up an estimator.

    Parameters
    ----------
    name : FilterName
    augmented : AugmentedProblem
    settings : Identification
    """
    n, problem = len(augmented.layout.symbols), (augmented.process, augmented.sensors)
    match name:
        case FilterName.EKF:
            process, sensors = problem
            if settings.ekf.transition == "first_order":
                process = process._replace(transition=first_order_transition)
            return ExtendedKalmanFilter(name.value, process, sensors)
        case FilterName.CKF:
            return SigmaPointFilter(name.value, *problem, cubature(n))
        case FilterName.TUKF:
            return SigmaPointFilter(name.value, *problem, transformed(n))
        case FilterName.UKF:
            points = unscented(n, settings.ukf.alpha, settings.ukf.beta, settings.ukf.kappa)
            return SigmaPointFilter(name.value, *problem, points)
        case FilterName.SMOOTHER:
            # What it is compiled from serves no other estimator.
            from auvid_cli.identification.fault_effects import VehicleFaults

            if settings.is_marginal:
                import auvid_cli.filters.marginal  # noqa: F401  # Compiled here, and not while filters run.
            sought = [block.name for block in settings.estimate.blocks() if block.is_delay]
            own = settings.smoother.max_passes, VehicleFaults(augmented, sought), settings.is_marginal
            return IteratedSmoother(name.value, *problem, *own)
        case FilterName.OUTPUT_ERROR:
            method = settings.output_error
            bounds = _bounds(augmented, method.bounds)
            return OutputErrorMethod(name.value, *problem, method.max_evaluations, bounds, method.use_prior)
        case _:
            assert_never(name)


def _bounds(augmented: AugmentedProblem, intervals: dict[str, tuple[float, float]]) -> tuple[Array, Array]:
    """Return lower and upper bounds of the scaled joint state, of which coefficients may have some."""
    lower, upper = np.full(augmented.prior.mean.size, -np.inf), np.full(augmented.prior.mean.size, np.inf)
    for symbol, limits in intervals.items():
        (place,) = augmented.layout.rows([symbol])
        lower[place], upper[place] = np.array(limits) / augmented.layout.scale[place]
    return lower, upper


class _Watched:
    """Chunks of the data, with something to be done before each is handed out."""

    def __init__(self, timelines: Iterable[Timeline], before_each: Callable[[], None]) -> None:
        self._timelines, self._before_each = timelines, before_each

    def __iter__(self) -> Iterator[Timeline]:
        for timeline in self._timelines:
            self._before_each()
            yield timeline


def set_up_filters(
    prepared: PreparedData, filter_names: Sequence[FilterName], before_each: Callable[[], None] = lambda: None
) -> list[FilterRun]:
    """Set up estimators that share a dataset's augmented state, prior and timeline; no truth is looked at.

    Parameters
    ----------
    prepared : PreparedData
    filter_names : sequence of FilterName
    before_each : callable
        Called whenever an estimator asks for the next chunk of the data, of which a fit asks many times. What it raises
        ends that estimator.

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
    beside = () if delays is None else delays.symbols
    segments = [_Watched(segment.timelines, before_each) for segment in augmented.segments]
    return [
        FilterRun(
            EstimateHeader(
                filter=name.value,
                experiment=experiment,
                state=(*layout.symbols, *beside),
                unit=(*layout.units, *("s" for _ in beside)),
                held=augmented.held,
                dataset_sha256=prepared.dataset.sha256,
            ),
            augmented.span,
            chosen_estimator(name, augmented, settings),
            segments,
            augmented.prior,
            layout.scale,
            augmented.measuring,
            delays,
        )
        for name in filter_names
    ]


def resolve_settings(prepared: PreparedData) -> PreparedData:
    """Return data with settings that state what is found before all else.

    That are the noise, where it is to be estimated, as the data make it most likely, and delays that are sought; these
    first, for what comes at the wrong time passes for noise, and then once more.

    Raises
    ------
    ConfigError, DataError
        As `auvid_cli.identification.noise.tune_noise` and `auvid_cli.identification.delays.estimate_delays`.
    """
    settings = prepared.experiment.identification
    if settings.estimates_delays:
        from auvid_cli.identification.delays import estimate_delays

        prepared = estimate_delays(prepared)
        return estimate_delays(_with_noise_found(prepared)) if settings.noise == "estimate" else prepared
    return _with_noise_found(prepared)


def _with_noise_found(prepared: PreparedData) -> PreparedData:
    if prepared.experiment.identification.noise == "stated":
        return prepared
    # It has compiled code that nothing else needs.
    from auvid_cli.identification.noise import tune_noise

    return prepared.with_settings(tune_noise(prepared).experiment)


def identify(dataset: Dataset, filter_name: FilterName) -> Estimate:
    """Estimate coefficients and motion from a dataset, all in memory; see `set_up_filters` and `FilterRun`."""
    (run,), chunks = set_up_filters(resolve_settings(prepare(dataset)), [filter_name]), []
    outcome = run.run(chunks.append)
    return Estimate.of(run.header, chunks, outcome)
