"""Runs and campaigns killed at any moment, and done again."""

import contextlib
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterable, Mapping
from pathlib import Path

import h5py
import numpy as np
import pandas

from benchmarks.attack.cases import numbers
from benchmarks.attack.material import Material
from benchmarks.attack.outcome import Outcome, faults_of, unsound_files
from benchmarks.attack.running import Ended

_RUN = "run", "--set", "manoeuvre.duration=3 s", "-f", "ckf", "-f", "tukf", "-o", "out"
_CAMPAIGN = """\
name: killed
experiment: spiral
settings: {manoeuvre.duration: 2 s}
seeds: 4
filters: [ckf, tukf]
vary: [{setting: identification.prior.factor, values: [1, 3]}]
"""
_MARK = "AUVID_ATTACKED"
# Between the last kill and the look at what still lives, s; and what a whole command may take.
_GRACE = 1.0
_LONGEST = 400.0
# Kills fall in this time after the start, s: all of the run, and some after its end.
_SPAN = 6.0
_TIMES = "processor_time", "wall_time"


def perform(home: Path, material: Material, seed: int, index: int) -> Outcome:
    """Kill a command, look at what it left, and do it again."""
    rng = numbers(seed, "kills", index)
    campaign = index % 2 == 1
    command = ("campaign", "killed.yaml", "-o", "out") if campaign else _RUN
    whole = _whole(home.with_name(f"{home.name}-whole"), campaign, command)
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    (home / "killed.yaml").write_text(_CAMPAIGN)
    start = time.perf_counter()
    faults: dict[str, str] = {}
    said = []
    for _ in range(rng.choice((1, 1, 2))):
        number, moment = (
            rng.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)),
            rng.uniform(0.0, _SPAN),
        )
        said.append(f"{number.name} at {moment:.2f} s")
        faults |= _killed(home, command, number, moment)
    outcome = Outcome("kills", index, f"{command[0]}: {', '.join(said)}", [list(command)], 0.0, faults)
    ended, living = run(home, command)
    again = faults_of(ended, False, True)
    if living:
        again["process"] = f"lives on after the end: {living}"
    if (home / "out").is_dir() and (unsound := unsound_files(_files(home / "out"))):
        again["file"] = f"after it was done again: {unsound}"
    elif ended.code in (0, 1) and not _same(home / "out", whole, campaign):
        again["file"] = "results differ from those of a run that was not killed"
    elif ended.code == 2:
        again["exit"] = f"not done again: {ended.err.strip()[:160]}"
    for column, text in again.items():
        outcome.faults.setdefault(column, f"again: {text}")
    outcome.seconds = time.perf_counter() - start
    return outcome


def _whole(folder: Path, campaign: bool, command: tuple[str, ...]) -> Path:
    """Return the results of a command that nobody killed."""
    home = folder / ("campaign" if campaign else "run")
    if not home.is_dir():
        home.mkdir(parents=True)
        (home / "killed.yaml").write_text(_CAMPAIGN)
        run(home, command)
    return home / "out"


def _killed(home: Path, command: tuple[str, ...], number: signal.Signals, moment: float) -> dict[str, str]:
    ended, living = run(home, command, number, moment)
    faults: dict[str, str] = {}
    # A run may also have ended before.
    if number is not signal.SIGKILL and ended.code not in (0, 1, 130, 143, -number):
        faults["exit"] = f"exit code {ended.code} after {number.name}"
    if "Traceback" in ended.err:
        faults["traceback"] = f"after {number.name}: {ended.err.strip().splitlines()[-1][:160]}"
    if ended.killed:
        faults["hang"] = f"no end after {number.name}"
    if living:
        faults["process"] = f"lives on after {number.name}: {living}"
    # What is under a temporary name after SIGKILL is for the next command to take away.
    named = [path for path in _files(home) if not path.name.startswith(".") or number is not signal.SIGKILL]
    if unsound := unsound_files(named):
        faults["file"] = f"after {number.name}: {unsound}"
    return faults


def run(
    home: Path,
    command: tuple[str, ...],
    number: signal.Signals | None = None,
    moment: float = 0.0,
    environment: Mapping[str, str] | None = None,
    memory: int | None = None,
    is_read: bool = True,
) -> tuple[Ended, str]:
    """Run a command in a process of its own; return its end, and its processes that still run a moment later.

    Parameters
    ----------
    home : Path
    command : tuple of str
    number : signal, optional
        Sent to the command after `moment`, s.
    moment : float
    environment : mapping of str, optional
        Further variables.
    memory : int, optional
        Limit of the address space of each process, bytes.
    is_read : bool
        False: the output is a pipe whose reader ends after the first line.
    """

    def prepare() -> None:
        # A background job ignores some of them, and its children would as well.
        for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(ending, signal.SIG_DFL)
        if memory is not None:
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))

    mark = uuid.uuid4().hex
    start = time.perf_counter()
    killed = False
    with (home / "said.txt").open("w+") as out, (home / "complained.txt").open("w+") as err:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "auvid_cli", *command],
            cwd=home,
            stdin=subprocess.DEVNULL,
            stdout=out if is_read else subprocess.PIPE,
            stderr=err,
            env=os.environ | {_MARK: mark} | dict(environment or {}),
            start_new_session=True,
            preexec_fn=prepare,
        )
        if process.stdout is not None:
            process.stdout.readline()
            process.stdout.close()
        if number is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(moment)
            process.send_signal(number)
        try:
            process.wait(_LONGEST if number is None else _LONGEST / 12)
        except subprocess.TimeoutExpired:
            killed = True
            process.kill()
            process.wait()
        seconds = time.perf_counter() - start
        time.sleep(_GRACE)
        living = list(_living(mark))
        for pid, _ in living:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        out.seek(0)
        err.seek(0)
        ended = Ended(process.returncode, False, killed, seconds, out.read(), err.read())
    return ended, ", ".join(sorted({name for _, name in living}))


def _living(mark: str) -> Iterable[tuple[int, str]]:
    """Find the processes that a command started, whoever their parent is by now."""
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        with contextlib.suppress(OSError):
            if f"{_MARK}={mark}".encode() in (entry / "environ").read_bytes().split(b"\0"):
                words = (entry / "cmdline").read_bytes().decode().split("\0")
                yield int(entry.name), " ".join(words)[:100]


def _files(folder: Path) -> list[Path]:
    ignored = {"said.txt", "complained.txt", "killed.yaml"}
    return [path for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in ignored]


def _same(out: Path, whole: Path, campaign: bool) -> bool:
    if campaign:
        one, other = (_table(folder) for folder in (out, whole))
        return one.equals(other)
    for name in ("dataset.h5", "estimates/ckf.h5", "estimates/tukf.h5"):
        with h5py.File(out / name) as one, h5py.File(whole / name) as other:
            variable = "mean" if "mean" in other else "sensors/dvl/u"
            if not np.array_equal(one[variable][...], other[variable][...]):
                return False
    names = [{str(path.relative_to(folder)) for path in _files(folder)} for folder in (out, whole)]
    return names[0] == names[1]


def _table(folder: Path) -> pandas.DataFrame:
    table = pandas.read_parquet(folder / "results")
    table = table.drop(columns=[name for name in _TIMES if name in table.columns])
    return table.sort_values(list(table.columns), ignore_index=True)
