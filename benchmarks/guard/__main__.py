"""How many machine instructions the sigma-point filters take for an event: a guard that no busy machine disturbs.

    python -m benchmarks.guard            compare with what is written down; exit code 1 if it has grown
    python -m benchmarks.guard --update   write it down anew

Needs valgrind and some ten minutes. The code is compiled for one fixed processor, so that the numbers hold on every
x86-64 machine; another numba or LLVM may change them a little.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

REFERENCE = Path(__file__).parents[1] / "results" / "instructions.json"
FILTERS = ("ckf", "tukf")
TOLERANCE = 0.05
_DURATION, _PASSES = "10 s", 40
_PROCESSOR = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma,+bmi,+bmi2,+sse4.2,+popcnt"}


def run_filter(name: str, passes: int) -> None:
    """Do what is counted: run a filter over the same few seconds, several times, and print how many events it has."""
    from auvid_cli.config.filter_name import FilterName
    from auvid_cli.config.load import find_experiment, load_experiment
    from auvid_cli.identification.identify import set_up_filters
    from auvid_cli.identification.prepared_data import prepare
    from auvid_cli.simulation.simulate import simulate

    experiment = load_experiment(find_experiment(None), (f"manoeuvre.duration={_DURATION}",))
    (run,) = set_up_filters(prepare(simulate(experiment)), [FilterName(name)])
    outcomes = [run.run(lambda chunk: None) for _ in range(passes)]
    print(outcomes[0].steps)


def instructions_per_event(name: str) -> float:
    """Return the difference between many passes and one, so that loading and simulating do not count."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | _PROCESSOR | {"PYTHONHASHSEED": "0", "NUMBA_CACHE_DIR": folder}
        command = [sys.executable, __file__, "--run", name, "--passes"]
        # Once without valgrind, under which compiling would take an hour.
        steps = int(subprocess.run([*command, "1"], env=environment, capture_output=True, check=True, text=True).stdout)
        counts = []
        for passes in (1, 1 + _PASSES):
            callgrind = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/callgrind"]
            done = subprocess.run(
                [*callgrind, *command, str(passes)], env=environment, capture_output=True, check=True, text=True
            )
            counted = re.search(r"Collected : (\d+)", done.stderr)
            if counted is None:
                raise SystemExit(f"valgrind said nothing of instructions:\n{done.stderr[-500:]}")
            counts.append(int(counted[1]))
        return (counts[1] - counts[0]) / (_PASSES * steps)


def main() -> int:
    """Count, and compare or write down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--update", action="store_true", help=f"write {REFERENCE.name} anew")
    parser.add_argument("--run", choices=FILTERS, help=argparse.SUPPRESS)
    parser.add_argument("--passes", type=int, default=1, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        run_filter(arguments.run, arguments.passes)
        return 0
    if shutil.which("valgrind") is None:
        print("valgrind is not installed: nothing was counted", file=sys.stderr)
        return 2
    counted = {name: round(instructions_per_event(name)) for name in FILTERS}
    if arguments.update:
        REFERENCE.write_text(json.dumps(counted, indent=2) + "\n", encoding="utf-8")
    reference = json.loads(REFERENCE.read_text(encoding="utf-8"))
    grown = False
    for name, count in counted.items():
        change = count / reference[name] - 1.0
        grown |= change > TOLERANCE
        print(f"{name}: {count:,} instructions an event, {change:+.1%} against {reference[name]:,}")
    return int(grown)


if __name__ == "__main__":
    sys.exit(main())
