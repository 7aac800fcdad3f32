"""Sound input in odd surroundings: environment, memory, signals, readers that end. Each command is a process."""

import gzip
import random
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.attack.cases import numbers
from benchmarks.attack.kills import run
from benchmarks.attack.material import Material
from benchmarks.attack.outcome import Outcome, faults_of, unsound_files

_REPORT = "report", "run"
_SIMULATE = "simulate", "--set", "manoeuvre.duration=2 s", "-o", "out"
_RUN = "run", "--set", "manoeuvre.duration=2 s", "-f", "ckf", "-o", "out"
_SUGGEST = "import", "--suggest", "long.csv.gz", "-o", "map.yaml"
_LINES = 60_000
_COMMANDS = _REPORT, _SIMULATE, _RUN, _SUGGEST
_VALUES = "abc", "-1", "0", "1", "", "1e9", "/nowhere", "module://nowhere", "\x1b[31m"
_VARIABLES = (
    *("MPLBACKEND", "MATPLOTLIBRC", "MPLCONFIGDIR", "MPL_IGNORE_SYSTEM_FONTS", "HOME", "XDG_CACHE_HOME", "TMPDIR"),
    *("NUMBA_NUM_THREADS", "NUMBA_OPT", "NUMBA_CPU_FEATURES", "NUMBA_DISABLE_JIT", "NUMBA_THREADING_LAYER"),
    *("NUMBA_BOUNDSCHECK", "NUMBA_LOOP_VECTORIZE", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"),
    *("HDF5_PLUGIN_PATH", "HDF5_USE_FILE_LOCKING", "COLUMNS", "TERM", "LC_ALL", "TZ", "NO_COLOR", "FORCE_COLOR"),
)
_FILES = {
    "matplotlibrc": ("text.usetex: True\n", "backend: qtagg\n", "figure.dpi: x\n", "nowhere: 1\n", "\0\n"),
    ".numba_config.yaml": ("num_threads: abc\n", "num_threads: -1\n", "{[\n", "1\n"),
}
# Limits of memory, bytes: from too little for Python to enough for everything.
_LEAST, _MOST = 2e8, 4e9
_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


def environment(home: Path, material: Material, seed: int, index: int) -> Outcome:
    """Run a command with odd environment variables, or beside files of the libraries' settings."""

    def options(rng: random.Random) -> tuple[str, dict[str, Any]]:
        if rng.random() < 0.25:
            name = rng.choice([*_FILES])
            text = rng.choice(_FILES[name])
            (home / name).write_text(text)
            return f"{name}: {text!r}", {}
        variables = {rng.choice(_VARIABLES): rng.choice(_VALUES) for _ in range(rng.choice((1, 1, 2)))}
        return repr(variables), {"environment": variables}

    return _perform("environment", home, material, seed, index, options)


def memory(home: Path, material: Material, seed: int, index: int) -> Outcome:
    """Run a command with little memory."""

    def options(rng: random.Random) -> tuple[str, dict[str, Any]]:
        limit = int(_LEAST * (_MOST / _LEAST) ** rng.random())
        return f"{limit / 1e6:.0f} MB", {"memory": limit}

    return _perform("memory", home, material, seed, index, options)


def interrupts(home: Path, material: Material, seed: int, index: int) -> Outcome:
    """Send a signal to a command, or close its output after the first line."""

    def options(rng: random.Random) -> tuple[str, dict[str, Any]]:
        if rng.random() < 0.3:
            return "its reader ends", {"is_read": False}
        number, moment = rng.choice(_SIGNALS), rng.uniform(0.5, 8.0)
        return f"{number.name} at {moment:.2f} s", {"number": number, "moment": moment}

    return _perform("interrupts", home, material, seed, index, options)


def _perform(
    kind: str,
    home: Path,
    material: Material,
    seed: int,
    index: int,
    options: Callable[[random.Random], tuple[str, dict[str, Any]]],
) -> Outcome:
    rng = numbers(seed, kind, index)
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    shutil.copytree(material.results, home / "run")
    command = rng.choice(_COMMANDS)
    if command == _SUGGEST:
        with gzip.open(home / "long.csv.gz", "wt") as file:
            file.write("time,depth,rudder,note\n")
            file.writelines(f'{k / 100},{k % 97},{k % 31},"a, {k}"\n' for k in range(_LINES))
    what, chosen = options(rng)
    ended, living = run(home, command, **chosen)
    faults = faults_of(ended, False, True)
    number = chosen.get("number")
    if number is not None and ended.code in (128 + number, -number):
        # Before Python handles signals, they end it.
        faults.pop("exit", None)
        faults.pop("raw", None)
    elif number is not None and ended.code == 2:
        faults["exit"] = f"exit code 2 after {number.name}: {ended.err.strip()[:160]}"
    if "is_read" in chosen and command in (_REPORT, _RUN) and not list(home.glob("*/report.html")):
        faults["file"] = "no report after the reader of the output ended"
    if "is_read" in chosen and ended.code == 1 and "exit" in faults:
        # The words went to the reader that has ended.
        del faults["exit"]
    if living:
        faults["process"] = f"lives on after the end: {living}"
    written = [path for name in ("out", "run") for path in (home / name).rglob("*") if path.is_file()]
    if unsound := unsound_files(written):
        faults.setdefault("file", unsound)
    outcome = Outcome(kind, index, f"{command[0]}: {what}", [list(command)], ended.seconds, faults)
    for column, text in faults.items():
        outcome.faults[column] = f"{command[0]}: {text}"
    return outcome
