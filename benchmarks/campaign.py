"""What a campaign costs besides its runs: `python benchmarks/campaign.py`, some ten minutes.

The default experiment over seeds, with all its filters: one after the other in this process, on one worker, on two, and
on one worker so many runs that its memory would show any leak.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import psutil
from distributed import Client
from section import replace_section
from timing import described_machine

from auvid_cli.campaign.engine import cluster_client, perform_groups
from auvid_cli.campaign.perform import perform
from auvid_cli.campaign.plan import Group, Plan
from auvid_cli.campaign.store import Store
from auvid_cli.config.campaign import load_campaign

_RUNS, _MANY = 200, 1000
_LOOKS = 5


def planned(folder: Path, text: str) -> Plan:
    """Plan of a campaign file with a text."""
    path = folder / "campaign.yaml"
    path.write_text(f"name: benchmark\n{text}")
    return Plan(*load_campaign(path), path)


def seconds_on(workers: int, groups: list[Group], folder: Path) -> float:
    """Wall time, s, of groups on workers that are there and have loaded everything, results written."""
    with cluster_client(None, workers) as client:
        list(perform_groups(client, _warm(groups, workers), False))
        store = Store(folder / f"{workers}", {})
        start = time.perf_counter()
        for performed in perform_groups(client, iter(groups), False):
            store.add(performed)
        store.merge()
        return time.perf_counter() - start


def _warm(groups: list[Group], workers: int) -> Iterator[Group]:
    """The first groups under other names, a few for each worker."""
    for k, group in enumerate(islice(groups, 3 * workers)):
        yield group._replace(runs=[run._replace(identity=f"warm-{k}-{run.identity}") for run in group.runs])


def memory_over(groups: Iterator[Group], n_runs: int) -> list[tuple[int, float]]:
    """Memory of a single worker, MB, after so many runs."""
    seen, ended = [], 0
    with cluster_client(None, 1) as client:
        for performed in perform_groups(client, groups, False):
            before, ended = ended, ended + len(performed)
            if before * _LOOKS // n_runs < ended * _LOOKS // n_runs:
                seen.append((ended, _memory(client)))
    return seen


def _memory(client: Client) -> float:
    (size,) = client.run(lambda: psutil.Process().memory_info().rss).values()
    return size / 1024.0**2


def main() -> None:
    """Run everything and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=_RUNS)
    parser.add_argument("--many", type=int, default=_MANY)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan = planned(folder, f"seeds: {-(-options.runs // 3)}\n")
        groups = list(plan.groups())
        perform(groups[0])
        start = time.perf_counter()
        for group in groups:
            perform(group)
        alone = time.perf_counter() - start
        one, two = (seconds_on(workers, groups, folder) for workers in (1, 2))
        short = planned(
            folder, f"settings: {{manoeuvre.duration: 60 s}}\nfilters: [ckf, tukf]\nseeds: {options.many // 2}\n"
        )
        memory = memory_over(short.groups(), options.many)
    n_runs = plan.n_runs
    rows = [
        (f"one after the other, {n_runs} runs", alone, ""),
        ("1 worker", one, f"{(one - alone) / alone:+.1%} of a run for handing out, bringing back and writing"),
        ("2 workers", two, f"{one / two:.2f} times 1 worker"),
    ]
    text = "\n".join(
        [
            *(f"- {name}: {value}" for name, value in described_machine().items()),
            "",
            "| default experiment, 3 filters | wall (s) | runs per second | |",
            "| --- | ---: | ---: | --- |",
            *(f"| {label} | {wall:.1f} | {n_runs / wall:.2f} | {note} |" for label, wall, note in rows),
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
