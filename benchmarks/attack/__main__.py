"""Attack auvid with damaged input: `python -m benchmarks.attack`, some forty minutes on two cores.

Settings, HDF5 files, logs and plans that are damaged by the numbers of a seed, and commands that are killed. Prints how
many cases of each kind end in a traceback, hang, or end with another exit code or other words than they should; keeps
what failed with the command that repeats it. Another version is attacked with `PYTHONPATH=CHECKOUT`. Needs Linux.
"""

import argparse
import contextlib
import shutil
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.attack.kinds import KINDS
from benchmarks.attack.material import Material
from benchmarks.attack.outcome import Outcome
from benchmarks.attack.pool import attack
from benchmarks.attack.running import LIMIT
from benchmarks.attack.table import alike, failures, markdown
from docs.section import replace_section

# Of each group of failures that look alike, as many inputs are kept.
_KEPT = 5


class Keeper:
    """Keeps what failed."""

    def __init__(self, folder: Path, repeat: str) -> None:
        self._folder = folder
        self._repeat = repeat
        self._kept: dict[tuple[str, ...], int] = {}

    def __call__(self, outcome: Outcome, home: Path) -> None:
        """Copy what a case left, unless there are enough like it."""
        group = outcome.kind, *(f"{column}: {alike(text)}" for column, text in outcome.faults.items())
        self._kept[group] = self._kept.get(group, 0) + 1
        if self._kept[group] > _KEPT:
            return
        folder = self._folder / outcome.kind / str(outcome.index)
        shutil.rmtree(folder, ignore_errors=True)
        if home.is_dir():
            shutil.copytree(home, folder, symlinks=True, ignore=_pipes)
        folder.mkdir(parents=True, exist_ok=True)
        commands = "\n".join(" ".join(["auvid", *map(repr, command)]) for command in outcome.commands)
        faults = "\n".join(f"{column}: {text}" for column, text in outcome.faults.items())
        text = f"{outcome.what}\n\n{faults}\n\n{commands}\n\n{self._repeat} --only {outcome.kind}:{outcome.index}\n"
        (folder / "failure.txt").write_text(text, encoding="utf-8", errors="replace")


def _pipes(folder: str, names: list[str]) -> list[str]:
    """Say what cannot be copied."""
    return [name for name in names if (Path(folder) / name).is_fifo()]


def chosen(kinds: list[str], share: float, only: list[str]) -> list[tuple[str, int]]:
    """Return the cases: so large a share of each kind, or those that are named."""
    if only:
        pairs = [each.partition(":") for each in only]
        return [(kind, int(index)) for kind, _, index in pairs]
    return [(kind, index) for kind in kinds for index in range(max(1, round(share * KINDS[kind].count)))]


def main() -> int:
    """Attack, and say what came of it; 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1, help="of all cases")
    parser.add_argument("--share", type=float, default=1.0, help="of the cases of each kind")
    parser.add_argument("--kind", choices=KINDS, action="append", help="only cases of this kind; repeatable")
    parser.add_argument("--only", metavar="KIND:INDEX", action="append", default=[], help="only this case; repeatable")
    parser.add_argument("--limit", type=float, default=LIMIT, help="time of a command, s")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "auvid-attack", help="what failed")
    parser.add_argument("--write", action="store_true", help="put the table into docs/reliability.md")
    options = parser.parse_args()
    repeat = f"python -m benchmarks.attack --seed {options.seed}"
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory(prefix="auvid-attack-") as name:
        start = time.perf_counter()
        material = Material(Path(name) / "material")
        cases = chosen(options.kind or list(KINDS), options.share, options.only)
        keeper = Keeper(options.keep, repeat)
        settings = Path(name), options.seed, options.limit, options.processes
        # Ctrl-C ends it with what has been done by then.
        with contextlib.suppress(KeyboardInterrupt):
            for outcome in attack(cases, material, *settings, keeper):
                outcomes.append(outcome)
                if outcome.faults or len(outcomes) % 500 == 0:
                    said = "; ".join(f"{column}: {text}" for column, text in outcome.faults.items())
                    progress = f"{len(outcomes)}/{len(cases)} {time.perf_counter() - start:.0f} s"
                    print(f"{progress} {outcome.kind}:{outcome.index} {said[:200]}", file=sys.stderr)
    outcomes.sort(key=lambda outcome: (outcome.kind, outcome.index))
    text = markdown(outcomes, options.seed, options.limit)
    print(text)
    print(failures(outcomes, repeat))
    if options.write:
        replace_section("attack", text, "reliability")
    failed = any(outcome.faults for outcome in outcomes)
    if failed:
        print(f"what failed is kept in {options.keep}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
