"""Dataset -> Estimate by the estimator that is asked for."""

from collections.abc import Callable, Iterable, Iterator, Sequence

from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate, EstimateHeader
from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.augmented import augmented_problem
from auvid_cli.identification.choice import chosen_estimator
from auvid_cli.identification.filter_run import FilterRun
from auvid_cli.identification.prepared_data import PreparedData, prepare


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


def with_noise_settled(prepared: PreparedData) -> PreparedData:
    """Return data with settings that state what is found before all else.

    That are the noise, where it is to be estimated, as the data make it most likely, and delays that are sought; these
    first, for what comes at the wrong time passes for noise, and then once more.

    Raises
    ------
    ConfigError, DataError
        As `auvid_cli.identification.noise_tuning.tune_noise` and `auvid_cli.identification.delays.settle_delays`.
    """
    settings = prepared.experiment.identification
    if settings.seeks_delays:
        from auvid_cli.identification.delays import settle_delays

        prepared = settle_delays(prepared)
        return settle_delays(_with_noise_found(prepared)) if settings.noise == "estimate" else prepared
    return _with_noise_found(prepared)


def _with_noise_found(prepared: PreparedData) -> PreparedData:
    if prepared.experiment.identification.noise == "stated":
        return prepared
    # It has compiled code that nothing else needs.
    from auvid_cli.identification.noise_tuning import tune_noise

    return prepared.with_settings(tune_noise(prepared).experiment)


def identify(dataset: Dataset, filter_name: FilterName) -> Estimate:
    """Estimate coefficients and motion from a dataset, all in memory; see `set_up_filters` and `FilterRun`."""
    (run,), chunks = set_up_filters(with_noise_settled(prepare(dataset)), [filter_name]), []
    outcome = run.run(chunks.append)
    return Estimate.of(run.header, chunks, outcome)
