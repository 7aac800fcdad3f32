"""What commands say and how they end: messages, progress bars, errors."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from time import perf_counter
from types import FrameType
from typing import Protocol

import typer

from auvid_cli.cli.exit_codes import DONE, INTERRUPTED, WRONG_INPUT
from auvid_cli.cli.hanging import hanging
from auvid_cli.cli.streams import complain, complain_of, discard

# Of a sentence, of what does not fit on its first line.
_INDENT = 2


@contextmanager
def reporting_errors() -> Iterator[ExitStack]:
    """Turn errors of the user into one clear message and exit code 2; contexts entered meanwhile end before it."""
    from auvid_cli.errors import AuvidError

    # Ended from outside as by Ctrl-C: whoever is writing takes away what is half written. Python, while it compiles a
    # module that it imports, lets this exception pass and no other.
    asked: list[int] = []

    def end(number: int, frame: FrameType | None) -> None:
        asked.append(number)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, end)
    try:
        with ExitStack() as command:
            yield command
    except AuvidError as error:
        complain(str(error))
        raise typer.Exit(WRONG_INPUT) from None
    except MemoryError as error:
        complain(f"not enough memory for this duration and these rates: {error}")
        raise typer.Exit(WRONG_INPUT) from None
    except KeyboardInterrupt:
        complain("interrupted; files already written are complete")
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        # The reader of our output has gone (`auvid ... | head`); there is nobody left to tell.
        discard(sys.stdout)
        raise typer.Exit(DONE) from None
    except OSError as error:
        complain_of(error)
        raise typer.Exit(WRONG_INPUT) from None
    finally:
        signal.signal(signal.SIGTERM, before)
        if asked:
            # Whoever was importing or compiling at that moment may have swallowed it.
            raise SystemExit(128 + asked[0])


class Advance(Protocol):
    """Function that moves a bar."""

    def __call__(self, done: float, total: float, note: str = "") -> None:
        """Move it to so much of so much, and put a note behind the rate."""
        ...


class Terminal:
    """Streams and bars for a command's messages.

    Parameters
    ----------
    quiet, verbose : bool
        As the options of the same names.
    """

    def __init__(self, quiet: bool, verbose: bool) -> None:
        from auvid_cli.report.console import PlainConsole

        self.quiet = quiet
        self.verbose = verbose and not quiet
        self.out = PlainConsole(quiet=quiet, highlight=False)
        # Progress goes to the error stream, so that output can be piped.
        self._err = PlainConsole(stderr=True, quiet=quiet)
        self._partner: subprocess.Popen | None = None
        # Whether compiling has begun in the present block, and whether that stands on a screen that keeps its lines.
        self._compiles = self._printed = False
        self._damaged = False
        # Number of the signal that came while the core was loaded; 0 if none did.
        self._interrupted = 0

    def say(self, message: str) -> None:
        """Print a line, as it is."""
        self.out.print(message, markup=False, soft_wrap=True)

    def tell(self, sentence: str) -> None:
        """Print a sentence, which a narrow terminal breaks between its words."""
        self.say(hanging(sentence, _INDENT))

    def say_all(self, messages: Iterable[object]) -> None:
        """Print a line for each, as it is."""
        for message in messages:
            self.say(str(message))

    @contextmanager
    def stage(self, label: str) -> Iterator[Callable[[str], None]]:
        """Show that something is going on; with --verbose say how long it took. Yields what changes the label."""
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
            self.say(f"{labels[-1]}: {perf_counter() - start:.2f} s")

    @contextmanager
    def compiling(self) -> Iterator[Callable[[], None]]:
        """Load the compiled core, and say so where it has to be compiled; yields what says so.

        The compiler swallows an interrupt or dies of it, so from then on one ends the process on the spot; so does
        whoever imports something now and then, so until then it waits until all is loaded, less than a second.
        """
        from auvid_cli.compilation import told_of_compilation

        before = {number: signal.signal(number, self._interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            with self.stage("loading the compiled core") as change:

                def say_so() -> None:
                    label = "compiling the numerical core, once: some 10 to 20 s"
                    change(label)
                    if not self._err.is_terminal and not self.quiet and not self._printed:
                        complain(label)
                    self._compiles = self._printed = True
                    if self._interrupted:
                        self._leave_at_once()

                with told_of_compilation(say_so, self._say_what_is_damaged):
                    yield say_so
                if self._interrupted == signal.SIGINT:
                    raise KeyboardInterrupt
                if self._interrupted:
                    raise SystemExit(128 + self._interrupted)
        finally:
            self._compiles = False
            for number, handler in before.items():
                signal.signal(number, handler)

    def _say_what_is_damaged(self) -> None:
        if not self._damaged:
            self._err.print("auvid: what was compiled before is damaged; compiling that again", soft_wrap=True)
        self._damaged = True

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

    @contextmanager
    def compiling_beside(self, *modules: str) -> Iterator[None]:
        """Let another process compile modules meanwhile, if the first of them is not compiled yet."""
        from auvid_cli.compilation import compile_elsewhere, is_compiled

        if is_compiled(modules[0]):
            yield
            return
        self._partner = compile_elsewhere(*modules)
        try:
            yield
            with self.compiling() as say_so:
                say_so()
                self._partner.wait()
        finally:
            self._partner.kill()
            self._partner.wait()
            self._partner = None

    @contextmanager
    def progress(self, *labels: str, unit: str = "") -> Iterator[list[Advance]]:
        """Show bars with rate and time left, and in the end one line for all; yields, for each, what moves it."""
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
            said = f"{what}: done in {perf_counter() - start:.1f} s"
            self._err.print(said, markup=False, highlight=False, soft_wrap=True)
        if self.verbose:
            for label, seconds in ended.items():
                self.say(f"{label}: {seconds:.2f} s")
