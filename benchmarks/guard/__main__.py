"""How many machine instructions the sigma-point filters take for an event: a guard that no busy machine disturbs.

    python -m benchmarks.guard            compare with what is written down; exit code 1 if it has grown
    python -m benchmarks.guard --update   write it down anew, also in docs/performance.md

Needs valgrind and some six minutes of two cores. The code is compiled for one fixed processor, so that the numbers
hold on every x86-64 machine; another numba or LLVM may change them a little.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from benchmarks.three_terms import three_terms
from docs.section import replace_section

REFERENCE = Path(__file__).parents[1] / "results" / "instructions.json"
# By name the filter, and settings beside the default ones.
CASES: dict[str, tuple[str, tuple[str, ...]]] = {
    "ckf": ("ckf", ()),
    "tukf": ("tukf", ()),
    "ckf, three known terms": ("ckf", three_terms(estimate=False)),
    "ckf, three estimated terms": ("ckf", three_terms(estimate=True)),
    "ckf, three biases": ("ckf", ("identification.estimate.biases=[gyro]",)),
}
TOLERANCE = 0.05
_DURATION, _PASSES = "10 s", 10
_PROCESSOR = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma,+bmi,+bmi2,+sse4.2,+popcnt"}
_VALGRIND = ("valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null")


def run_case(case: str, passes: int) -> None:
    """Do what is counted: run a filter over the same few seconds, several times, and print how many events it has."""
    from auvid_cli.config.enums import FilterName
    from auvid_cli.config.loading import find_experiment, load_experiment
    from auvid_cli.identification.prepared_data import prepare
    from auvid_cli.identification.run import set_up_filters
    from auvid_cli.simulation.simulate import simulate

    name, settings = CASES[case]
    experiment = load_experiment(find_experiment(None), (f"manoeuvre.duration={_DURATION}", *settings))
    (run,) = set_up_filters(prepare(simulate(experiment)), [FilterName(name)])
    outcomes = [run.run(lambda chunk: None) for _ in range(passes)]
    print(outcomes[0].steps)


@contextmanager
def _compiled_once() -> Iterator[dict[str, str]]:
    """Yield the environment of the counted processes, which share one cache."""
    with tempfile.TemporaryDirectory() as folder:
        yield os.environ | _PROCESSOR | {"PYTHONHASHSEED": "0", "NUMBA_CACHE_DIR": folder}


def _done(case: str, passes: int, environment: dict[str, str], *under: str) -> subprocess.CompletedProcess[str]:
    command = [*under, sys.executable, "-m", "benchmarks.guard", "--run", case, "--passes", str(passes)]
    return subprocess.run(command, env=environment, capture_output=True, check=True, text=True)


def _instructions(case: str, passes: int, environment: dict[str, str]) -> int:
    said = _done(case, passes, environment, *_VALGRIND).stderr
    counted = re.search(r"I\s+refs:\s+([\d,]+)", said)
    if counted is None:
        raise SystemExit(f"valgrind said nothing of instructions:\n{said[-500:]}")
    return int(counted[1].replace(",", ""))


def instructions_per_event() -> dict[str, int]:
    """Return by case the difference between many passes and one, so that loading and simulating do not count."""
    with _compiled_once() as environment, ThreadPoolExecutor(os.cpu_count()) as processes:
        # First without valgrind, under which compiling would take an hour.
        steps = {case: int(_done(case, 1, environment).stdout) for case in CASES}
        counts = {
            case: [processes.submit(_instructions, case, passes, environment) for passes in (1, 1 + _PASSES)]
            for case in CASES
        }
        return {
            case: round((many.result() - one.result()) / (_PASSES * steps[case]))
            for case, (one, many) in counts.items()
        }


def _table(counted: dict[str, int]) -> str:
    lines = ["| filter | instructions an event | x CKF |", "| --- | ---: | ---: |"]
    return "\n".join([*lines, *(f"| {case} | {n:,} | {n / counted['ckf']:.3f} |" for case, n in counted.items())])


def main() -> int:
    """Count, and compare or write down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--update", action="store_true", help=f"write {REFERENCE.name} and the documentation anew")
    parser.add_argument("--run", choices=CASES, help=argparse.SUPPRESS)
    parser.add_argument("--passes", type=int, default=1, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        run_case(arguments.run, arguments.passes)
        return 0
    if shutil.which("valgrind") is None:
        print("valgrind is not installed: nothing was counted", file=sys.stderr)
        return 2
    counted = instructions_per_event()
    reference = json.loads(REFERENCE.read_text(encoding="utf-8"))
    grown = False
    for case, count in counted.items():
        change = count / reference[case] - 1.0 if case in reference else 0.0
        grown |= change > TOLERANCE
        print(f"{case}: {count:,} instructions an event, {change:+.1%} against {reference.get(case, count):,}")
    if arguments.update:
        REFERENCE.write_text(json.dumps(counted, indent=2) + "\n", encoding="utf-8")
        replace_section("instructions", _table(counted))
        return 0
    return int(grown)


if __name__ == "__main__":
    sys.exit(main())
