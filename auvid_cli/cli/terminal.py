"""What commands say and how they end: messages, progress bars, exit codes."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

import typer

DONE, VERDICT_FAILED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130


@contextmanager
def reporting_errors() -> Iterator[None]:
    """Turn errors that are the user's to mend into one clear message and exit code 2."""
    from auvid_cli.errors import AuvidError

    try:
        yield
    except AuvidError as error:
        print(f"auvid: {error}", file=sys.stderr)
        raise typer.Exit(WRONG_INPUT) from None
    except KeyboardInterrupt:
        print("auvid: interrupted; files already written are complete", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        # The reader of our output has gone (`auvid ... | head`); there is nobody left to tell.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(DONE) from None


class Terminal:
    """Where a command's messages go.

    Parameters
    ----------
    quiet, verbose : bool
        As the options of the same names.
    """

    def __init__(self, quiet: bool, verbose: bool) -> None:
        from rich.console import Console

        self.quiet = quiet
        self.verbose = verbose and not quiet
        self.out = Console(quiet=quiet, highlight=False)
        # Progress goes to the error stream, so that output can be piped.
        self._err = Console(stderr=True, quiet=quiet)

    def say(self, message: str) -> None:
        """Print a line, as it is."""
        self.out.print(message, markup=False, soft_wrap=True)

    @contextmanager
    def stage(self, label: str) -> Iterator[None]:
        """Show that something is going on; with --verbose say how long it took."""
        start = perf_counter()
        if self._err.is_terminal and not self.quiet:
            with self._err.status(label):
                yield
        else:
            yield
        if self.verbose:
            self.say(f"{label}: {perf_counter() - start:.2f} s")

    @contextmanager
    def progress(self, label: str, total: int) -> Iterator[Callable[[int], None]]:
        """Show a bar with rate and time left; yields the function that moves it."""
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            SpinnerColumn,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        start = perf_counter()
        if not self._err.is_terminal or self.quiet:
            yield lambda done: None
        else:
            columns = (
                SpinnerColumn(),
                TextColumn("{task.description:>10}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[rate]}"),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
            )
            with Progress(*columns, console=self._err) as bars:
                task = bars.add_task(label, total=total, rate="")

                def advance(done: int) -> None:
                    rate = done / max(perf_counter() - start, 1e-9)
                    bars.update(task, completed=done, rate=f"{rate:,.0f} events/s")

                yield advance
        if self.verbose:
            self.say(f"{label}: {perf_counter() - start:.2f} s")
