"""A design, step by step, and the files that a crew needs of it."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import NamedTuple

from auvid_cli.config.experiment import Experiment
from auvid_cli.data.estimate import Estimate
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

__all__ = ["Design", "Mission", "Reached", "Task", "Wish", "conclude", "designing", "left_out", "mission", "searching"]


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
def designing(experiment: Experiment, wish: Wish, estimate: Estimate | None = None) -> Iterator[Task]:
    """Set a task that all cores work at, see `set_task`."""
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        yield set_task(experiment, wish, estimate, threads.map)


def searching(task: Task) -> Iterator[Reached]:
    """Look for better manoeuvres, without an end."""
    return search(task.space, task.seen, task.experiment.seed)


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
            "timeline.md": timeline_markdown(around, task.wish.envelope, task.slowest),
            "checklist.md": checklist_markdown(manoeuvre, vehicle, around),
        },
    )
