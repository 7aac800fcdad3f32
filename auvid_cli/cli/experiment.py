"""auvid run, simulate, identify, report, tune and terms: from an experiment to estimates and a page of results."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli import DONE, VERDICT_FAILED, options
from auvid_cli.cli.data import fit_of_run
from auvid_cli.cli.terminal import Terminal
from auvid_cli.data.files import dataset_in, locked
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from auvid_cli.api.evaluation import Judgement
    from auvid_cli.api.files import SimulatedData
    from auvid_cli.api.results import RunResult
    from auvid_cli.config.experiment import RunSettings


_AS_LOG = "Instead of a dataset, write CSV logs and a map like those of a real vehicle, and a vehicle file 30 % off."
_WITH_FIT = "Search for a model as auvid fit does, instead of running the filters."


@options.command
def run(
    *,
    filters: options.FilterOption = None,
    experiment: options.ExperimentOptions,
    output: options.OutputOptions,
    figures: options.FigureOptions,
    console: options.TerminalOptions,
    with_fit: Annotated[bool, typer.Option("--fit", help=_WITH_FIT)] = False,
    dry_run: options.DryRunOption = False,
) -> int:
    """Simulate an experiment, run its filters, and write a report (report.html), tables and figures."""
    if with_fit and filters:
        raise ConfigError("--fit and --filter: expected one of them; a search uses the smoother")
    if with_fit and not dry_run:
        return _run_with_fit(experiment.load(), output, console.terminal())
    source = experiment.load()
    if dry_run:
        return _print_settings(source.experiment)
    from auvid_cli.report.figures.workers import load_ahead

    load_ahead(source.experiment.manoeuvre.duration)
    terminal = console.terminal()
    terminal.load_core()
    with terminal.compiling():
        from auvid_cli.api.results import run as run_into

    terminal.print_sanity_warnings(source.experiment.vehicle)
    result = run_into(
        source.experiment,
        output.output,
        filters,
        overwrite=output.overwrite,
        figure_formats=figures.formats,
        inputs=source.files,
        progress=terminal,
    )
    return _print_result(result, terminal, figures.show)


def _run_with_fit(source: "SimulatedData", output: options.OutputOptions, terminal: Terminal) -> int:
    """Simulate an experiment, and find a model of its data."""
    folder = output.output or source.folder
    with terminal.compiling():
        from auvid_cli.api.files import RecordedData
        from auvid_cli.api.simulation import simulate_into

    terminal.print_sanity_warnings(source.experiment.vehicle)
    with locked(folder):
        dataset = simulate_into(folder, source, output.overwrite, terminal)
    return fit_of_run(RecordedData(dataset_in(folder), dataset), output, terminal)


@options.command
def simulate(
    *,
    experiment: options.ExperimentOptions,
    as_log: Annotated[bool, typer.Option("--as-log", help=_AS_LOG)] = False,
    output: options.OutputOptions,
    console: options.TerminalOptions,
    dry_run: options.DryRunOption = False,
) -> int:
    """Simulate the vehicle and sensors of an experiment, and write results/NAME/dataset.h5."""
    source = experiment.load()
    if dry_run:
        return _print_settings(source.experiment)
    folder, terminal = output.output or source.folder, console.terminal()
    with terminal.compiling():
        from auvid_cli.api.simulation import simulate_into, simulate_log_into

    if not as_log:
        terminal.print_sanity_warnings(source.experiment.vehicle)
        with locked(folder):
            simulate_into(folder, source, output.overwrite, terminal)
        terminal.print(f"next: auvid identify {shlex.quote(str(dataset_in(folder)))}")
        return DONE
    written = simulate_log_into(folder, source, output.overwrite, terminal)
    terminal.print_lines(written)
    terminal.print(f"next: auvid import --map {shlex.quote(str(folder / 'map.yaml'))}")
    return DONE


@options.command
def identify(
    *,
    data: options.DataArgument = None,
    filters: options.FilterOption = None,
    settings: options.SettingOptions,
    output: options.OutputOptions,
    console: options.TerminalOptions,
    dry_run: options.DryRunOption = False,
) -> int:
    """Estimate coefficients from a dataset, and write results/NAME/estimates/FILTER.h5."""
    source = options.data_source(data, settings.overrides())
    if dry_run:
        return _print_settings(source.experiment)
    terminal = console.terminal()
    with terminal.compiling():
        from auvid_cli.api.identification import identify_data_into
        from auvid_cli.report.screen import print_estimate
        from auvid_cli.report.sentences import contradiction_sentences, judgement_sentences
        from auvid_cli.report.table import filter_label

    result = identify_data_into(output.destination(terminal), source, filters)
    first, folder = result.estimates[0], shlex.quote(str(result.folder))
    print_estimate(terminal.out, first, result.judgements[first.filter])
    if first.completed and len(result.estimates) > 1:
        terminal.print(f"Shown: {filter_label(first.filter)}. `auvid report {folder}` shows the other estimates too.")
    terminal.print_lines(judgement_sentences(result.judgements, with_sound=True))
    terminal.print_lines(contradiction_sentences(result.contradictions))
    code = _exit_code(result.judgements)
    after = f"auvid report {folder}" if code == DONE else options.fit_command(result.folder, first.experiment)
    terminal.print(f"next: {after}")
    return code


@options.command
def report(
    *,
    results: options.ResultsArgument = Path("results/spiral"),
    figures: options.FigureOptions,
    console: options.TerminalOptions,
) -> int:
    """Write the report (report.html), tables and figures of a results folder, and print a summary."""
    from auvid_cli.report.figures.workers import load_ahead

    load_ahead()
    terminal = console.terminal()
    with terminal.compiling():
        from auvid_cli.api.results import report as report_into

    return _print_result(report_into(results, figures.formats, terminal), terminal, figures.show)


@options.command
def tune(
    *,
    dataset: options.DatasetArgument,
    sensors: Annotated[bool, typer.Option("--sensors", help="Estimate the noise of the sensors as well.")] = False,
    disturbance: Annotated[
        bool,
        typer.Option(
            "--disturbance", help="Also try a slowly varying force and moment; keep them if the data support them."
        ),
    ] = False,
    settings: options.SettingOptions,
    output: options.OutputOptions,
    console: options.TerminalOptions,
) -> None:
    """Estimate the process noise, and with --sensors the sensor noise, by maximum likelihood.

    Process noise describes the errors of the model. The smoother runs many times with different noise levels. The
    result is written to tuned.yaml; use it with `auvid identify --set tuned.yaml`.
    """
    dataset = options.dataset_file(dataset)
    changes, terminal = settings.overrides(), console.terminal()
    with terminal.compiling():
        from auvid_cli.api.analysis import tune_into
        from auvid_cli.report.screens import choice_text, objection_to_tuning, print_tuning

    result = tune_into(output.destination(terminal), dataset, changes, sensors, disturbance)
    print_tuning(terminal.out, result.tuning, result.fits)
    level, gain = result.tuning.log_likelihood, result.tuning.gain
    terminal.print(f"log-likelihood: {level:.1f}, with the noise of the settings {gain:.4g} less")
    if result.tuning.choice is not None:
        terminal.print(choice_text(result.tuning.choice))
    terminal.print_lines(result.files)
    if objection := objection_to_tuning([judgement for _, judgement in result.fits]):
        terminal.print(objection)
    else:
        _print_next(terminal, dataset, settings, output, result.settings)


@options.command
def terms(
    *,
    dataset: options.DatasetArgument,
    any_symmetry: Annotated[
        bool,
        typer.Option("--any-symmetry", help="Also try terms that break the symmetry of port and starboard."),
    ] = False,
    most: Annotated[int, typer.Option(min=1, max=20, metavar="NUMBER", help="Largest number of terms to add.")] = 4,
    settings: options.SettingOptions,
    output: options.OutputOptions,
    console: options.TerminalOptions,
) -> None:
    """Find terms that are missing in the model: products of velocities and fin angles that explain the residuals.

    The smoother is fitted to the first two thirds of the data. The most promising of about 200 candidates are added
    and fitted one at a time. The best one is kept only if it raises the likelihood of the last third; then the search
    is repeated. The result is written to terms.yaml; use it with `auvid identify --set terms.yaml`.
    """
    dataset = options.dataset_file(dataset)
    changes, terminal = settings.overrides(), console.terminal()
    with terminal.compiling():
        from auvid_cli.api.analysis import find_terms_into
        from auvid_cli.report.screens import print_terms

    result = find_terms_into(output.destination(terminal), dataset, changes, any_symmetry, most)
    print_terms(terminal.out, result.findings)
    terminal.print_lines(result.files)
    if result.settings is not None:
        _print_next(terminal, dataset, settings, output, result.settings)


def _print_settings(experiment: "RunSettings") -> int:
    from auvid_cli.config.loading import dump_experiment

    print(dump_experiment(experiment), end="")
    return DONE


def _print_result(result: "RunResult", terminal: Terminal, show: bool) -> int:
    """Print the summary of a results folder; return 1 if an estimate is inconsistent or diverged."""
    from auvid_cli.report.screen import print_files, print_summary
    from auvid_cli.report.sentences import counts_in_words
    from auvid_cli.report.text_tables import print_texts

    print_summary(terminal.out, result.evaluation)
    print_texts(terminal.out, counts_in_words(result.checks))
    if any(not check.passed for check in result.checks):
        kind = "failed checks" if any(check.passed is False for check in result.checks) else "notes"
        terminal.print(f"{kind} and advice: auvid check {shlex.quote(str(result.folder))}")
    print_files(terminal.out, result.files)
    terminal.print(f"report: {result.page}")
    if show:
        terminal.open_page(result.page)
    return _exit_code(result.evaluation.judgements())


def _exit_code(judgements: "Mapping[str, Judgement]") -> int:
    return VERDICT_FAILED if any(judgement.is_against for judgement in judgements.values()) else DONE


def _print_next(
    terminal: Terminal, dataset: Path, settings: options.SettingOptions, output: options.OutputOptions, found: Path
) -> None:
    """Print the command that identifies with the new settings and all other overrides, in the same results folder."""
    words = ["auvid", "identify", str(dataset), *settings.words(), "--set", str(found), *output.words()]
    terminal.print(f"next: {shlex.join(words)}")
