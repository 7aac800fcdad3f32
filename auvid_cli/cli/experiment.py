"""auvid run, simulate, identify and report: from an experiment to a page of results."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli.options import (
    DataArgument,
    DryRunOption,
    ExperimentOptions,
    FigureOptions,
    FilterOption,
    OutputOptions,
    ResultsArgument,
    SettingOptions,
    TerminalOptions,
    command,
    dataset_or_experiment,
)
from auvid_cli.cli.streams import DONE, VERDICT_FAILED
from auvid_cli.cli.terminal import Terminal

if TYPE_CHECKING:
    from auvid_cli.api.evaluation import Judgement
    from auvid_cli.api.results import RunResult
    from auvid_cli.config.experiment import RunSettings


@command
def run(
    *,
    filters: FilterOption = None,
    experiment: ExperimentOptions,
    output: OutputOptions,
    figures: FigureOptions,
    console: TerminalOptions,
    dry_run: DryRunOption = False,
) -> int:
    """Simulate an experiment, run its filters, and write a report (report.html), tables and figures."""
    if not dry_run:
        from auvid_cli.report.figures.workers import load_ahead

        load_ahead()
    loaded, files = experiment.load()
    if dry_run:
        return _print_settings(loaded)
    terminal = console.terminal()
    terminal.load_core()
    with terminal.compiling():
        from auvid_cli.api.results import run as run_into

    terminal.print_sanity_warnings(loaded.vehicle)
    result = run_into(
        loaded,
        output.output,
        filters,
        overwrite=output.overwrite,
        figure_formats=figures.formats,
        inputs=files,
        progress=terminal,
    )
    return _print_result(result, terminal, figures.show)


@command
def simulate(
    *,
    experiment: ExperimentOptions,
    as_log: Annotated[
        bool,
        typer.Option(
            "--as-log",
            help="Write CSV logs like those of a real vehicle instead of a dataset, and a vehicle file with errors "
            "of 30 %.",
        ),
    ] = False,
    output: OutputOptions,
    console: TerminalOptions,
    dry_run: DryRunOption = False,
) -> int:
    """Simulate the vehicle and sensors of an experiment, and write results/NAME/dataset.h5."""
    from auvid_cli.data.files import dataset_in, folder_of_run, locked

    loaded, files = experiment.load()
    if dry_run:
        return _print_settings(loaded)
    folder, terminal = output.output or folder_of_run(loaded.name), console.terminal()
    with terminal.compiling():
        from auvid_cli.api.simulation import simulate_into, simulate_log_into

    if not as_log:
        terminal.print_sanity_warnings(loaded.vehicle)
        with locked(folder):
            simulate_into(folder, loaded, files, output.overwrite, terminal)
        terminal.print(f"next: auvid identify {shlex.quote(str(dataset_in(folder)))}")
        return DONE
    written = simulate_log_into(folder, loaded, files, output.overwrite, terminal)
    terminal.print_lines(written)
    logs = shlex.join(str(path) for path in written if path.suffix == ".csv")
    terminal.print(f"next: auvid import --suggest {logs} -o {shlex.quote(str(folder / 'map.yaml'))}")
    return DONE


@command
def identify(
    *,
    source: DataArgument = None,
    filters: FilterOption = None,
    settings: SettingOptions,
    output: OutputOptions,
    console: TerminalOptions,
    dry_run: DryRunOption = False,
) -> int:
    """Estimate coefficients from a dataset, and write results/NAME/estimates/FILTER.h5."""
    changes = settings.overrides()
    data = dataset_or_experiment(source, changes)
    if dry_run:
        from auvid_cli.api.files import read_dataset

        return _print_settings(read_dataset(data, *changes).experiment if isinstance(data, Path) else data[0])
    terminal = console.terminal()
    with terminal.compiling():
        from auvid_cli.api.identification import identify_data_into
        from auvid_cli.report.shared_checks import contradiction_sentences, judgement_sentences

    result = identify_data_into(output.output, data, changes, filters, output.overwrite, terminal)
    terminal.print_lines(judgement_sentences(result.judgements, with_sound=True))
    terminal.print_lines(contradiction_sentences(result.contradictions))
    code = _exit_code(result.judgements)
    terminal.print(f"next: auvid report {result.folder}")
    if code == DONE:
        terminal.print(f"validate with another run: auvid validate {result.files[0]} OTHER.h5")
    else:
        terminal.print(f"causes and advice: auvid check {result.folder}")
    return code


@command
def report(
    *, results: ResultsArgument = Path("results/spiral"), figures: FigureOptions, console: TerminalOptions
) -> int:
    """Write the report (report.html), tables and figures of a results folder, and print a summary."""
    from auvid_cli.report.figures.workers import load_ahead

    load_ahead()
    terminal = console.terminal()
    with terminal.compiling():
        from auvid_cli.api.results import report as report_into

    return _print_result(report_into(results, figures.formats, terminal), terminal, figures.show)


def _print_settings(experiment: "RunSettings") -> int:
    from auvid_cli.config.loading import dump_experiment

    print(dump_experiment(experiment), end="")
    return DONE


def _print_result(result: "RunResult", terminal: Terminal, show: bool) -> int:
    """Print the summary of a results folder; return 1 if an estimate is inconsistent or diverged."""
    from auvid_cli.report.screen import print_check_counts, print_files, print_summary

    print_summary(terminal.out, result.evaluation)
    print_check_counts(terminal.out, result.checks)
    if any(not check.passed for check in result.checks):
        terminal.print(f"failed checks and advice: auvid check {shlex.quote(str(result.folder))}")
    print_files(terminal.out, result.files)
    terminal.print(f"report: {result.page}")
    if show:
        terminal.open_page(result.page)
    return _exit_code(result.evaluation.judgements())


def _exit_code(judgements: "Mapping[str, Judgement]") -> int:
    return VERDICT_FAILED if any(judgement.is_against for judgement in judgements.values()) else DONE
