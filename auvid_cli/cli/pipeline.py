"""The steps of the main job, as the commands string them together."""

import shlex
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from auvid_cli.cli.browser import open_page
from auvid_cli.cli.exit_codes import DONE, VERDICT_FAILED
from auvid_cli.cli.terminal import Terminal
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.extra_states import BiasName
from auvid_cli.config.filter_name import FilterName
from auvid_cli.config.plausibility import doubts
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.dataset_file import read_dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.files import keep_apart, write_text
from auvid_cli.data.hdf5 import begin_scan
from auvid_cli.data.netcdf import digest
from auvid_cli.data.replacement import other_estimates, other_run, put_dataset, refuse_unless
from auvid_cli.data.results_folder import dataset_in, estimates_in, page_in, products, remove, remove_former

if TYPE_CHECKING:
    from auvid_cli.api.evaluation import Evaluator
    from auvid_cli.api.judgement import Judgement
    from auvid_cli.api.preparation import PreparedData
    from auvid_cli.report.figures.draw import FigureQueue


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
    # While this process loads what it needs.
    begin_scan([path, *estimates_in(folder).values()])
    with terminal.compiling():
        from auvid_cli.api.simulation import simulate
    objection = other_run(path, experiment)
    if not objection and filters and path.exists():
        objection = next(iter(other_estimates(folder, experiment, digest(path), filters).values()), "")
    refuse_unless(overwrite, objection)
    say_doubts(experiment.vehicle, terminal)
    with terminal.stage("simulate"):
        simulated = simulate(experiment)
    put_dataset(path, simulated, inputs, overwrite, objection)
    # Hours of it fill a good part of a machine's memory.
    del simulated
    with terminal.stage("read the dataset"):
        dataset = read_dataset(path)
    sensors = ", ".join(f"{name} {record.time.size}" for name, record in dataset.sensors.items())
    terminal.tell(f"{path}: {dataset.inputs.time[-1]:g} s of {experiment.manoeuvre.type}; samples: {sensors}")
    return dataset


def simulate_log_to(
    folder: Path, experiment: Experiment, terminal: Terminal, inputs: list[Path], overwrite: bool
) -> None:
    """Simulate an experiment into files such as a vehicle of somebody else would have logged.

    Raises
    ------
    FileError
        If one of them stands in the folder, and `overwrite` is not said.
    """
    with terminal.compiling():
        from auvid_cli.api.simulation import simulate_log
    with terminal.stage("simulate"):
        texts = {folder / name: text for name, text in simulate_log(experiment).items()}
    refuse_unless(overwrite, next((f"{path}: exists already" for path in texts if path.exists()), ""))
    keep_apart(texts, inputs)
    for path, text in texts.items():
        write_text(path, text)
    terminal.say_all([*texts])
    logs = shlex.join(str(path) for path in texts if path.suffix == ".csv")
    terminal.say(f"next: auvid import --suggest {logs} -o {shlex.quote(str(folder / 'map.yaml'))}")


def say_doubts(vehicle: VehicleSettings, terminal: Terminal) -> None:
    """Say what of a vehicle's numbers can hardly be, a line each."""
    for doubt in doubts(vehicle):
        terminal.tell(f"note: vehicle {vehicle.name}: {doubt}")


def settle(prepared: "PreparedData", terminal: Terminal) -> "PreparedData":
    """Find the delays and the noise that make the data most likely, where that is asked for, and say what they are."""
    settings = prepared.experiment.identification
    asked = ("delays", settings.seeks_delays), ("noise", settings.noise != "stated")
    sought = [name for name, is_asked in asked if is_asked]
    if not sought:
        return prepared
    with terminal.compiling():
        from auvid_cli.api import core
        from auvid_cli.api.identification import with_noise_settled

        core.load_sensors()
    with terminal.stage(f"find the {' and the '.join(sought)}"):
        settled = with_noise_settled(prepared)
    if settled.delays is not None:
        found = zip(settled.delays.symbols, settled.delays.value, settled.delays.deviation, strict=True)
        told = (f"{symbol} {1e3 * value:.1f} ± {1e3 * deviation:.1f} ms" for symbol, value, deviation in found)
        terminal.tell(f"delays that make the data most likely: {', '.join(told)}")
    if settings.noise == "stated":
        return settled
    stated, tuned = (data.experiment.identification.process_noise.model_dump() for data in (prepared, settled))
    densities = ", ".join(
        f"{name} {' '.join(f'{each:.3g}' for each in (density if isinstance(density, tuple) else (density,)))}"
        for name, density in tuned.items()
        if density != stated[name]
    )
    terminal.tell(f"process noise that makes the data most likely, SI: {densities}")
    estimate = settled.experiment.identification.estimate
    if BiasName.DISTURBANCE in estimate.biases:
        pushes = ", ".join(
            f"{name} {' '.join(f'{size:.3g}' for size in of.standard_deviation)} over "
            f"{' '.join(f'{time:.3g}' for time in of.time_constant)} s"
            for name, of in (("force", estimate.disturbance.force), ("moment", estimate.disturbance.moment))
            if any(of.standard_deviation)
        )
        terminal.tell(f"disturbance that makes the data most likely, SI: {pushes}")
    return settled


def identify_to(
    folder: Path,
    prepared: "PreparedData",
    filters: Iterable[FilterName],
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
    names = list(dict.fromkeys(filters))
    others = other_estimates(folder, prepared.experiment, prepared.dataset.sha256, names)
    refuse_unless(overwrite, next(iter(others.values()), ""))
    with terminal.compiling():
        from auvid_cli.api.side_by_side import SideBySide

        # Some filters load libraries of their own here, which may swallow an interrupt as well.
        runs = SideBySide(prepared, names)
    paths = [folder / "estimates" / f"{name.value}.h5" for name in names]
    with terminal.progress(*(name.value for name in names), unit=" s of data") as bars:
        estimates = runs.record(paths, bars, on_estimate)
    if others:
        kept = {*paths, *(path for path in estimates_in(folder).values() if path not in others)}
        remove(path for path in products(folder) if path not in kept)
    for path, estimate in zip(paths, estimates, strict=True):
        terminal.say(f"{path}: {estimate.status}; {estimate.cpu_time:.2f} s of processor time")
    return estimates


def report_to(
    folder: Path,
    evaluator: "Evaluator",
    estimates: list[Estimate],
    terminal: Terminal,
    figures: "FigureQueue",
    show: bool,
) -> int:
    """Write tables, page and figures, print the summary; the exit code says whether an estimate is judged against."""
    with terminal.compiling():
        from auvid_cli.report.csv_tables import write_csv_tables
        from auvid_cli.report.page.run_page import run_page
        from auvid_cli.report.page.write_page import write_page
        from auvid_cli.report.screen import print_check_counts, print_files, print_summary
        from auvid_cli.report.write import write_tables
    figures.add_estimates(evaluator.dataset, estimates)
    with terminal.stage("evaluate"):
        evaluation = evaluator.evaluate(estimates)
    figures.add_free_runs(evaluator.dataset, evaluation)
    with terminal.stage("check"):
        verdicts = evaluator.check(estimates)
    paths = write_tables(evaluation, folder / "tables")
    paths += write_csv_tables({"checks": verdicts.rows()}, folder / "tables")
    print_summary(terminal.out, evaluation)
    print_check_counts(terminal.out, verdicts)
    if any(not verdict.passed for verdict in verdicts):
        terminal.say(f"what did not pass, and what to do: auvid check {shlex.quote(str(folder))}")
    with terminal.stage("page"):
        # While others draw.
        page = run_page(evaluator.dataset, estimates, evaluation, verdicts)
        shown = write_page(page, page_in(folder))
    with terminal.progress("figures") as (progress,):
        paths += figures.finish(progress)
    remove_former(folder, paths)
    print_files(terminal.out, paths)
    terminal.say(f"all on one page: {shown}")
    if show:
        open_page(shown, terminal)
    return exit_code(evaluation.judgements())


def exit_code(judgements: "Mapping[str, Judgement]") -> int:
    """Return 1 if an estimate is worse than sound; one that nobody was asked to judge is not."""
    return VERDICT_FAILED if any(judgement.is_against for judgement in judgements.values()) else DONE
