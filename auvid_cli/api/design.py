"""A design, step by step, and the files that a crew needs of it."""

import os
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from auvid_cli import __version__
from auvid_cli.api.data_in_hand import information_in_hand
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.load import dump_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.netcdf import digest
from auvid_cli.design.band import Band, band_of
from auvid_cli.design.conclusion import Design, conclude
from auvid_cli.design.mission import (
    checklist_markdown,
    inputs_csv,
    manoeuvre_yaml,
    timeline_markdown,
    track_geojson,
)
from auvid_cli.design.posterior import left_out
from auvid_cli.design.search import Reached, search
from auvid_cli.design.task import Task, Wish, band, set_task
from auvid_cli.design.trials import Flight, Map

__all__ = [
    "Design",
    "Flight",
    "Map",
    "Mission",
    "Reached",
    "Task",
    "Wish",
    "conclude",
    "designing",
    "left_out",
    "mission",
    "search_key",
    "searching",
]


class Mission(NamedTuple):
    """What a crew gets.

    Attributes
    ----------
    band : Band
    texts : dict of str
        Of files, by name.
    """

    band: Band
    texts: dict[str, str]


@contextmanager
def designing(
    experiment: Experiment,
    wish: Wish,
    estimate: Estimate | None = None,
    given: Mapping[str, Dataset] | None = None,
    spread: Map | None = None,
) -> Iterator[Task]:
    """Set a task that all cores work at, or what else spreads it, see `set_task`.

    Parameters
    ----------
    experiment : Experiment
    wish : Wish
    estimate : Estimate, optional
        Vehicles are drawn from it.
    given : mapping of Dataset, optional
        Data that are there already, by the names of their files: what they say counts as known.
    spread : callable, optional
        As `map`.

    Raises
    ------
    ConfigError, DataError
        As `set_task`, and if data cannot be counted.
    """
    in_hand = information_in_hand(experiment, given or {})
    if spread is not None:
        yield set_task(experiment, wish, estimate, in_hand, spread)
        return
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        yield set_task(experiment, wish, estimate, in_hand, threads.map)


def searching(task: Task, before: tuple[tuple[float, ...], ...] = ()) -> Iterator[Reached]:
    """Look for better manoeuvres, without an end, perhaps on from the costs of an earlier search."""
    return search(task.space, task.seen, task.experiment.seed, before)


def search_key(experiment: Experiment, wish: Wish, files: Iterable[Path]) -> str:
    """Return the same for the same search: of settings, wishes and the contents of files."""
    parts = [__version__, dump_experiment(experiment), repr(wish), *map(digest, files)]
    return sha256("\n".join(parts).encode()).hexdigest()


def mission(task: Task, design: Design, remark: str, origin: tuple[float, float]) -> Mission:
    """Make the files of a manoeuvre.

    Parameters
    ----------
    task : Task
    design : Design
    remark : str
        Where it comes from, for the settings.
    origin : tuple of float
        Latitude and longitude of the start, degrees.
    """
    vehicle, manoeuvre = task.experiment.vehicle, design.manoeuvre
    around = band_of(band(task, manoeuvre))
    fins = None if vehicle.geometry is None else vehicle.geometry.fins
    return Mission(
        around,
        {
            "manoeuvre.yaml": manoeuvre_yaml(manoeuvre, remark),
            "inputs.csv": inputs_csv(manoeuvre, fins),
            "track.geojson": track_geojson(around, origin),
            "timeline.md": timeline_markdown(around, task.wish.envelope, task.slowest, manoeuvre.excitation.fade_in),
            "checklist.md": checklist_markdown(manoeuvre, vehicle, around),
        },
    )
