"""What the steps of the default experiment cost, one after the other in one process that has loaded everything."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median

from auvid_cli.config.load import find_experiment, load_experiment
from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.data.estimate_file import new_estimate, read_estimate
from auvid_cli.evaluation.bounds import Bounds, BoundsOf
from auvid_cli.evaluation.evaluate import evaluate
from auvid_cli.identification.identify import set_up_filters
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.simulation.simulate import simulate

_FILTERS = "all filters"


class Stages:
    """Wall time of each step, s, round by round."""

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = {}

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a step."""
        start = time.perf_counter()
        yield
        self.seconds.setdefault(name, []).append(time.perf_counter() - start)

    def rows(self) -> list[str]:
        """Return the lines of the table; shares are medians of those within a round."""
        filters = self.seconds[_FILTERS]
        return [
            f"| {name} | {median(own):.3f} | {min(own):.3f} - {max(own):.3f} "
            f"| {median(a / b for a, b in zip(own, filters, strict=True)):.1%} |"
            for name, own in self.seconds.items()
        ]


def stages(folder: Path, rounds: int) -> list[str]:
    """Write the table of the steps over some rounds, after one that is not timed."""
    one_round(folder, Stages())
    timed = Stages()
    for _ in range(rounds):
        one_round(folder, timed)
    return [
        "| step of the default run | wall, median (s) | min - max | share of the filters |",
        "| --- | ---: | ---: | ---: |",
        *timed.rows(),
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
    runs = set_up_filters(prepare(dataset), experiment.identification.filters)
    found = []
    with stages.step(_FILTERS):
        for run in runs:
            parts = []
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
