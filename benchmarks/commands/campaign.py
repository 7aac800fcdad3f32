"""What a campaign costs besides its runs: `python -m benchmarks.commands.campaign`, some fifty minutes.

The default experiment over seeds, with all its filters: one after the other in this process, on one worker, on two, and
on two processes alone, which is what the machine allows; all of them in each round. Then on one worker so many
runs that its memory would show any leak. Before all this whole commands with up to 10 000 short runs.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import NamedTuple

import psutil

from auvid_cli.campaign.cluster import Cluster, local_cluster, run_group, run_groups
from auvid_cli.campaign.plan import CampaignPlan, RunGroup
from auvid_cli.campaign.store import Store
from auvid_cli.config.campaign import load_campaign
from benchmarks.commands.__main__ import cost_of
from benchmarks.timing import described_machine
from docs.section import replace_section

_RUNS, _ROUNDS, _MANY = 200, 3, 1000
_LARGE = 100, 1000, 10_000  # runs of whole commands
# Otherwise the smoother, which judges, takes as long as the three filters.
_UNJUDGED = "settings: {identification.judge: false}\n"
_LOOKS = 5
_OTHER_SEEDS = 1_000_000


class Round(NamedTuple):
    """Wall times of the same runs, s."""

    alone: float
    one_worker: float
    two_workers: float
    two_processes: float


def planned(folder: Path, text: str) -> CampaignPlan:
    """Return the plan of a campaign file with a text."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "campaign.yaml"
    path.write_text(f"name: benchmark\n{text}")
    return CampaignPlan(*load_campaign(path), path)


def timed(groups: list[RunGroup], folder: Path) -> Round:
    """Do the same groups in every way, with processes that are there and have loaded everything."""
    start = time.perf_counter()
    for group in groups:
        run_group(group)
    alone = time.perf_counter() - start
    one, two = (_seconds_on(workers, groups, folder / str(workers)) for workers in (1, 2))
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        list(pool.map(run_group, _warm(folder, 2)))
        start = time.perf_counter()
        list(pool.map(run_group, groups))
        return Round(alone, one, two, time.perf_counter() - start)


def _seconds_on(workers: int, groups: list[RunGroup], folder: Path) -> float:
    """Return the wall time, s, of groups on so many workers, results written."""
    with local_cluster(workers) as cluster:
        list(run_groups(cluster, _warm(folder.parent, workers), False))
        store = Store(folder, {})
        start = time.perf_counter()
        for performed in run_groups(cluster, iter(groups), False):
            store.add(performed)
        store.merge()
        return time.perf_counter() - start


def _warm(folder: Path, workers: int) -> Iterator[RunGroup]:
    """Make groups of other seeds, a few for each worker."""
    seeds = ", ".join(str(_OTHER_SEEDS + k) for k in range(3 * workers))
    return planned(folder, f"{_UNJUDGED}seeds: [{seeds}]\n").groups()


def memory_over(groups: Iterator[RunGroup], n_runs: int) -> list[tuple[int, float]]:
    """Return the memory of a single worker, MB, after so many runs."""
    seen, ended = [], 0
    with local_cluster(1) as cluster:
        for performed in run_groups(cluster, groups, False):
            before, ended = ended, ended + len(performed)
            if before * _LOOKS // n_runs < ended * _LOOKS // n_runs:
                seen.append((ended, _memory(cluster)))
    return seen


def _memory(cluster: Cluster) -> float:
    # The worker can call only functions that it can import, not those of this script.
    worker = cluster.executor.submit(os.getpid).result()
    return psutil.Process(worker).memory_info().rss / 1024.0**2


def large_campaigns(folder: Path) -> list[str]:
    """Return a table of the cost of whole commands by their number of short runs, with one filter."""
    lines = [
        "| `auvid campaign`: 10 s of data, CKF, 2 workers | wall (s) | runs per second | memory (MB) | results (MB) |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    for n_runs in _LARGE:
        settings = "{manoeuvre.duration: 10 s, identification.judge: false}"
        file, output = folder / f"large-{n_runs}.yaml", folder / f"large-{n_runs}"
        file.write_text(f"name: large\nsettings: {settings}\nfilters: [ckf]\nseeds: {n_runs}\n")
        cost = cost_of("campaign", str(file), "--workers", "2", "--quiet", "--output", str(output), watched=True)
        written = sum(path.stat().st_size for path in output.rglob("*") if path.is_file()) / 1e6
        lines.append(
            f"| {n_runs} runs | {cost.wall:.0f} | {n_runs / cost.wall:.1f} | {cost.memory:.0f} | {written:.1f} |"
        )
        print(lines[-1], file=sys.stderr)
    return [*(f"- {name}: {value}" for name, value in described_machine().items()), "", *lines]


def spread(values: Sequence[float], digits: int) -> str:
    """Write median, least and greatest."""
    return f"{median(values):.{digits}f} ({min(values):.{digits}f} - {max(values):.{digits}f})"


def main() -> None:
    """Run everything and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=_RUNS)
    parser.add_argument("--rounds", type=int, default=_ROUNDS)
    parser.add_argument("--many", type=int, default=_MANY)
    parser.add_argument(
        "--only", choices=("large", "comparison"), help="whole commands with many short runs, or the rest"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.only != "comparison":
            text = "\n".join(large_campaigns(folder))
            print(text)
            replace_section("large", text)
        if options.only == "large":
            return
        plan = planned(folder, f"{_UNJUDGED}seeds: {-(-options.runs // 3)}\n")
        groups = list(plan.groups())
        for group in _warm(folder / "warm", 1):
            run_group(group)
        rounds = []
        for k in range(options.rounds):
            rounds.append(timed(groups, folder / f"round-{k}"))
            print(rounds[-1], file=sys.stderr)
        short = planned(
            folder, f"settings: {{manoeuvre.duration: 60 s}}\nfilters: [ckf, tukf]\nseeds: {options.many // 2}\n"
        )
        memory = memory_over(short.groups(), options.many)
    n_runs = plan.n_runs
    walls = list(zip(*rounds, strict=True))
    notes = (
        "",
        f"{spread([own.one_worker / own.alone for own in rounds], 3)} times the time above: with distribution, "
        "collection and writing",
        f"{spread([own.one_worker / own.two_workers for own in rounds], 2)} times as fast as 1 worker",
        f"{spread([own.alone / own.two_processes for own in rounds], 2)} times as fast as one after the other",
    )
    labels = f"one after the other, {n_runs} runs", "1 worker", "2 workers", "2 processes, nothing written"
    text = "\n".join(
        [
            *(f"- {name}: {value}" for name, value in described_machine().items()),
            "",
            f"Median of {len(rounds)} rounds (least - greatest):",
            "",
            "| default experiment, 3 filters | wall (s) | runs per second | |",
            "| --- | ---: | ---: | --- |",
            *(
                f"| {label} | {spread(own, 1)} | {n_runs / median(own):.2f} | {note} |"
                for label, own, note in zip(labels, walls, notes, strict=True)
            ),
            "",
            "| runs of 60 s on one worker | memory (MB) |",
            "| ---: | ---: |",
            *(f"| {runs} | {size:.0f} |" for runs, size in memory),
        ]
    )
    print(text)
    replace_section("campaign", text)


if __name__ == "__main__":
    main()
