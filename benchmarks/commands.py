"""Time and memory of whole commands: `python benchmarks/commands.py`, some ten minutes and 5 GB of disk.

How `auvid run` starts cold and warm, how fast help comes, and how simulation, identification and report grow with
the duration of the data.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import NamedTuple

from section import replace_section
from timing import described_machine

_DURATIONS = (300, 3000, 36000)
_ROUNDS = 5


class Cost(NamedTuple):
    """Of a process: wall and processor time, s, and largest resident memory, MB."""

    wall: float
    processor: float
    memory: float


def cost_of(*arguments: str, **environment: str) -> Cost:
    """Run auvid with some arguments; the processes that draw figures are not in processor time and memory."""
    command = [str(Path(sys.executable).with_name("auvid")), *arguments]
    start = time.perf_counter()
    process = subprocess.Popen(command, env=os.environ | environment, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):
        raise SystemExit(f"{' '.join(command)} ended with exit code {process.returncode}")
    kilobyte = 1.0 / 1024.0 if sys.platform != "darwin" else 1.0 / 1024.0**2
    return Cost(time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * kilobyte)


def _row(label: str, costs: list[Cost]) -> str:
    walls = [cost.wall for cost in costs]
    spread = f"{min(walls):.2f} - {max(walls):.2f}" if len(walls) > 1 else ""
    processor, memory = (median(getattr(cost, name) for cost in costs) for name in ("processor", "memory"))
    return f"| {label} | {median(walls):.2f} | {spread} | {processor:.2f} | {memory:.0f} |"


def _start_up(folder: Path) -> list[str]:
    """Cold, warm, help and completion."""
    run = "run", "--quiet", "--output", str(folder / "run")
    completion = {"_AUVID_COMPLETE": "complete_bash", "COMP_WORDS": "auvid identify --filter ", "COMP_CWORD": "3"}
    cold = cost_of(*run, NUMBA_CACHE_DIR=str(folder / "cache"))
    cost_of(*run)
    return [
        _row("`auvid run`, cold: compiles", [cold]),
        _row("`auvid run`, warm", [cost_of(*run) for _ in range(_ROUNDS)]),
        _row("`auvid --help`", [cost_of("--help") for _ in range(_ROUNDS)]),
        _row("completion of `auvid identify --filter`", [cost_of(**completion) for _ in range(_ROUNDS)]),
    ]


def _growth(folder: Path, durations: tuple[int, ...]) -> list[str]:
    rows = []
    for duration in durations:
        home = folder / str(duration)
        dataset = str(home / "dataset.h5")
        steps = {
            "simulate": ("simulate", "--set", f"manoeuvre.duration={duration} s", "--output", str(home)),
            "identify, TUKF": ("identify", dataset, "--filter", "tukf"),
            "report": ("report", str(home)),
        }
        for label, arguments in steps.items():
            cost = cost_of(*arguments, "--quiet")
            rows.append(f"| {label} | {duration} | {cost.wall:.1f} | {cost.processor:.1f} | {cost.memory:.0f} |")
    return rows


def main() -> None:
    """Run everything and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--durations", type=int, nargs="+", default=_DURATIONS, help="of the data, s")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        start_up, growth = _start_up(folder), _growth(folder, tuple(options.durations))
    text = "\n".join(
        [
            *(f"- {name}: {value}" for name, value in described_machine().items()),
            "",
            f"| command | wall, median of {_ROUNDS} (s) | min - max | processor (s) | memory (MB) |",
            "| --- | ---: | ---: | ---: | ---: |",
            *start_up,
            "",
            "| command | data (s) | wall (s) | processor (s) | memory (MB) |",
            "| --- | ---: | ---: | ---: | ---: |",
            *growth,
        ]
    )
    print(text)
    replace_section("commands", text)


if __name__ == "__main__":
    main()
