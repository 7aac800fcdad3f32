"""Design of the next run, and the mission files for the crew."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from hashlib import sha256
from pathlib import Path
from time import monotonic
from typing import NamedTuple, cast

import numpy as np

import auvid_cli.identification.sensors  # noqa: F401  compiled at import, not while a design is searched for
from auvid_cli._version import __version__
from auvid_cli.api import Destination
from auvid_cli.api.files import SimulatedData, read_dataset, read_estimate
from auvid_cli.arrays import Array
from auvid_cli.campaign.cluster import dask_client
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import dump_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.files import check_no_overlap, locked, remove, write_text
from auvid_cli.data.findings import SearchState, read_search, write_search
from auvid_cli.data.netcdf import digest
from auvid_cli.data.results import refuse_unless
from auvid_cli.design.mission import (
    Band,
    checklist_markdown,
    inputs_csv,
    manoeuvre_yaml,
    summarise_runs,
    timeline_markdown,
    track_geojson,
)
from auvid_cli.design.posterior import uncounted_information
from auvid_cli.design.problem import DesignProblem, EarlierInformation, Requirement, make_problem, simulate_draws
from auvid_cli.design.search import Design, SearchProgress, conclude, search
from auvid_cli.design.trials import Map, TrialRun
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.evaluation.bounds import information_with_process_noise, probable_motion
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import resolve_settings
from auvid_cli.report.figures.draw import drawing
from auvid_cli.report.screens import sentences

MISSION_FILES = ("manoeuvre.yaml", "inputs.csv", "track.geojson", "timeline.md", "checklist.md", "result.md")
SEARCH_FILE = "search.json"


def _information_in_hand(experiment: Experiment, named: Mapping[str, Dataset]) -> EarlierInformation | None:
    """Return a function that computes the Fisher information of existing datasets, by file name; None without any.

    The information is about the coefficients of the experiment. It takes process noise into account and is linearised
    along the estimated trajectory. Sensor errors that are estimated too are known only by their priors.
    """
    if not named:
        return None
    vehicle = experiment.vehicle
    symbols, wanted = vehicle.coefficient_set.symbols, experiment.identification.estimated(vehicle)

    def in_hand(values: Mapping[str, float]) -> Array:
        total = np.zeros((len(symbols), len(symbols)))
        for name, dataset in named.items():
            informed, matrix = _information(name, dataset, values, wanted)
            places = [symbols.index(symbol) for symbol in informed]
            total[np.ix_(places, places)] += matrix
        return total

    return in_hand


def _information(
    name: str, dataset: Dataset, values: Mapping[str, float], wanted: Sequence[str]
) -> tuple[list[str], Array]:
    """Return the coefficients that a dataset estimates, and their Fisher information, SI."""
    estimated = dataset.experiment.identification.estimated(dataset.experiment.vehicle)
    if odd := [symbol for symbol in estimated if symbol not in values]:
        raise DataError(f"--given {name}: estimates {odd[0]}; expected only coefficients of the vehicle of this design")
    if held := [symbol for symbol in wanted if symbol not in estimated]:
        raise DataError(
            f"--given {name}: keeps {', '.join(held)} fixed; expected the same in this design "
            "(--set identification.coefficients=...)"
        )
    about = probable_motion(resolve_settings(prepare(dataset)), values)
    if about is None:
        raise DataError(
            f"--given {name}: no trajectory follows its measurements with the coefficients of this design; use an "
            "estimate from this dataset (--at FILE)"
        )
    information = information_with_process_noise(about)
    inside = [place for place, symbol in enumerate(information.symbols) if symbol in estimated]
    others = [place for place, symbol in enumerate(information.symbols) if symbol not in estimated]
    across = information.matrix[np.ix_(inside, others)]
    errors = information.matrix[np.ix_(others, others)] + np.eye(len(others))
    matrix = information.matrix[np.ix_(inside, inside)] - across @ np.linalg.solve(errors, across.T)
    unit = information.prior_std[inside]
    return [information.symbols[place] for place in inside], matrix / np.outer(unit, unit)


class Mission(NamedTuple):
    """Mission of a designed manoeuvre: the range of motions of all trial vehicles, and texts of files by name."""

    band: Band
    texts: dict[str, str]


@contextmanager
def designing(
    experiment: Experiment,
    wish: Requirement,
    estimate: Estimate | None = None,
    given: Mapping[str, Dataset] | None = None,
    spread: Map | None = None,
) -> Iterator[DesignProblem]:
    """Yield a design problem that is computed in parallel.

    Parameters
    ----------
    estimate : Estimate, optional
        Estimate that trial vehicles are drawn from.
    given : mapping of Dataset, optional
        Existing datasets whose information counts as well, by name of their file.
    spread : callable, optional
        Parallel `map`. Default: threads on all cores.
    """
    in_hand = _information_in_hand(experiment, given or {})
    if spread is not None:
        yield make_problem(experiment, wish, estimate, in_hand, spread)
        return
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        yield make_problem(experiment, wish, estimate, in_hand, threads.map)


class SearchLimits(NamedTuple):
    """Limits of a search: a number of generations, or a time, s, if that is None."""

    generations: int | None
    time: float | None


def _search_until(
    task: DesignProblem, limits: SearchLimits, file: Path, key: str, place: Destination
) -> SearchProgress:
    """Search for better manoeuvres until the limits are reached, or the user interrupts.

    The state is written to `file` after each generation, and the search continues from an existing one, whose
    generations and time count as well. A state with another key than `key` is refused unless it may be overwritten.
    """
    progress, earlier = place.progress, read_search(file)
    if earlier is not None and earlier.key != key:
        refuse_unless(place.overwrite, f"{file}: belongs to a search with other settings")
        earlier = None
    before, spent = ((), 0.0) if earlier is None else (earlier.costs, earlier.elapsed)
    if before:
        progress.message(f"continues after {len(before)} generations and {spent:.0f} s ({file})")
    start, latest = monotonic() - spent, None
    with progress.bars("design") as (advance,):
        try:
            for reached in searching(task, before):
                latest, elapsed = reached, monotonic() - start
                if reached.generation > len(before):
                    write_search(file, SearchState(key, elapsed, reached.costs))
                note = f", {reached.evaluations} manoeuvres, gain x{task.gain_over_spiral(reached.best):.2f} so far"
                done, total = (elapsed, limits.time) if limits.time else (reached.generation, limits.generations)
                assert total is not None, "a search has a limit"
                advance(min(done, total), total, note)
                if done >= total:
                    break
        except KeyboardInterrupt:
            if latest is None:
                raise
            progress.message(
                "interrupted: the best manoeuvre is kept; the same command with --overwrite continues the search"
            )
    assert latest is not None, "a search has a first generation"
    return latest


def searching(task: DesignProblem, before: tuple[tuple[float, ...], ...] = ()) -> Iterator[SearchProgress]:
    """Yield better and better manoeuvres, endlessly; `before` has the costs of an earlier search to continue."""
    return search(task.space, task.search_set, task.experiment.seed, before)


def _search_key(experiment: Experiment, wish: Requirement, files: Iterable[Path]) -> str:
    """Return a digest of the inputs of a search: version, settings, requirement and contents of files."""
    parts = [__version__, dump_experiment(experiment), repr(wish), *map(digest, files)]
    return sha256("\n".join(parts).encode()).hexdigest()


def mission(task: DesignProblem, design: Design, remark: str, origin: tuple[float, float]) -> Mission:
    """Return the mission files of a manoeuvre.

    Parameters
    ----------
    remark : str
        Source of the manoeuvre; a comment in the settings file.
    origin : tuple of float
        Latitude and longitude of the start, degrees.
    """
    vehicle, manoeuvre = task.experiment.vehicle, design.manoeuvre
    around = summarise_runs(simulate_draws(task, manoeuvre))
    fins = None if vehicle.geometry is None else vehicle.geometry.fins
    return Mission(
        around,
        {
            "manoeuvre.yaml": manoeuvre_yaml(manoeuvre, remark),
            "inputs.csv": inputs_csv(manoeuvre, fins),
            "track.geojson": track_geojson(around, origin),
            "timeline.md": timeline_markdown(
                around, task.requirement.envelope, task.slowest, manoeuvre.excitation.fade_in
            ),
            "checklist.md": checklist_markdown(manoeuvre, vehicle, around),
        },
    )


class DesignSources(NamedTuple):
    """Sources of a design: an experiment, an estimate file, and dataset files."""

    base: SimulatedData
    at: Path | None
    given: list[Path]


def design_into(
    place: Destination,
    sources: DesignSources,
    wish: Requirement,
    limits: SearchLimits,
    scheduler: str | None,
    origin: tuple[float, float],
) -> tuple[Design, list[Path]]:
    """Design a run, and write the mission files into a folder; returns the design and the files.

    Parameters
    ----------
    place : Destination
        Default folder: ``mission``.
    scheduler : str or None
        Address of a Dask scheduler. None: the cores of this machine.
    origin : tuple of float
        Latitude and longitude of the start, degrees.
    """
    folder, progress, experiment = place.folder or Path("mission"), place.progress, sources.base.experiment
    paths = [folder / name for name in MISSION_FILES]
    read = [*([] if sources.at is None else [sources.at]), *sources.given]
    check_no_overlap([*paths, folder / SEARCH_FILE], [*sources.base.files, *read])
    with ExitStack() as stack:
        spread = None if scheduler is None else stack.enter_context(_spread_over(scheduler))
        estimate = None if sources.at is None else read_estimate(sources.at)
        data = {str(path): read_dataset(path) for path in sources.given}
        stack.enter_context(locked(folder))
        refuse_unless(place.overwrite, next((f"{path}: exists already" for path in paths if path.exists()), ""))
        task = stack.enter_context(designing(experiment, wish, estimate, data, spread))
        progress.message(
            f"{experiment.vehicle.name}: {wish.draws} trial vehicles drawn from {task.distribution.origin}"
        )
        if estimate is not None and isinstance(estimate.experiment, Experiment):
            progress.message(f"note: {sources.at} is an estimate from simulated data, not from a real vehicle")
        for name in uncounted_information(experiment):
            progress.message(f"note: not included in the design: {name}")
        for path in data:
            progress.message(f"information already available: {path}")
        key = _search_key(experiment, wish, read)
        reached = _search_until(task, limits, folder / SEARCH_FILE, key, place)
        with progress.stage("compare"):
            try:
                design = conclude(task, reached)
            except ConfigError:
                # No manoeuvre fits. The message advises other limits, which this search does not have.
                remove([folder / SEARCH_FILE])
                raise
            gain = (
                "the spiral itself" if design.keeps_spiral else f"{design.chosen}, x{design.gain:.2f} over the spiral"
            )
            remark = f"auvid design, seed {experiment.seed}, {reached.generation} generations: {gain}"
            found = mission(task, design, remark, origin)
        texts = found.texts | {"result.md": "\n".join(f"- {line}" for line in sentences(design)) + "\n"}
        for name, text in texts.items():
            write_text(folder / name, text)
        with drawing(folder, place.figure_formats) as figures, progress.stage("figure"):
            figures.add_mission(design, found.band)
            drawn = figures.finish()
    return design, [*(folder / name for name in texts), *drawn]


@contextmanager
def _spread_over(scheduler: str) -> Iterator[Map]:
    """Connect to a Dask scheduler, and yield a `map` that simulates trials on its workers."""
    with dask_client(scheduler) as client:
        # The client is synchronous, so the result is not awaited.
        yield lambda work, items: cast("list[TrialRun]", client.gather(client.map(work, list(items), pure=False)))
