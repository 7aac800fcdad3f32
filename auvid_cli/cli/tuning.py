"""auvid tune and terms: settings found in a dataset."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.options import DatasetArgument, OutputOptions, SettingOptions, TerminalOptions, command, refuse_log
from auvid_cli.cli.terminal import Terminal


@command
def tune(
    *,
    dataset: DatasetArgument,
    sensors: Annotated[
        bool, typer.Option("--sensors", help="Find the noise of the sensors as well, instead of what is stated.")
    ] = False,
    disturbance: Annotated[
        bool,
        typer.Option(
            "--disturbance", help="Tune with and without a force and moment that last, and keep them if that pays."
        ),
    ] = False,
    settings: SettingOptions,
    output: OutputOptions,
    console: TerminalOptions,
) -> None:
    """Find the noise that makes the data most likely: how far the model may be trusted, and with --sensors these.

    Process noise is what the model leaves out. The smoother follows the data again and again, with more noise
    and with less. What it finds is in tuned.yaml, which `auvid identify` takes behind --set.
    """
    refuse_log(dataset)
    changes, terminal = settings.overrides(), console.terminal()
    with terminal.compiling():
        from auvid_cli.api.analysis import tune_into
        from auvid_cli.report.screen import choice_text, print_tuning

    result = tune_into(output.output, dataset, changes, output.overwrite, terminal, sensors, disturbance)
    print_tuning(terminal.out, result.tuning, *result.fits)
    terminal.print(f"log-likelihood: {result.tuning.gain:.4g} more than as stated")
    if result.tuning.choice is not None:
        terminal.print(choice_text(result.tuning.choice))
    terminal.print_lines(result.files)
    _print_next(terminal, dataset, settings, result.settings)


@command
def terms(
    *,
    dataset: DatasetArgument,
    any_symmetry: Annotated[
        bool,
        typer.Option("--any-symmetry", help="Look also for terms that differ between port and starboard."),
    ] = False,
    most: Annotated[int, typer.Option(min=1, max=20, metavar="NUMBER", help="Look for so many terms at most.")] = 4,
    settings: SettingOptions,
    output: OutputOptions,
    console: TerminalOptions,
) -> None:
    """Find terms that the model lacks: products of velocities and fins that explain what its fit leaves of the data.

    The smoother is fitted to the first two thirds of the data. Of some two hundred candidates the best
    few, and what comes nearest to the best of them, are added and fitted, one at a time; the best of these is kept
    only if it makes the last third likelier; then come the next. What is found stands in terms.yaml, which `auvid
    identify` takes behind --set.
    """
    refuse_log(dataset)
    changes, terminal = settings.overrides(), console.terminal()
    with terminal.compiling():
        from auvid_cli.api.analysis import find_terms_into
        from auvid_cli.report.screens import print_terms

    result = find_terms_into(output.output, dataset, changes, output.overwrite, terminal, any_symmetry, most)
    print_terms(terminal.out, result.findings)
    terminal.print_lines(result.files)
    if result.settings is not None:
        _print_next(terminal, dataset, settings, result.settings)


def _print_next(terminal: Terminal, dataset: Path, settings: SettingOptions, found: Path) -> None:
    """Print the command that identifies with the settings that were found, and all others."""
    words = ["auvid", "identify", str(dataset), *settings.words(), "--set", str(found)]
    terminal.print(f"next: {shlex.join(words)}")
