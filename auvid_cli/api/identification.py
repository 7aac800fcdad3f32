"""Identification with one filter, or with several in parallel."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import NamedTuple

from auvid_cli.api import Advance, Destination, Progress
from auvid_cli.api.files import DataSource, RecordedData, checked, refuse_to_replace
from auvid_cli.arrays import trim_heap
from auvid_cli.config.enums import JUDGE, FilterName, named
from auvid_cli.config.extra_states import BiasName
from auvid_cli.config.sanity import sanity_warnings
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate, EstimateChunk
from auvid_cli.data.estimate_file import add_considered, record_estimate
from auvid_cli.data.files import check_no_overlap, estimates_in, locked, products, remove
from auvid_cli.data.results import other_estimates, put_copy, read_simulated, refuse_unless
from auvid_cli.evaluation.judgement import Judgement, judge, with_considered_errors
from auvid_cli.identification import run as filters
from auvid_cli.identification.prepared_data import PreparedData, prepare
from auvid_cli.identification.run import FilterRun, resolve_settings, set_up_filters
from auvid_cli.inspection.inspect import contradictions_of_unused


@checked
def identify(dataset: Dataset, filter_name: str, file: str | Path | None = None) -> Estimate:
    """Estimate coefficients and motion from a dataset with its settings. The truth is not used.

    Parameters
    ----------
    dataset : Dataset
    filter_name : str
        ``"ekf"``, ``"ckf"``, ``"tukf"``, ``"ukf"``, ``"smoother"`` or ``"output_error"``.
    file : str or pathlib.Path, optional
        File to write while the filter runs, for hours of data; an existing file is replaced. The result is then the
        estimate that `read_estimate` returns.

    Returns
    -------
    Estimate
        Mean and standard deviation of the augmented state, shape (events, states), SI. After a divergence it ends
        early, and ``status`` gives the reason.

    Raises
    ------
    ConfigError
        If the filter is unknown, or the settings are invalid for it.
    DataError
        If no sensor is usable, or the inputs end too early.
    FileError
        If writing fails, or the file is the dataset itself.

    Examples
    --------
    >>> estimate = auvid.identify(dataset, "tukf")
    >>> estimate.status, round(estimate.final_coefficients()["X_u|u|"])
    ('completed', -5)
    """
    name = named(FilterName, filter_name, "filter")
    if file is None:
        return filters.identify(dataset, name)
    refuse_to_replace(dataset, Path(file))
    (run,) = filters.set_up_filters(resolve_settings(prepare(dataset)), [name])
    return record_estimate(Path(file), run.header, run.run)


class _StoppedError(Exception):
    """A filter was stopped because another one failed, or the user interrupted."""


@contextmanager
def stoppable_threads(n_threads: int) -> Iterator[tuple[ThreadPoolExecutor, Callable[[], None]]]:
    """Start threads for filters.

    Yields
    ------
    threads : ThreadPoolExecutor
    before_each : callable
        For `set_up_filters`: after an error or an interrupt in the block, filters stop at their next chunk.
    """
    stopping = Event()

    def raise_if_stopping() -> None:
        if stopping.is_set():
            raise _StoppedError

    with ThreadPoolExecutor(n_threads) as threads:
        try:
            yield threads, raise_if_stopping
        finally:
            stopping.set()


def _record_in_parallel(
    prepared: PreparedData,
    paths: Mapping[FilterName, Path],
    progress: Progress,
    on_estimate: Callable[[Estimate], None],
) -> list[Estimate]:
    """Run filters, one thread per filter, and write their estimates into files; if one fails, all end."""

    def record(filter_run: FilterRun, path: Path, advance: Advance) -> Estimate:
        begin, end = filter_run.span

        def update_bar(chunk: EstimateChunk) -> None:
            if chunk.time.size:
                advance(chunk.time[-1] - begin, end - begin)

        return record_estimate(path, filter_run.header, filter_run.run, update_bar)

    labels = (name.value for name in paths)
    with stoppable_threads(len(paths)) as (threads, raise_if_stopping):
        with progress.compiling():
            runs = set_up_filters(prepared, [*paths], raise_if_stopping)
        with progress.bars(*labels, unit=" s of data") as bars:
            futures = [threads.submit(record, *job) for job in zip(runs, paths.values(), bars, strict=True)]
            for future in as_completed(futures):
                on_estimate(future.result())
    return [future.result() for future in futures]


def estimate_delays_and_noise(prepared: PreparedData, progress: Progress) -> PreparedData:
    """Estimate the delays and the noise by maximum likelihood if the settings ask for it; return the changed data."""
    settings = prepared.experiment.identification
    wanted = ("delays", settings.estimates_delays), ("noise", settings.noise != "stated")
    names = [name for name, is_wanted in wanted if is_wanted]
    if not names:
        return prepared
    with progress.compiling():
        # Few datasets need it, and nothing should be compiled while the noise is sought.
        import auvid_cli.identification.sensors  # noqa: F401
    with progress.stage(f"estimate the {' and the '.join(names)}"):
        found = resolve_settings(prepared)
    if found.delays is not None:
        values = zip(found.delays.symbols, found.delays.value, found.delays.deviation, strict=True)
        texts = (f"{symbol} {1e3 * value:.1f} ± {1e3 * deviation:.1f} ms" for symbol, value, deviation in values)
        progress.message(f"estimated delays: {', '.join(texts)}")
    if settings.noise == "stated":
        return found
    given, tuned = (data.experiment.identification.process_noise.model_dump() for data in (prepared, found))
    densities = ", ".join(
        f"{name} {_triple(density if isinstance(density, tuple) else (density,))}"
        for name, density in tuned.items()
        if density != given[name]
    )
    progress.message(f"estimated process noise, SI: {densities}")
    estimate = found.experiment.identification.estimate
    if BiasName.DISTURBANCE in estimate.biases:
        levels = ", ".join(
            f"{name} {_triple(axes.standard_deviation)}, time constant {_triple(axes.time_constant)} s"
            for name, axes in (("force", estimate.disturbance.force), ("moment", estimate.disturbance.moment))
            if any(axes.standard_deviation)
        )
        progress.message(f"estimated disturbance, SI: {levels}")
    return found


def _triple(values: Iterable[float]) -> str:
    return " ".join(f"{value:.3g}" for value in values)


def identify_into(
    folder: Path,
    prepared: PreparedData,
    filters: Iterable[FilterName],
    overwrite: bool,
    progress: Progress,
    on_estimate: Callable[[Estimate], None] = lambda estimate: None,
) -> list[Estimate]:
    """Run filters on a dataset in parallel, and write their estimates.

    Parameters
    ----------
    folder : pathlib.Path
        Results folder.
    overwrite : bool
        Whether estimates of other data or settings are replaced, with all files derived from them.
    on_estimate : callable
        Called with each written estimate.
    """
    names = list(dict.fromkeys(filters))
    others = other_estimates(folder, prepared.experiment, prepared.dataset.sha256, names)
    refuse_unless(overwrite, next(iter(others.values()), ""))
    for name in prepared.experiment.identification.estimate.without_effect():
        progress.message(
            f"note: identification.estimate.{name} has no effect: {name} is not in identification.estimate.biases"
        )
    paths = {name: folder / "estimates" / f"{name.value}.h5" for name in names}
    recorded = _record_in_parallel(prepared, paths, progress, on_estimate)
    trim_heap()
    estimates = with_considered_errors(recorded)
    for path, before, after in zip(paths.values(), recorded, estimates, strict=True):
        if after is not before:
            add_considered(path, after)
    if others:
        kept = {*paths.values(), *(path for path in estimates_in(folder).values() if path not in others)}
        remove(path for path in products(folder) if path not in kept)
    for path, estimate in zip(paths.values(), estimates, strict=True):
        note = f"; {estimate.note}" if estimate.note else ""
        progress.message(f"{path}: {estimate.status}{note}; {estimate.cpu_time:.2f} s of processor time")
    return estimates


class IdentifiedData(NamedTuple):
    """Estimates with their judgements by filter, failed comparisons of unused sensors with used ones, and files."""

    estimates: list[Estimate]
    judgements: dict[str, Judgement]
    contradictions: list[Check]
    folder: Path
    files: list[Path]


def identify_data_into(place: Destination, source: DataSource, filters: Sequence[FilterName] | None) -> IdentifiedData:
    """Run filters on a dataset, write the estimates into its results folder, and judge them.

    Parameters
    ----------
    source : DataSource
        An experiment must have been simulated into the folder.
    filters : sequence of FilterName or None
        None: ``identification.filters``. The smoother runs as well, because it judges the others.
    """
    folder, progress = place.folder or source.folder, place.progress
    is_recorded = isinstance(source, RecordedData)
    dataset = source.dataset if is_recorded else read_simulated(folder, source.experiment)
    with locked(folder):
        check_no_overlap(products(folder), source.files)
        if is_recorded:
            put_copy(source.path, dataset, folder, source.files, place.overwrite)
        settings, vehicle = dataset.experiment.identification, dataset.experiment.vehicle
        chosen = settings.with_judge(filters or settings.default_filters())
        if filters and len(chosen) > len(set(filters)):
            progress.message(
                f"{JUDGE.value} runs as well, because it judges the others; --set identification.judge=false omits it"
            )
        for warning in sanity_warnings(vehicle):
            progress.message(f"note: vehicle {vehicle.name}: {warning}")
        prepared = estimate_delays_and_noise(prepare(dataset), progress)
        estimates = identify_into(folder, prepared, chosen, place.overwrite, progress)
        paths = [folder / "estimates" / f"{name.value}.h5" for name in chosen]
        return IdentifiedData(estimates, judge(estimates), contradictions_of_unused(dataset), folder, paths)
