"""Messages, progress bars and errors of commands."""

import os
import signal
import sys
import webbrowser
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from types import FrameType
from typing import TYPE_CHECKING

import typer

from auvid_cli.api import COMPILED_FILTERS, Advance, Progress, load_vehicles
from auvid_cli.cli import INTERRUPTED, WRONG_INPUT, hanging, print_error, print_os_error
from auvid_cli.errors import AuvidError, ConfigError

if TYPE_CHECKING:
    from auvid_cli.config.vehicle import VehicleSettings

_LEAST_MEMORY = 1_500_000_000  # bytes
INDENT = 2  # columns; indent of all lines of a sentence except the first


_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


@contextmanager
def _signals_go_to(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Handle the signals that end a command, except those that its parent has set to be ignored (nohup)."""
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    before = {number: earlier for number, earlier in before.items() if earlier not in (signal.SIG_IGN, None)}
    for number in before:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


@contextmanager
def reporting_errors() -> Iterator[None]:
    """Turn errors that a user can fix into one message and exit code 2, and signals into 128 + their number."""
    # SIGTERM and SIGHUP act like Ctrl-C, so that half-written files are removed. They raise KeyboardInterrupt, because
    # an import may suppress any other exception.
    received: list[int] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        received.append(number)
        raise KeyboardInterrupt

    try:
        with _signals_go_to(interrupt):
            _check_address_space()
            yield
    except typer.Exit:
        _end_if_terminated(received)
        raise
    except (Exception, KeyboardInterrupt) as error:
        # A library may have turned the interrupt into an error of its own.
        if received or isinstance(error, KeyboardInterrupt):
            print_error("interrupted; files already written are complete")
            raise SystemExit(128 + received[0] if received else INTERRUPTED) from None
        if not _print_known(error):
            raise
        raise typer.Exit(WRONG_INPUT) from None
    _end_if_terminated(received)


def _check_address_space() -> None:
    """Raise a ConfigError if memory is limited to less than `_LEAST_MEMORY`: some libraries then load forever."""
    if sys.platform == "win32":
        return
    import resource

    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < _LEAST_MEMORY:
        raise ConfigError(f"ulimit -v: {limit / 1e6:.0f} MB of memory; expected {_LEAST_MEMORY / 1e6:.0f} MB or more")


def _end_if_terminated(received: list[int]) -> None:
    """End with the code of SIGTERM or SIGHUP, even if an import, the compiler or the command caught the exception."""
    if ending := [number for number in received if number != signal.SIGINT]:
        raise SystemExit(128 + ending[0])


def _print_known(error: BaseException) -> bool:
    """Print an error that a user can fix in one line; False for others."""
    match error:
        case AuvidError():
            print_error(str(error))
        case MemoryError():
            reason = f": {error}" if str(error) else ""
            print_error(f"not enough memory; use a shorter duration or lower sensor rates{reason}")
        case OSError():
            print_os_error(error)
        case _:
            return False
    return True


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Defer an interrupt to the end of the block, because some libraries turn it into another error during import."""
    waiting: list[int] = []
    with _signals_go_to(lambda number, frame: waiting.append(number)):
        yield
    if waiting:
        signal.raise_signal(waiting[0])


class Terminal(Progress):
    """Prints the messages and progress of a command."""

    def __init__(self, quiet: bool, verbose: bool) -> None:
        from auvid_cli.report.text_tables import PlainConsole

        self.quiet = quiet
        self.verbose = verbose and not quiet
        self.out = PlainConsole(quiet=quiet, highlight=False)
        # Progress goes to the error stream, so that output can be piped.
        self._err = PlainConsole(stderr=True, quiet=quiet)
        # Whether the core is being compiled now, and whether a message about this has been printed.
        self._compiles = self._printed = False
        self._interrupted = 0  # number of the signal received while the core was loaded; 0: none

    def print(self, line: object) -> None:
        """Print a line without markup or line breaks."""
        self.out.print(str(line), markup=False, soft_wrap=True)

    def print_wrapped(self, sentence: str) -> None:
        """Print a sentence, broken between words at the width of the terminal."""
        self.print(hanging(sentence, INDENT))

    message = print_wrapped

    def print_lines(self, lines: Iterable[object]) -> None:
        """Print one line per item."""
        for line in lines:
            self.print(line)

    def print_sanity_warnings(self, vehicle: "VehicleSettings") -> None:
        """Print one line per implausible value of a vehicle."""
        from auvid_cli.config.sanity import sanity_warnings

        for warning in sanity_warnings(vehicle):
            self.print_wrapped(f"note: vehicle {vehicle.name}: {warning}")

    def open_page(self, page: Path) -> None:
        """Open a page in the default browser."""
        if not webbrowser.open(page.resolve().as_uri()):
            self.print(f"{page}: no browser could be started; open this file in a browser")

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
        """Import compiled modules in this block; print a message if they must be compiled first.

        Yields the function that prints the message. An interrupt during compilation ends the process at once, because
        numba may suppress it. An interrupt during imports takes effect at the end of the block, because imports may
        suppress it as well.
        """
        from auvid_cli.numerics import on_compilation

        with _signals_go_to(self._interrupt), self.stage("loading the compiled core") as change:

            def print_compiling() -> None:
                label = "compiling the code that this command needs (once after an installation; 20 to 40 s)"
                change(label)
                if not self._err.is_terminal and not self.quiet and not self._printed:
                    print_error(label)
                self._compiles = self._printed = True
                if self._interrupted:
                    self._leave_at_once()

            try:
                with on_compilation(print_compiling):
                    yield print_compiling
            finally:
                self._compiles = False
        if self._interrupted:
            signal.raise_signal(self._interrupted)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self._interrupted = number
        if self._compiles:
            self._leave_at_once()

    def _leave_at_once(self) -> None:
        # Show the cursor again, and clear the line of the spinner.
        reset = b"\x1b[?25h\r\x1b[K" if sys.stderr.isatty() else b""
        os.write(sys.stderr.fileno(), reset + b"auvid: interrupted while compiling; nothing was lost\n")
        os._exit(128 + self._interrupted)

    def load_core(self) -> None:
        """Load the compiled core; two processes compile it if necessary."""
        with self._compiling_in_parallel(*COMPILED_FILTERS), self.compiling():
            load_vehicles()

    @contextmanager
    def _compiling_in_parallel(self, *modules: str) -> Iterator[None]:
        """Compile modules in a second process during the block, if the first of them is not in the cache."""
        from auvid_cli.numerics import compile_elsewhere, is_compiled

        if is_compiled(modules[0]):
            yield
            return
        with compile_elsewhere(*modules) as partner:
            yield
            with self.compiling() as print_compiling:
                print_compiling()
                # Wait for the other process. If it failed, this one compiles, and reports the error.
                partner.exception()

    @contextmanager
    def bars(self, *labels: str, unit: str = "") -> Iterator[list[Advance]]:
        """Show progress bars, and one line at the end; yields a callback per bar."""
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
            names = ", ".join(f"{label}{notes[label]}" for label in labels)
            line = f"{names}: done in {perf_counter() - start:.1f} s"
            self._err.print(line, markup=False, highlight=False, soft_wrap=True)
        if self.verbose:
            for label, seconds in ended.items():
                self.print(f"{label}: {seconds:.2f} s")
