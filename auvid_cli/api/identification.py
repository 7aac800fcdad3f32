"""Identification with one filter, or with several at the same time."""

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from threading import Event
from typing import NamedTuple

import auvid_cli.identification.sensors  # noqa: F401  compiled at import, not while a filter runs
from auvid_cli.api.arguments import checked
from auvid_cli.api.files import read_dataset, refuse_to_replace
from auvid_cli.api.output import Advance, Progress
from auvid_cli.config.enums import FilterName, named
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.extra_states import BiasName
from auvid_cli.config.sanity import sanity_warnings
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate, EstimateChunk
from auvid_cli.data.estimate_file import record_estimate
from auvid_cli.data.files import (
    check_no_overlap,
    estimates_in,
    folder_of_dataset,
    folder_of_run,
    locked,
    products,
    remove,
)
from auvid_cli.data.results import other_estimates, put_copy, read_simulated, refuse_unless
from auvid_cli.evaluation.judgement import Judgement, judge
from auvid_cli.identification import run as filters
from auvid_cli.identification.prepared_data import PreparedData, prepare
from auvid_cli.identification.run import FilterRun, resolve_settings, set_up_filters
from auvid_cli.inspection.inspect import contradictions_of_unused


@checked
def identify(dataset: Dataset, filter_name: str, file: str | Path | None = None) -> Estimate:
    """Estimate coefficients and motion from a dataset, by its settings; its truth is not looked at.

    Parameters
    ----------
    dataset : Dataset
    filter_name : str
        ``"ekf"``, ``"ckf"``, ``"tukf"``, ``"ukf"``, ``"smoother"`` or ``"output_error"``.
    file : str or pathlib.Path, optional
        To write the estimate to as it is made, for hours of data; an existing file is replaced. The estimate is then
        the one that `read_estimate` reads.

    Returns
    -------
    Estimate
        Mean and standard deviation of the augmented state, shape (events, states), SI. One that diverged ends early,
        and its ``status`` says why.

    Raises
    ------
    ConfigError
        If there is no such filter, or the settings cannot be used with it.
    DataError
        If no sensor can be used, or the inputs end too early.
    FileError
        If the file cannot be written, or is the dataset itself.

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


class SideBySide:
    """Filters on the same data, each in a thread of its own; if one fails, all end.

    Parameters
    ----------
    prepared : PreparedData
    filters : sequence of FilterName

    Raises
    ------
    ConfigError, DataError
        As of `auvid_cli.api.identification.identify`.
    """

    def __init__(self, prepared: PreparedData, filters: Sequence[FilterName]) -> None:
        self._stopping = Event()
        self._runs = set_up_filters(prepared, filters, self._raise_if_cancelled)

    def record(
        self, paths: Sequence[Path], bars: Sequence[Advance], on_estimate: Callable[[Estimate], None]
    ) -> list[Estimate]:
        """Run them, and write each estimate as it comes.

        Parameters
        ----------
        paths : sequence of pathlib.Path
            A file for each filter.
        bars : sequence of Advance
            For each filter, called as it goes with the seconds of data that are done, and all.
        on_estimate : callable
            Called with each estimate as soon as it is there.

        Raises
        ------
        FileError
            If a file cannot be written.
        """
        with ThreadPoolExecutor(os.cpu_count()) as threads:
            try:
                jobs = zip(self._runs, paths, bars, strict=True)
                # Batch estimators take longest, and begin first.
                by_length = sorted(jobs, key=lambda job: not job[0].estimator.in_one_batch)
                futures = {job[1]: threads.submit(_record, *job) for job in by_length}
                for future in as_completed(futures.values()):
                    on_estimate(future.result())
            finally:
                # After an error or an interrupt the other filters end at their next chunk.
                self._stopping.set()
        return [futures[path].result() for path in paths]

    def _raise_if_cancelled(self) -> None:
        if self._stopping.is_set():
            raise _StoppedError


class _StoppedError(Exception):
    """End of a filter because another one failed, or the user interrupted."""


def _record(filter_run: FilterRun, path: Path, advance: Advance) -> Estimate:
    begin, end = filter_run.span

    def watch(chunk: EstimateChunk) -> None:
        if chunk.time.size:
            advance(chunk.time[-1] - begin, end - begin)

    return record_estimate(path, filter_run.header, filter_run.run, watch)


def estimate_delays_and_noise(prepared: PreparedData, progress: Progress) -> PreparedData:
    """Return the data with the delays and the noise that make them most likely, where the settings ask for these."""
    settings = prepared.experiment.identification
    asked = ("delays", settings.estimates_delays), ("noise", settings.noise != "stated")
    sought = [name for name, is_asked in asked if is_asked]
    if not sought:
        return prepared
    with progress.stage(f"find the {' and the '.join(sought)}"):
        found = resolve_settings(prepared)
    if found.delays is not None:
        values = zip(found.delays.symbols, found.delays.value, found.delays.deviation, strict=True)
        texts = (f"{symbol} {1e3 * value:.1f} ± {1e3 * deviation:.1f} ms" for symbol, value, deviation in values)
        progress.message(f"delays that make the data most likely: {', '.join(texts)}")
    if settings.noise == "stated":
        return found
    stated, tuned = (data.experiment.identification.process_noise.model_dump() for data in (prepared, found))
    densities = ", ".join(
        f"{name} {_triple(density if isinstance(density, tuple) else (density,))}"
        for name, density in tuned.items()
        if density != stated[name]
    )
    progress.message(f"process noise that makes the data most likely, SI: {densities}")
    estimate = found.experiment.identification.estimate
    if BiasName.DISTURBANCE in estimate.biases:
        pushes = ", ".join(
            f"{name} {_triple(of.standard_deviation)} over {_triple(of.time_constant)} s"
            for name, of in (("force", estimate.disturbance.force), ("moment", estimate.disturbance.moment))
            if any(of.standard_deviation)
        )
        progress.message(f"disturbance that makes the data most likely, SI: {pushes}")
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
    """Run filters on a dataset side by side, each writing its estimate as it goes.

    Parameters
    ----------
    folder : pathlib.Path
        Results folder.
    prepared : PreparedData
    filters : iterable of FilterName
    overwrite : bool
        Whether estimates of other data or other settings there are replaced, with all that was made from them.
    progress : Progress
    on_estimate : callable
        Called with each estimate as soon as it is written.

    Raises
    ------
    FileError
        If there are such estimates, and `overwrite` is false.
    """
    names = list(dict.fromkeys(filters))
    others = other_estimates(folder, prepared.experiment, prepared.dataset.sha256, names)
    refuse_unless(overwrite, next(iter(others.values()), ""))
    runs = SideBySide(prepared, names)
    paths = [folder / "estimates" / f"{name.value}.h5" for name in names]
    with progress.bars(*(name.value for name in names), unit=" s of data") as bars:
        estimates = runs.record(paths, bars, on_estimate)
    if others:
        kept = {*paths, *(path for path in estimates_in(folder).values() if path not in others)}
        remove(path for path in products(folder) if path not in kept)
    for path, estimate in zip(paths, estimates, strict=True):
        progress.message(f"{path}: {estimate.status}; {estimate.cpu_time:.2f} s of processor time")
    return estimates


class IdentifiedData(NamedTuple):
    """Results of `identify_data_into`.

    Attributes
    ----------
    estimates : list of Estimate
    judgements : dict of Judgement
        By filter.
    contradictions : list of Check
        Failed comparisons of an unused sensor with used ones.
    folder : pathlib.Path
        Results folder.
    files : list of pathlib.Path
        Estimate files.
    """

    estimates: list[Estimate]
    judgements: dict[str, Judgement]
    contradictions: list[Check]
    folder: Path
    files: list[Path]


def identify_data_into(
    output: Path | None,
    data: Path | tuple[Experiment, Sequence[Path]],
    overrides: Sequence[str],
    filters: Sequence[FilterName] | None,
    overwrite: bool,
    progress: Progress,
) -> IdentifiedData:
    """Estimate the coefficients of a dataset with several filters into its results folder, and judge the estimates.

    Parameters
    ----------
    output : pathlib.Path or None
        Results folder.
    data : pathlib.Path, or Experiment and its files
        A dataset file, or an experiment that has been simulated into the folder.
    overrides : sequence of str
        Settings of a dataset file to change.
    filters : sequence of FilterName or None
        Default: those of the settings. The smoother, which judges them, always runs.
    overwrite, progress
        As of `auvid_cli.run`.
    """
    if isinstance(data, Path):
        dataset, folder = read_dataset(data, *overrides), output or folder_of_dataset(data)
    else:
        folder = output or folder_of_run(data[0].name)
        dataset = read_simulated(folder, data[0])
    with locked(folder):
        files = dataset.experiment.data_files() if isinstance(data, Path) else data[1]
        check_no_overlap(products(folder), files)
        if isinstance(data, Path):
            put_copy(data, dataset, folder, files, overwrite)
        settings, vehicle = dataset.experiment.identification, dataset.experiment.vehicle
        chosen = settings.with_judge(filters or settings.default_filters())
        for warning in sanity_warnings(vehicle):
            progress.message(f"note: vehicle {vehicle.name}: {warning}")
        prepared = estimate_delays_and_noise(prepare(dataset), progress)
        estimates = identify_into(folder, prepared, chosen, overwrite, progress)
        paths = [folder / "estimates" / f"{name.value}.h5" for name in chosen]
        return IdentifiedData(estimates, judge(estimates), contradictions_of_unused(dataset), folder, paths)
