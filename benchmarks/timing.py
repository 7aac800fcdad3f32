"""Processor time of several runs in turns, on one core."""

import gc
import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

_ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}

_MIN_TIME = 0.2  # s; a shorter run is repeated within its turn


def hold_to_one_core() -> None:
    """Use one thread and one core; call this before importing libraries, which read it at import."""
    os.environ.update(_ONE_THREAD)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def processor() -> str:
    """Return the name of the processor."""
    described = Path("/proc/cpuinfo")
    if described.is_file():
        for line in described.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def described_machine() -> dict[str, str]:
    """Return date, machine and load of a measurement."""
    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "processor": f"{processor()}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {platform.release()}, Python {platform.python_version()}",
        "load": "{:.1f}, {:.1f} and {:.1f} over the last 1, 5 and 15 minutes, this measurement with it".format(
            *os.getloadavg()
        ),
    }


@dataclass(frozen=True)
class Timed:
    """A run, and its processor time in each round, s."""

    run: Callable[[], object]
    seconds: list[float] = field(default_factory=list)


def seconds_of(run: Callable[[], object], at_least: float = 0.0) -> float:
    """Return the mean processor time of a run, s, repeated for `at_least` s."""
    gc.collect()
    count, elapsed, start = 0, 0.0, time.process_time()
    while count == 0 or elapsed < at_least:
        run()
        count, elapsed = count + 1, time.process_time() - start
    return elapsed / count


def round_robin(runs: Sequence[Timed], repetitions: int) -> None:
    """Time all runs in turns, so that a busy machine affects all of them."""
    for repetition in range(repetitions):
        print(f"round {repetition + 1} of {repetitions}", file=sys.stderr)
        for timed in runs:
            timed.seconds.append(seconds_of(timed.run, _MIN_TIME))
