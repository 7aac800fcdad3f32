"""What the steps of the default experiment cost, one after the other in one process that has loaded everything."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

from threadpoolctl import threadpool_limits

from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.data.estimate_file import new_estimate, read_estimate
from auvid_cli.evaluation.bounds import Bounds, BoundsOf
from auvid_cli.evaluation.evaluate import evaluate
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import set_up_filters
from auvid_cli.simulation.simulate import simulate

_FILTERS = "all filters"


class Spent(NamedTuple):
    """Wall and processor time, s."""

    wall: float
    processor: float


class Stages:
    """What each step took, round by round."""

    def __init__(self) -> None:
        self.spent: dict[str, list[Spent]] = {}

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a step."""
        start, processor = time.perf_counter(), time.process_time()
        yield
        spent = Spent(time.perf_counter() - start, time.process_time() - processor)
        self.spent.setdefault(name, []).append(spent)

    def ratios(self, name: str, other: str) -> list[float]:
        """Return the processor time of a step by that of another, round by round."""
        pairs = zip(self.spent[name], self.spent[other], strict=True)
        return [one.processor / another.processor for one, another in pairs]

    def rows(self) -> list[str]:
        """Return the lines of the table; shares are medians of those within a round."""
        return [
            f"| {name} | {median(spent.wall for spent in own):.3f} "
            f"| {min(spent.wall for spent in own):.3f} - {max(spent.wall for spent in own):.3f} "
            f"| {median(spent.processor for spent in own):.3f} | {median(self.ratios(name, _FILTERS)):.1%} |"
            for name, own in self.spent.items()
        ]


def stages(folder: Path, rounds: int) -> list[str]:
    """Write the table of the steps over some rounds, after one that is not timed."""
    timed = Stages()
    # As in the command.
    with threadpool_limits(1):
        one_round(folder, Stages())
        for _ in range(rounds):
            one_round(folder, timed)
    ratios = timed.ratios(JUDGE.value, FilterName.CKF.value)
    return [
        "| step of the default run | wall, median (s) | min - max | processor (s) | share of the filters |",
        "| --- | ---: | ---: | ---: | ---: |",
        *timed.rows(),
        "",
        f"The smoother takes {median(ratios):.1f} times the CKF's time ({min(ratios):.1f} - {max(ratios):.1f}).",
    ]


def one_round(folder: Path, stages: Stages) -> None:
    """Do all that `auvid run` does but figures and the screen."""
    experiment = load_experiment(find_experiment(None), ())
    with stages.step("simulate"):
        dataset = simulate(experiment)
    with stages.step("write the dataset"):
        write_dataset(folder / "dataset.h5", dataset)
    with stages.step("read the dataset"):
        dataset = read_dataset(folder / "dataset.h5")
    settings, found = experiment.identification, []
    runs = set_up_filters(prepare(dataset), settings.with_judge(settings.default_filters()))
    with stages.step(_FILTERS):
        for run in runs:
            parts = []
            with stages.step(run.header.filter):
                found.append((parts, run.run(parts.append)))
    with stages.step("write the estimates"):
        for run, (parts, outcome) in zip(runs, found, strict=True):
            with new_estimate(folder / f"{run.header.filter}.h5", run.header) as writer:
                for part in parts:
                    writer.append(part)
                writer.finish(outcome)
    with stages.step("read the estimates"):
        estimates = [read_estimate(folder / f"{run.header.filter}.h5") for run in runs]
    with stages.step("evaluate"):
        evaluate(prepare(dataset), estimates, lambda estimate: Bounds({}, {}))
    bounds_of = BoundsOf(prepare(dataset))
    with stages.step("bounds, found while a filter runs"):
        for estimate in estimates:
            bounds_of(estimate)
