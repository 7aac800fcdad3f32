"""auvid tune and terms: noise levels and model terms from a dataset."""

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
    sensors: Annotated[bool, typer.Option("--sensors", help="Estimate the noise of the sensors as well.")] = False,
    disturbance: Annotated[
        bool,
        typer.Option(
            "--disturbance", help="Also try a slowly varying force and moment; keep them if the data support them."
        ),
    ] = False,
    settings: SettingOptions,
    output: OutputOptions,
    console: TerminalOptions,
) -> None:
    """Estimate the process noise, and with --sensors the sensor noise, by maximum likelihood.

    Process noise describes the errors of the model. The smoother runs many times with different noise levels. The
    result is written to tuned.yaml; use it with `auvid identify --set tuned.yaml`.
    """
    refuse_log(dataset)
    changes, terminal = settings.overrides(), console.terminal()
    with terminal.compiling():
        from auvid_cli.api.analysis import tune_into
        from auvid_cli.report.screen import choice_text, print_tuning

    result = tune_into(output.output, dataset, changes, output.overwrite, terminal, sensors, disturbance)
    print_tuning(terminal.out, result.tuning, *result.fits)
    terminal.print(f"log-likelihood: {result.tuning.gain:.4g} higher than with the noise of the settings")
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
        typer.Option("--any-symmetry", help="Also try terms that break the symmetry of port and starboard."),
    ] = False,
    most: Annotated[int, typer.Option(min=1, max=20, metavar="NUMBER", help="Largest number of terms to add.")] = 4,
    settings: SettingOptions,
    output: OutputOptions,
    console: TerminalOptions,
) -> None:
    """Find terms that are missing in the model: products of velocities and fin angles that explain the residuals.

    The smoother is fitted to the first two thirds of the data. The most promising of about 200 candidates are added
    and fitted one at a time. The best one is kept only if it raises the likelihood of the last third; then the search
    is repeated. The result is written to terms.yaml; use it with `auvid identify --set terms.yaml`.
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
    """Print the command that identifies with the new settings and all other overrides."""
    words = ["auvid", "identify", str(dataset), *settings.words(), "--set", str(found)]
    terminal.print(f"next: {shlex.join(words)}")
