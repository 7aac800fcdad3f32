"""Dataset -> Estimate by the estimator that is asked for."""

from collections.abc import Callable, Iterable, Iterator, Sequence

from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate, EstimateHeader
from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.augmented import augmented_problem
from auvid_cli.identification.choice import chosen_estimator
from auvid_cli.identification.filter_run import FilterRun


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
    """Set up estimators that share a dataset's augmented state, prior and timeline; no truth is looked at.

    Parameters
    ----------
    dataset : Dataset
    filter_names : sequence of FilterName
    before_each : callable
        Called whenever an estimator asks for the next part of the data, of which a fit asks many times. What it raises
        ends that estimator.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    """
    settings = dataset.experiment.identification
    settings.check_filters(filter_names)
    augmented = augmented_problem(dataset)
    layout = augmented.layout
    stretches = [_Watched(stretch.timelines, before_each) for stretch in augmented.stretches]
    return [
        FilterRun(
            EstimateHeader(
                filter=name.value,
                experiment=dataset.experiment,
                state=layout.symbols,
                unit=layout.units,
                held=augmented.held,
                dataset_sha256=dataset.sha256,
            ),
            augmented.span,
            chosen_estimator(name, augmented, settings),
            stretches,
            augmented.prior,
            layout.scale,
            augmented.measuring,
        )
        for name in filter_names
    ]


def identify(dataset: Dataset, filter_name: FilterName) -> Estimate:
    """Estimate coefficients and motion from a dataset, all in memory; see `set_up_filters` and `FilterRun`."""
    (run,), parts = set_up_filters(dataset, [filter_name]), []
    outcome = run.run(parts.append)
    return Estimate.of(run.header, parts, outcome)
