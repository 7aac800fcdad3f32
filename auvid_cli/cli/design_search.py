"""The search of `auvid design`: until time or generations are over, on from where an earlier one was ended."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, NamedTuple, cast

from auvid_cli.cli.terminal import Terminal

if TYPE_CHECKING:
    from auvid_cli.api.design import Flight, Map, Reached, Task


class SearchLimits(NamedTuple):
    """When a search ends: after so many generations, or where these are None after so long, s."""

    generations: int | None
    time: float | None


@contextmanager
def spread_over(scheduler: str) -> "Iterator[Map]":
    """Connect to a Dask scheduler and yield what tries manoeuvres on its workers, as `map`.

    Raises
    ------
    ClusterError
        If it does not answer, or its workers have another version of auvid.
    """
    from auvid_cli.campaign.engine import cluster_client

    with cluster_client(scheduler, None) as client:
        # A client of this process is not awaited.
        yield lambda work, items: cast("list[Flight]", client.gather(client.map(work, list(items), pure=False)))


def search_on(
    task: "Task", terminal: Terminal, limits: SearchLimits, file: Path, key: str, overwrite: bool
) -> "Reached":
    """Look for better manoeuvres until the limits are reached, or somebody interrupts.

    Parameters
    ----------
    task : Task
    terminal : Terminal
    limits : SearchLimits
        Of this search and that from which it goes on together.
    file : pathlib.Path
        State of the search, written after each generation; if it is there, the search goes on from it.
    key : str
        Of the search: a state of another one is refused, unless it may be overwritten.
    overwrite : bool

    Raises
    ------
    FileError
        If the file is of another search, damaged, or cannot be written.
    """
    from auvid_cli.api.design import searching
    from auvid_cli.data.replacement import refuse_unless
    from auvid_cli.data.search_file import SearchState, read_search, write_search

    earlier = read_search(file)
    if earlier is not None and earlier.key != key:
        refuse_unless(overwrite, f"{file} is of a search with other settings")
        earlier = None
    before, spent = ((), 0.0) if earlier is None else (earlier.costs, earlier.elapsed)
    if before:
        terminal.say(f"goes on after {len(before)} generations and {spent:.0f} s ({file})")
    start, latest = monotonic() - spent, None
    with terminal.progress("design") as (bar,):
        try:
            for progress in searching(task, before):
                latest, elapsed = progress, monotonic() - start
                if progress.generation > len(before):
                    write_search(file, SearchState(key, elapsed, progress.costs))
                note = f", {progress.evaluations} manoeuvres, x{task.gain_of(progress.best):.2f} so far"
                if limits.generations is not None:
                    bar(min(progress.generation, limits.generations), limits.generations, note)
                    is_over = progress.generation >= limits.generations
                else:
                    assert limits.time is not None, "a search has a limit"
                    bar(min(elapsed, limits.time), limits.time, note)
                    is_over = elapsed >= limits.time
                if is_over:
                    break
        except KeyboardInterrupt:
            if latest is None:
                raise
            terminal.tell("interrupted: the best so far is kept; with --overwrite the same command goes on")
    assert latest is not None, "a search has a first generation"
    return latest
