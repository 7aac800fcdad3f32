"""Design of the next run, step by step, and the files that a crew needs for it."""

import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from hashlib import sha256
from pathlib import Path
from time import monotonic
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

import auvid_cli.identification.observation  # noqa: F401  compiled at import, not while a design is searched for
from auvid_cli._version import __version__
from auvid_cli.api.files import read_dataset, read_estimate
from auvid_cli.api.output import Progress
from auvid_cli.campaign.cluster import cluster_client
from auvid_cli.config.enums import FigureFormat
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import dump_experiment
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.files import check_no_overlap, write_text
from auvid_cli.data.findings import SearchState, read_search, write_search
from auvid_cli.data.netcdf import digest
from auvid_cli.data.results import refuse_unless
from auvid_cli.design.envelope import Band, band_of
from auvid_cli.design.mission import checklist_markdown, inputs_csv, manoeuvre_yaml, timeline_markdown, track_geojson
from auvid_cli.design.posterior import left_out
from auvid_cli.design.problem import DesignProblem, InHand, Requirement, band, set_task
from auvid_cli.design.search import Design, Reached, conclude, search
from auvid_cli.design.trials import Flight, Map
from auvid_cli.errors import DataError
from auvid_cli.evaluation.bounds import information_with_process_noise, probable_motion
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import resolve_settings
from auvid_cli.report.figures.draw import drawing
from auvid_cli.report.screens import sentences

Array = NDArray[np.float64]


def information_in_hand(experiment: Experiment, named: Mapping[str, Dataset]) -> InHand | None:
    """Return what finds the Fisher information of datasets about an experiment's coefficients; None without any.

    With process noise, about the trajectory along the measurements, by the settings of each dataset. Errors that are
    estimated there beside the coefficients are known no better than by their priors, and count as that.

    Parameters
    ----------
    experiment : Experiment
        For which a run is designed.
    named : mapping
        Datasets, by the names of their files.
    """
    if not named:
        return None
    vehicle = experiment.vehicle
    symbols, wanted = vehicle.coefficient_set.symbols, experiment.identification.estimated(vehicle)

    def in_hand(values: Mapping[str, float]) -> Array:
        total = np.zeros((len(symbols), len(symbols)))
        for name, dataset in named.items():
            known, matrix = _information(name, dataset, values, wanted)
            places = [symbols.index(symbol) for symbol in known]
            total[np.ix_(places, places)] += matrix
        return total

    return in_hand


def _information(
    name: str, dataset: Dataset, values: Mapping[str, float], wanted: Sequence[str]
) -> tuple[list[str], Array]:
    """Return the coefficients that a dataset tells of, and the information about them, SI."""
    estimated = dataset.experiment.identification.estimated(dataset.experiment.vehicle)
    if odd := [symbol for symbol in estimated if symbol not in values]:
        raise DataError(f"--given {name}: estimates {odd[0]}, which the vehicle of this design does not have")
    if held := [symbol for symbol in wanted if symbol not in estimated]:
        raise DataError(
            f"--given {name}: holds {', '.join(held)}, so that what it says of the others presumes it; hold it here as "
            "well (--set identification.coefficients=...)"
        )
    about = probable_motion(resolve_settings(prepare(dataset)), values)
    if about is None:
        raise DataError(
            f"--given {name}: no trajectory follows its measurements with the coefficients of this design; name an "
            "estimate from it (--at FILE)"
        )
    information = information_with_process_noise(about)
    inside = [place for place, symbol in enumerate(information.symbols) if symbol in estimated]
    beside = [place for place, symbol in enumerate(information.symbols) if symbol not in estimated]
    across = information.matrix[np.ix_(inside, beside)]
    errors = information.matrix[np.ix_(beside, beside)] + np.eye(len(beside))
    matrix = information.matrix[np.ix_(inside, inside)] - across @ np.linalg.solve(errors, across.T)
    unit = information.prior_std[inside]
    return [information.symbols[place] for place in inside], matrix / np.outer(unit, unit)


class Mission(NamedTuple):
    """Files for a crew.

    Attributes
    ----------
    band : Band
    texts : dict of str
        Texts of the files, by name.
    """

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


class SearchLimits(NamedTuple):
    """When a search ends: after a number of generations, or where that is None after a time, s."""

    generations: int | None
    time: float | None


def search_until(
    task: DesignProblem, limits: SearchLimits, file: Path, key: str, overwrite: bool, progress: Progress
) -> Reached:
    """Search for better manoeuvres until the limits are reached, or the user interrupts.

    Parameters
    ----------
    task : Task
    limits : SearchLimits
        Limits of this search together with an earlier one that it continues.
    file : pathlib.Path
        State of the search, written after each generation; the search continues from one that is there.
    key : str
        See `search_key`: a state of another search is refused, unless it may be overwritten.
    overwrite : bool
    progress : Progress

    Raises
    ------
    FileError
        If the file is of another search, damaged, or cannot be written.
    """
    earlier = read_search(file)
    if earlier is not None and earlier.key != key:
        refuse_unless(overwrite, f"{file} is of a search with other settings")
        earlier = None
    before, spent = ((), 0.0) if earlier is None else (earlier.costs, earlier.elapsed)
    if before:
        progress.message(f"goes on after {len(before)} generations and {spent:.0f} s ({file})")
    start, latest = monotonic() - spent, None
    with progress.bars("design") as (advance,):
        try:
            for reached in searching(task, before):
                latest, elapsed = reached, monotonic() - start
                if reached.generation > len(before):
                    write_search(file, SearchState(key, elapsed, reached.costs))
                note = f", {reached.evaluations} manoeuvres, x{task.gain_of(reached.best):.2f} so far"
                done, total = (elapsed, limits.time) if limits.time else (reached.generation, limits.generations)
                assert total is not None, "a search has a limit"
                advance(min(done, total), total, note)
                if done >= total:
                    break
        except KeyboardInterrupt:
            if latest is None:
                raise
            progress.message("interrupted: the best so far is kept; with --overwrite the same command goes on")
    assert latest is not None, "a search has a first generation"
    return latest


def searching(task: DesignProblem, before: tuple[tuple[float, ...], ...] = ()) -> Iterator[Reached]:
    """Look for better manoeuvres, without an end, perhaps on from the costs of an earlier search."""
    return search(task.space, task.seen, task.experiment.seed, before)


def search_key(experiment: Experiment, wish: Requirement, files: Iterable[Path]) -> str:
    """Return the same for the same search: of settings, wishes and the contents of files."""
    parts = [__version__, dump_experiment(experiment), repr(wish), *map(digest, files)]
    return sha256("\n".join(parts).encode()).hexdigest()


def mission(task: DesignProblem, design: Design, remark: str, origin: tuple[float, float]) -> Mission:
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


FILES = "manoeuvre.yaml", "inputs.csv", "track.geojson", "timeline.md", "checklist.md", "result.md"
STATE = "search.json"


class DesignSources(NamedTuple):
    """Sources of a design: an experiment, the files it was read from, an estimate file, and dataset files."""

    experiment: Experiment
    files: list[Path]
    at: Path | None
    given: list[Path]


def design_into(
    folder: Path,
    sources: DesignSources,
    wish: Requirement,
    limits: SearchLimits,
    scheduler: str | None,
    origin: tuple[float, float],
    overwrite: bool,
    figure_formats: Collection[FigureFormat],
    progress: Progress,
) -> tuple[Design, list[Path]]:
    """Design a run, and write the files that a crew needs into a folder; returns the design and the files.

    Parameters
    ----------
    folder : pathlib.Path
    sources : DesignSources
    wish : Wish
    limits : SearchLimits
    scheduler : str or None
        Address of a Dask scheduler. None: the cores of this machine.
    origin : tuple of float
        Latitude and longitude of the start, degrees.
    overwrite, figure_formats, progress
        As of `auvid_cli.run`.

    Raises
    ------
    FileError
        If an earlier design is there, and `overwrite` is false.
    ClusterError
        If the scheduler does not answer, or its workers have another version of auvid.
    """
    experiment, paths = sources.experiment, [folder / name for name in FILES]
    standing = next((path for path in paths if path.exists()), None)
    refuse_unless(overwrite, "" if standing is None else f"{standing} is there already")
    read = [*([] if sources.at is None else [sources.at]), *sources.given]
    check_no_overlap([*paths, folder / STATE], [*sources.files, *read])
    with ExitStack() as stack:
        spread = None if scheduler is None else stack.enter_context(_spread_over(scheduler))
        estimate = None if sources.at is None else read_estimate(sources.at)
        data = {str(path): read_dataset(path) for path in sources.given}
        task = stack.enter_context(designing(experiment, wish, estimate, data, spread))
        progress.message(f"{experiment.vehicle.name}: {wish.draws} drawn from {task.belief.origin}")
        for name in left_out(experiment):
            progress.message(f"note: not counted: {name}")
        for path in data:
            progress.message(f"known already: what {path} says")
        key = search_key(experiment, wish, read)
        reached = search_until(task, limits, folder / STATE, key, overwrite, progress)
        with progress.stage("compare"):
            design = conclude(task, reached)
            gain = "the spiral itself" if design.is_own else f"{design.chosen}, x{design.gain:.2f} over the spiral"
            remark = f"auvid design, seed {experiment.seed}, {reached.generation} generations: {gain}"
            found = mission(task, design, remark, origin)
    texts = found.texts | {"result.md": "\n".join(f"- {line}" for line in sentences(design)) + "\n"}
    for name, text in texts.items():
        write_text(folder / name, text)
    with drawing(folder, figure_formats) as figures, progress.stage("figure"):
        figures.add_mission(design, found.band)
        drawn = figures.finish()
    return design, [*(folder / name for name in texts), *drawn]


@contextmanager
def _spread_over(scheduler: str) -> Iterator[Map]:
    """Connect to a Dask scheduler and yield a function that tries manoeuvres on its workers, as `map`."""
    with cluster_client(scheduler, None) as client:
        # A client of this process is not awaited.
        yield lambda work, items: cast("list[Flight]", client.gather(client.map(work, list(items), pure=False)))
