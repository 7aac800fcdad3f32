"""Time and memory of whole commands: `python -m benchmarks.commands`, one to five hours and 20 GB of disk.

How `auvid run` starts cold, with nothing compiled, and warm, what its steps take, how fast help comes, and how each
command grows with the duration of the data: simulation, import, inspection, tuning, each filter, validation, report,
and all in one run. With `--folder`, rows of growth that were measured there on the same day are kept; empty it
after a change of the code. Needs Linux, which says what processes share of their memory.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from datetime import date
from pathlib import Path
from statistics import median
from typing import NamedTuple

import psutil

from auvid_cli.config.enums import FilterName
from benchmarks.commands.stages import stages
from benchmarks.timing import described_machine
from docs.make_field import settings
from docs.section import replace_section

_DURATIONS = (300, 3000, 36000)
_NO_JUDGE = "--set", "identification.judge=false"
_ROUNDS = 5
_COLD_ROUNDS = 3
_BETWEEN_LOOKS = 0.2


class Cost(NamedTuple):
    """Wall time, s, processor time of the command and what it compiles with, s, and memory, MB.

    The memory is the largest that was seen of all processes together. The system's own maximum does not serve: that of
    a child begins with the memory of the process that started it.
    """

    wall: float
    processor: float
    memory: float


def cost_of(*arguments: str, watched: bool = False, sound: bool = True, **environment: str) -> Cost:
    """Run auvid with some arguments; watching its memory takes processor time from commands that use every core.

    No filter may diverge or be inconsistent, unless `sound` is not asked for.
    """
    command = [str(Path(sys.executable).with_name("auvid")), *arguments]
    start = time.perf_counter()
    # As installed: with compiled modules of Python.
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    process = subprocess.Popen(command, env=inherited | environment, stdout=subprocess.DEVNULL)
    sizes: list[int] = []
    ended = threading.Event()
    watching = threading.Thread(target=_watch, args=(process.pid, sizes, ended))
    if watched:
        watching.start()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    if watched:
        ended.set()
        watching.join()
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0 and (sound or process.returncode != 1):
        raise SystemExit(f"{' '.join(command)} ended with exit code {process.returncode}")
    return Cost(wall, usage.ru_utime + usage.ru_stime, max(sizes, default=0) / 1e6)


def _watch(pid: int, sizes: list[int], ended: threading.Event) -> None:
    """Note, again and again, what a process and its children occupy; what they share is counted once."""
    while not ended.wait(_BETWEEN_LOOKS):
        try:
            parent = psutil.Process(pid)
            sizes.append(sum(_own_share(process) for process in (parent, *parent.children(recursive=True))))
        except psutil.NoSuchProcess:
            return


def _own_share(process: psutil.Process) -> int:
    try:
        return process.memory_full_info().pss
    except (psutil.NoSuchProcess, psutil.AccessDenied):
        return 0


def _row(label: str, costs: list[Cost], memory: str = "") -> str:
    walls = [cost.wall for cost in costs]
    processor = median(cost.processor for cost in costs)
    return f"| {label} | {median(walls):.2f} | {min(walls):.2f} - {max(walls):.2f} | {processor:.2f} | {memory} |"


def _start_up(folder: Path) -> list[str]:
    """Time a run cold and warm, help and completion."""
    run = "run", "--quiet", "--output", str(folder / "run")
    completion = {"_AUVID_COMPLETE": "complete_bash", "COMP_WORDS": "auvid identify --filter ", "COMP_CWORD": "3"}
    cold = [cost_of(*run, NUMBA_CACHE_DIR=str(folder / f"cache-{k}")) for k in range(_COLD_ROUNDS)]
    cost_of(*run)
    warm = [cost_of(*run) for _ in range(_ROUNDS)]
    # Apart from the rounds that are timed.
    cold_memory = cost_of(*run, watched=True, NUMBA_CACHE_DIR=str(folder / "cache-watched")).memory
    warm_memory = cost_of(*run, watched=True).memory
    return [
        "| command | wall, median (s) | min - max | processor (s) | memory (MB) |",
        "| --- | ---: | ---: | ---: | ---: |",
        _row("`auvid run`, cold: compiles", cold, f"{cold_memory:.0f}"),
        _row("`auvid run`, warm", warm, f"{warm_memory:.0f}"),
        _row("`auvid --help`", [cost_of("--help") for _ in range(_ROUNDS)]),
        _row("completion of `auvid identify --filter`", [cost_of(**completion) for _ in range(_ROUNDS)]),
    ]


Add = Callable[..., None]  # measures a command and adds its row; takes the label and the arguments


def _growth(folder: Path, durations: list[int]) -> list[str]:
    """Measure each command on data of each duration: a simulated run, and a log with the sensors of a field survey.

    Processor time and memory, which hardly depend on other processes. Rows measured on this day are kept in the folder.
    """
    rows, today = ["| command | data (s) | processor (s) | memory (MB) |", "| --- | ---: | ---: | ---: |"], date.today()
    for measure in (_alone, _judged, _unjudged, _tuning):
        for duration in durations:
            kept, measured = folder / f"{today}{measure.__name__}_{duration}.txt", list[str]()

            def add(label: str, *arguments: str, duration: int = duration, measured: list[str] = measured) -> None:
                cost = cost_of(*arguments, "--quiet", watched=True, sound=False)
                measured.append(f"| {label} | {duration} | {cost.processor:.1f} | {cost.memory:.0f} |")
                print(measured[-1], f"{cost.wall:.0f} s of wall time", flush=True)

            if not kept.exists():
                measure(add, folder, duration)
                kept.write_text("\n".join(measured), encoding="utf-8")
            rows += kept.read_text(encoding="utf-8").splitlines()
    return rows


def _alone(add: Add, folder: Path, duration: int) -> None:
    """Measure the commands that `auvid run` contains, and those for a log."""
    home, length = folder / str(duration), ("--set", f"manoeuvre.duration={duration} s")
    dataset, other, log = str(home / "dataset.h5"), str(home / "other"), home / "log"
    shutil.rmtree(home, ignore_errors=True)  # of an interrupted measurement
    add("simulate", "simulate", *length, "--output", str(home))
    cost_of("simulate", *length, "--seed", "2", "--output", other, "--quiet")
    for name in FilterName:
        add(f"identify, {name.value}", "identify", dataset, "--filter", name.value, *_NO_JUDGE)
    add("validate", "validate", str(home / "estimates/tukf.h5"), f"{other}/dataset.h5", "--output", other)
    add("report", "report", str(home))
    cost_of("simulate", "field", *length, "--as-log", "--output", str(log), "--quiet")
    survey = str(_survey(folder, duration))
    add("import, field log", "import", "--map", str(log / "map.yaml"), "--output", survey, "--overwrite")
    add("inspect, field log", "inspect", survey, "--output", str(folder / "inspection"), "--overwrite")
    shutil.rmtree(home)


def _judged(add: Add, folder: Path, duration: int) -> None:
    """Measure a whole run."""
    add("run", "run", *_whole(folder, duration))
    shutil.rmtree(folder / "whole")


def _unjudged(add: Add, folder: Path, duration: int) -> None:
    """Measure a whole run without the judge."""
    add("run, without the judge", "run", *_whole(folder, duration), *_NO_JUDGE)
    shutil.rmtree(folder / "whole")


def _whole(folder: Path, duration: int) -> tuple[str, ...]:
    return "--set", f"manoeuvre.duration={duration} s", "--output", str(folder / "whole"), "--overwrite"


def _tuning(add: Add, folder: Path, duration: int) -> None:
    """Measure the tuning of the imported log."""
    lateral, tuned = folder / "lateral.yaml", folder / "tuned"
    lateral.write_text(settings()[0], encoding="utf-8")
    survey = str(_survey(folder, duration))
    add("tune, field log", "tune", survey, "--set", str(lateral), "--output", str(tuned), "--overwrite")


def _survey(folder: Path, duration: int) -> Path:
    """Return the dataset of the imported field log of some duration."""
    return folder / f"survey-{duration}.h5"


def _write(section: str, *tables: list[str]) -> None:
    machine = [f"- {name}: {value}" for name, value in described_machine().items()]
    text = "\n".join("\n".join([*lines, ""]) for lines in (machine, *tables))
    print(text)
    replace_section(section, text)


def main() -> None:
    """Run everything, or one part, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("start", "growth"), help="one of the two parts")
    parser.add_argument("--durations", type=int, nargs="+", default=_DURATIONS, help="of the data, s")
    parser.add_argument("--folder", type=Path, help="for data and finished rows of growth; by default a temporary one")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.only != "growth":
            _write("start", _start_up(folder), stages(folder, _ROUNDS))
        if options.only != "start":
            kept = options.folder or folder
            kept.mkdir(parents=True, exist_ok=True)
            _write("growth", _growth(kept, sorted(options.durations)))


if __name__ == "__main__":
    main()
