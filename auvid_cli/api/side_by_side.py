"""Several filters at the same time."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from threading import Event

from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.estimate import Estimate, EstimateChunk
from auvid_cli.data.estimate_file import record_estimate
from auvid_cli.identification.filter_run import FilterRun
from auvid_cli.identification.identify import set_up_filters
from auvid_cli.identification.prepared_data import PreparedData

# Moves on to so many seconds of so many.
Progress = Callable[[float, float], None]


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
        self, paths: Sequence[Path], progress: Sequence[Progress], on_estimate: Callable[[Estimate], None]
    ) -> list[Estimate]:
        """Run them, and write each estimate as it comes.

        Parameters
        ----------
        paths : sequence of pathlib.Path
            A file for each filter.
        progress : sequence of callable
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
                jobs = zip(self._runs, paths, progress, strict=True)
                # What goes through all data again and again takes longest, and begins first.
                by_length = sorted(jobs, key=lambda job: not job[0].estimator.in_one_batch)
                futures = {job[1]: threads.submit(_record, *job) for job in by_length}
                for future in as_completed(futures.values()):
                    on_estimate(future.result())
            finally:
                # Whatever went wrong, an interrupt included, ends the others at their next chunk.
                self._stopping.set()
        return [futures[path].result() for path in paths]

    def _raise_if_cancelled(self) -> None:
        if self._stopping.is_set():
            raise _StoppedError


class _StoppedError(Exception):
    """The end of a filter because another failed, or the user has had enough."""


def _record(filter_run: FilterRun, path: Path, progress: Progress) -> Estimate:
    begin, end = filter_run.span

    def watch(chunk: EstimateChunk) -> None:
        if chunk.time.size:
            progress(chunk.time[-1] - begin, end - begin)

    return record_estimate(path, filter_run.header, filter_run.run, watch)
