"""The steps of the main job, as the commands string them together."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from auvid_cli.cli.exit_codes import DONE, VERDICT_FAILED
from auvid_cli.cli.terminal import Terminal
from auvid_cli.config.experiment import Experiment, RunSettings
from auvid_cli.config.filter_name import FilterName
from auvid_cli.config.load import dump_experiment
from auvid_cli.config.plausibility import doubts
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.dataset_file import read_dataset
from auvid_cli.data.estimate import Estimate, EstimateChunk
from auvid_cli.data.estimate_file import read_estimate, record_estimate
from auvid_cli.data.netcdf import digest
from auvid_cli.data.replacement import other_estimates, other_run, put_dataset, refuse_unless
from auvid_cli.data.results_folder import dataset_in, estimates_in, products, remove, remove_former
from auvid_cli.data.screening import begin, screen
from auvid_cli.errors import FileError
from auvid_cli.report.remedies import remedies

if TYPE_CHECKING:
    from auvid_cli.evaluation.bounds import BoundsOf
    from auvid_cli.identification.filter_run import FilterRun
    from auvid_cli.identification.prepared_data import PreparedData
    from auvid_cli.report.figures.draw import FigureQueue


def results_folder(experiment: RunSettings, output: Path | None) -> Path:
    """Say where an experiment's results go."""
    return output if output is not None else Path("results") / experiment.name


def simulate_to(
    folder: Path,
    experiment: Experiment,
    terminal: Terminal,
    inputs: list[Path],
    overwrite: bool,
    filters: tuple[FilterName, ...] = (),
) -> Dataset:
    """Simulate an experiment into ``folder/dataset.h5`` and read it back, as any later step would.

    The same settings give the same data, and then the file stays as it is: what was made from it remains true.

    Parameters
    ----------
    folder : pathlib.Path
    experiment : Experiment
    terminal : Terminal
    inputs : list of pathlib.Path
        Files that the experiment is read from.
    overwrite : bool
        Whether results of another run may be replaced: all of them, as soon as the new data are there.
    filters : tuple of FilterName
        That will be run on it.

    Raises
    ------
    FileError
        If results of another run stand in the folder, and `overwrite` is not said.
    """
    path = dataset_in(folder)
    # What stands there is gone through by another process, while this one loads what it needs anyway.
    begin([path, *estimates_in(folder).values()])
    with terminal.compiling():
        import auvid_cli.simulation.simulate  # noqa: F401
    objection = other_run(path, experiment)
    if not objection and filters and path.exists():
        objection = next(iter(other_estimates(folder, experiment, digest(path), filters).values()), "")
    refuse_unless(overwrite, objection)
    say_doubts(experiment.vehicle, terminal)
    # Nothing holds on to what was simulated: hours of it fill a good part of a machine's memory.
    put_dataset(path, simulated(experiment, terminal), inputs, overwrite, objection)
    with terminal.stage("read the dataset"):
        dataset = read_dataset(path)
    sensors = ", ".join(f"{name} {record.time.size}" for name, record in dataset.sensors.items())
    terminal.say(f"{path}: {dataset.inputs.time[-1]:g} s of {experiment.manoeuvre.type}; samples: {sensors}")
    return dataset


def say_doubts(vehicle: VehicleSettings, terminal: Terminal) -> None:
    """Say what of a vehicle's numbers can hardly be, a line each."""
    for doubt in doubts(vehicle):
        terminal.say(f"note: vehicle {vehicle.name}: {doubt}")


def assess_to(folder: Path, dataset: Dataset, at: Path | None, terminal: Terminal) -> None:
    """Say what a dataset can tell of each coefficient at best: on the screen, in tables and in figures.

    The coefficients are those of an estimate file, if one is named.
    """
    coefficients, where = None, "the true coefficients" if dataset.truth is not None else "those of the vehicle file"
    vehicle = dataset.experiment.vehicle.name
    if at is not None:
        earlier = read_estimate(at)
        coefficients, where = earlier.final_coefficients(), f"those of {at}"
        if earlier.experiment.vehicle.name != vehicle:
            where += f", which is of another vehicle ({earlier.experiment.vehicle.name})"
    with terminal.compiling():
        from auvid_cli.evaluation.identifiability import assess_dataset
        from auvid_cli.report.csv_tables import write_csv_tables
        from auvid_cli.report.screen import print_identifiability
    with terminal.stage("sensitivities"):
        identifiability = assess_dataset(dataset, coefficients)
    paths = write_csv_tables(identifiability.tables(), folder / "tables")
    with drawing(folder) as figures, terminal.progress("figures") as (progress,):
        figures.add_identifiability(identifiability)
        paths += figures.finish(progress)
    terminal.say(f"{vehicle}, at {where}:")
    print_identifiability(terminal.out, identifiability)
    for path in paths:
        terminal.say(str(path))


def simulated(experiment: Experiment, terminal: Terminal) -> Dataset:
    """Simulate an experiment's dataset, without a file."""
    with terminal.compiling():
        from auvid_cli.simulation.simulate import simulate
    with terminal.stage("simulate"):
        return simulate(experiment)


def identify_to(
    folder: Path,
    prepared: "PreparedData",
    filters: tuple[FilterName, ...],
    terminal: Terminal,
    overwrite: bool,
    on_estimate: Callable[[Estimate], None] = lambda estimate: None,
) -> list[Estimate]:
    """Run filters on a dataset side by side, each writing its estimate as it goes; `on_estimate` each when it is there.

    Raises
    ------
    FileError
        If estimates stand there that are of other data, or were made with other settings, and `overwrite` is not said;
        else those, and all that was made from them, go when the new ones are there.
    """
    others = other_estimates(folder, prepared.experiment, prepared.dataset.sha256, filters)
    refuse_unless(overwrite, next(iter(others.values()), ""))
    with terminal.compiling():
        from auvid_cli.evaluation.consistency import status_of
        from auvid_cli.identification.identify import set_up_filters

        names = list(dict.fromkeys(filters))
        stopping = Event()

        def raise_if_cancelled() -> None:
            if stopping.is_set():
                raise _StoppedError

        # Some filters load libraries of their own here, which may swallow an interrupt as well.
        runs = set_up_filters(prepared, names, raise_if_cancelled)
    paths = [folder / "estimates" / f"{name.value}.h5" for name in names]
    with (
        terminal.progress(*(name.value for name in names), unit=" s of data") as bars,
        ThreadPoolExecutor(os.cpu_count()) as threads,
    ):
        try:
            jobs = zip(runs, paths, bars, strict=True)
            futures = [threads.submit(_run_filter, *job) for job in jobs]
            for future in as_completed(futures):
                on_estimate(future.result())
        finally:
            # Whatever went wrong, an interrupt included, ends the others at their next chunk.
            stopping.set()
    estimates = [future.result() for future in futures]
    if others:
        kept = {*paths, *(path for path in estimates_in(folder).values() if path not in others)}
        remove(path for path in products(folder) if path not in kept)
    for path, estimate in zip(paths, estimates, strict=True):
        terminal.say(f"{path}: {status_of(estimate)}; {estimate.cpu_time:.2f} s of processor time")
    return estimates


class _StoppedError(Exception):
    """The end of a filter because another failed, or the user has had enough."""


def _run_filter(filter_run: "FilterRun", path: Path, progress: Callable[[float, float], None]) -> Estimate:
    begin, end = filter_run.span

    def watch(chunk: EstimateChunk) -> None:
        if chunk.time.size:
            progress(chunk.time[-1] - begin, end - begin)

    return record_estimate(path, filter_run.header, filter_run.run, watch)


def prepare(dataset: Dataset, terminal: Terminal) -> "PreparedData":
    """Prepare a dataset once for all that goes through it."""
    with terminal.compiling():
        from auvid_cli.identification import prepared_data
    return prepared_data.prepare(dataset)


def bounds_of(prepared: "PreparedData", terminal: Terminal) -> "BoundsOf":
    """Return what finds the bounds of a dataset's estimates."""
    with terminal.compiling():
        from auvid_cli.evaluation.bounds import BoundsOf
    return BoundsOf(prepared)


def report_to(
    folder: Path,
    prepared: "PreparedData",
    estimates: list[Estimate],
    bounds_of: "BoundsOf",
    terminal: Terminal,
    figures: "FigureQueue",
) -> int:
    """Write tables and figures, print the summary; the exit code says whether a verdict failed."""
    with terminal.compiling():
        from auvid_cli.evaluation.evaluate import evaluate
        from auvid_cli.report.screen import print_files, print_summary
        from auvid_cli.report.write import write_tables
    with terminal.stage("evaluate"):
        evaluation = evaluate(prepared, estimates, bounds_of)
    figures.add_others(prepared.dataset, estimates, evaluation)
    paths = write_tables(evaluation, folder / "tables")
    print_summary(terminal.out, evaluation)
    for line in remedies(estimates):
        terminal.say(line)
    with terminal.progress("figures") as (progress,):
        paths += figures.finish(progress)
    remove_former(folder, paths, [estimate.filter for estimate in estimates])
    print_files(terminal.out, paths)
    return exit_code(row.grade for row in evaluation.summary)


@contextmanager
def drawing(folder: Path) -> Iterator["FigureQueue"]:
    """Say where to put the figures of a results folder, with workers that draw them."""
    from auvid_cli.report.figures.draw import FigureQueue
    from auvid_cli.report.figures.workers import figure_workers

    with figure_workers() as submit:
        yield FigureQueue(folder / "figures", submit)


def say_judgements(estimates: list[Estimate], terminal: Terminal) -> int:
    """Say what each estimate is worth, and what may help; the exit code says whether one is worth little."""
    with terminal.compiling():
        from auvid_cli.evaluation.judgement import judge
    judgements = judge(estimates)
    for name, judgement in judgements.items():
        terminal.say(f"{name}: {judgement}")
    for line in remedies(estimates):
        terminal.say(line)
    return exit_code(judgement.grade for judgement in judgements.values())


def exit_code(grades: Iterable[str]) -> int:
    """Return 1 if an estimate is worse than sound; one that nobody was asked to judge is not."""
    return DONE if all(grade in ("sound", "unjudged") for grade in grades) else VERDICT_FAILED


def dataset_of(experiment: RunSettings, folder: Path) -> Dataset:
    """Read the simulated dataset of an experiment, with the experiment's present identification settings.

    Raises
    ------
    FileError
        If there is none, or if it was simulated with other settings than the experiment has now.
    """
    path = dataset_in(folder)
    if not path.is_file():
        raise FileError(f"{path}: no such dataset; make it with `auvid simulate`, or do all with `auvid run`")
    dataset = read_dataset(path)
    for part in ("seed", "vehicle", "sensors", "manoeuvre"):
        if getattr(dataset.experiment, part, None) != getattr(experiment, part, None):
            raise FileError(
                f"{path}: was simulated with other settings of `{part}` than the experiment has now; run "
                "`auvid simulate` again, give the same --set here, or name the dataset file to identify it as it is"
            )
    return Dataset(dataset.inputs, dataset.sensors, experiment, dataset.truth, dataset.sha256)


def dataset_path(source: str | None) -> Path | None:
    """Return the path of a dataset file, or None where an experiment is meant."""
    return Path(source) if source is not None and source.endswith((".h5", ".hdf5")) else None


def home_of(path: Path) -> Path:
    """Return the results folder of a dataset file: its own folder if it is one, else results/STEM."""
    return path.parent if path.name == "dataset.h5" else Path("results") / path.stem


def read_results(folder: Path) -> tuple[Dataset, list[Estimate]]:
    """Read dataset and estimates of a results folder, estimates in the order of `FilterName`.

    Raises
    ------
    FileError
        If something is missing or an estimate belongs to another dataset.
    """
    paths = estimates_in(folder)
    screen([dataset_in(folder), *paths.values()])
    dataset, estimates = read_dataset(dataset_in(folder)), [read_estimate(path) for path in paths.values()]
    if not estimates:
        raise FileError(f"{folder / 'estimates'}: no estimates; make them with `auvid identify`")
    for (name, path), estimate in zip(paths.items(), estimates, strict=True):
        if estimate.filter != name.value:
            raise FileError(f"{path}: is an estimate of {estimate.filter}; give it the name of its filter")
        if estimate.dataset_sha256 != dataset.sha256:
            raise FileError(
                f"{folder / 'estimates' / estimate.filter}.h5: was made from another dataset than "
                f"{folder / 'dataset.h5'}; run `auvid identify` again"
            )
    for why in other_estimates(folder, estimates[0].experiment, dataset.sha256, ()).values():
        raise FileError(f"{why} than that of {estimates[0].filter}, and tables show all together; identify again")
    if dataset.truth is None:
        # Nothing else says which of them is right.
        estimates.sort(key=lambda estimate: estimate.filter != FilterName.SMOOTHER)
    return dataset, estimates


def print_settings(experiment: RunSettings) -> None:
    """Print resolved settings as YAML on the standard output."""
    print(dump_experiment(experiment), end="")
