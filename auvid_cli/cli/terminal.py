"""Messages, progress bars and errors of commands."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from types import FrameType
from typing import TYPE_CHECKING

import typer

from auvid_cli.api.output import Advance, Progress
from auvid_cli.cli.streams import DONE, INTERRUPTED, WRONG_INPUT, discard, hanging, print_error, print_os_error

if TYPE_CHECKING:
    from auvid_cli.config.vehicle import VehicleSettings

INDENT = 2  # columns, of all lines of a sentence but the first


@contextmanager
def reporting_errors() -> Iterator[None]:
    """Turn errors that a user can fix into one message and exit code 2."""
    from auvid_cli.errors import AuvidError

    # SIGTERM acts like Ctrl-C, so that half-written files are removed. KeyboardInterrupt is the one exception that
    # passes through an import.
    asked: list[int] = []

    def end(number: int, frame: FrameType | None) -> None:
        asked.append(number)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    except AuvidError as error:
        print_error(str(error))
        raise typer.Exit(WRONG_INPUT) from None
    except MemoryError as error:
        print_error(f"not enough memory for this duration and these rates: {error}")
        raise typer.Exit(WRONG_INPUT) from None
    except KeyboardInterrupt:
        print_error("interrupted; files already written are complete")
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        # The reader of the output has ended: `auvid ... | head`.
        discard(sys.stdout)
        raise typer.Exit(DONE) from None
    except OSError as error:
        print_os_error(error)
        raise typer.Exit(WRONG_INPUT) from None
    finally:
        signal.signal(signal.SIGTERM, before)
        if asked:
            # An import or the compiler may have swallowed the exception.
            raise SystemExit(128 + asked[0])


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Defer an interrupt until the block ends, because some libraries turn one into an error of their own on import."""
    waiting = []
    before = signal.signal(signal.SIGINT, lambda number, frame: waiting.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if waiting:
        raise KeyboardInterrupt


class Terminal(Progress):
    """Streams and bars for the messages of a command.

    Parameters
    ----------
    quiet, verbose : bool
        As the options of the same names.
    """

    def __init__(self, quiet: bool, verbose: bool) -> None:
        from auvid_cli.report.screen_table import PlainConsole

        self.quiet = quiet
        self.verbose = verbose and not quiet
        self.out = PlainConsole(quiet=quiet, highlight=False)
        # Progress goes to the error stream, so that output can be piped.
        self._err = PlainConsole(stderr=True, quiet=quiet)
        self._partner: subprocess.Popen | None = None
        # Whether this block compiles, and whether a screen that keeps its lines shows so.
        self._compiles = self._printed = False
        # Number of the signal that arrived while the core was loaded; 0 without one.
        self._interrupted = 0

    def print(self, line: object) -> None:
        """Print a line, as it is."""
        self.out.print(str(line), markup=False, soft_wrap=True)

    def print_wrapped(self, sentence: str) -> None:
        """Print a sentence, broken between words on a narrow terminal."""
        self.print(hanging(sentence, INDENT))

    message = print_wrapped

    def print_lines(self, lines: Iterable[object]) -> None:
        """Print a line for each item, as it is."""
        for line in lines:
            self.print(line)

    def print_sanity_warnings(self, vehicle: "VehicleSettings") -> None:
        """Print a line for each implausible number of a vehicle."""
        from auvid_cli.config.sanity import sanity_warnings

        for warning in sanity_warnings(vehicle):
            self.print_wrapped(f"note: vehicle {vehicle.name}: {warning}")

    def open_page(self, page: Path) -> None:
        """Open a page in the browser of the system, or print that there is none."""
        import webbrowser

        if not webbrowser.open(page.resolve().as_uri()):
            self.print(f"{page}: no browser could be started here; open the file in one")

    @contextmanager
    def stage(self, label: str) -> Iterator[Callable[[str], None]]:
        """Show a spinner; with --verbose print how long the stage took. Yields a callback that changes the label."""
        start, labels = perf_counter(), [label]
        if self._err.is_terminal and not self.quiet:
            with self._err.status(label) as status:

                def change(text: str) -> None:
                    labels.append(text)
                    status.update(text)

                yield change
        else:
            yield labels.append
        if self.verbose:
            self.print(f"{labels[-1]}: {perf_counter() - start:.2f} s")

    @contextmanager
    def compiling(self) -> Iterator[Callable[[], None]]:
        """Import compiled modules in this block; where they must be compiled first, print so. Yields what prints so.

        numba swallows an interrupt or fails on it, so while it compiles one ends the process at once. Imports may
        swallow it as well, so before that it waits until all is loaded, which takes less than a second.
        """
        from auvid_cli.numerics import on_compilation

        before = {number: signal.signal(number, self._interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            with self.stage("loading the compiled core") as change:

                def print_compiling() -> None:
                    label = "compiling the numerical core, once: some 10 to 20 s"
                    change(label)
                    if not self._err.is_terminal and not self.quiet and not self._printed:
                        print_error(label)
                    self._compiles = self._printed = True
                    if self._interrupted:
                        self._leave_at_once()

                with on_compilation(print_compiling):
                    yield print_compiling
                if self._interrupted == signal.SIGINT:
                    raise KeyboardInterrupt
                if self._interrupted:
                    raise SystemExit(128 + self._interrupted)
        finally:
            self._compiles = False
            for number, handler in before.items():
                signal.signal(number, handler)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self._interrupted = number
        if self._compiles:
            self._leave_at_once()

    def _leave_at_once(self) -> None:
        if self._partner is not None:
            self._partner.kill()
        # A spinner hides the cursor and leaves its line half written.
        tidy = b"\x1b[?25h\r\x1b[K" if sys.stderr.isatty() else b""
        os.write(sys.stderr.fileno(), tidy + b"auvid: interrupted while compiling; nothing was lost\n")
        os._exit(INTERRUPTED if self._interrupted == signal.SIGINT else 128 + self._interrupted)

    def load_core(self) -> None:
        """Load the compiled core; where it must be compiled first, two processes do so."""
        from auvid_cli.api import core

        with self._compiling_beside(*core.FILTERS), self.compiling():
            core.load_vehicles()

    @contextmanager
    def _compiling_beside(self, *modules: str) -> Iterator[None]:
        """Compile modules in another process during the block, unless the first of them is compiled already."""
        from auvid_cli.numerics import compile_elsewhere, is_compiled

        if is_compiled(modules[0]):
            yield
            return
        self._partner = compile_elsewhere(*modules)
        try:
            yield
            with self.compiling() as print_compiling:
                print_compiling()
                self._partner.wait()
        finally:
            self._partner.kill()
            self._partner.wait()
            self._partner = None

    @contextmanager
    def bars(self, *labels: str, unit: str = "") -> Iterator[list[Advance]]:
        """Show bars with rate and time left, and in the end one line for all; yields a callback for each."""
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            SpinnerColumn,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        start, ended, notes = perf_counter(), dict.fromkeys(labels, 0.0), dict.fromkeys(labels, "")
        columns = (
            SpinnerColumn(),
            TextColumn("{task.description:>10}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
        )
        shown = self._err.is_terminal and not self.quiet
        with Progress(*columns, console=self._err, transient=True, disable=not shown) as bars:

            def bar(label: str) -> Advance:
                task = bars.add_task(label, total=None, rate="")

                def advance(done: float, total: float, note: str = "") -> None:
                    ended[label], notes[label] = perf_counter() - start, note
                    rate = done / max(ended[label], 1e-9)
                    text = f"{rate:,.3g}" if rate < 100 else f"{rate:,.0f}"
                    bars.update(task, completed=done, total=total, rate=f"{text}{unit}/s{note}")

                return advance

            yield [bar(label) for label in labels]
        if shown:
            what = ", ".join(f"{label}{notes[label]}" for label in labels)
            line = f"{what}: done in {perf_counter() - start:.1f} s"
            self._err.print(line, markup=False, highlight=False, soft_wrap=True)
        if self.verbose:
            for label, seconds in ended.items():
                self.print(f"{label}: {seconds:.2f} s")
