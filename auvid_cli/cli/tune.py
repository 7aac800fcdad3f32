"""auvid tune."""

from dataclasses import replace
from typing import Annotated

import typer

from auvid_cli.cli.options import (
    DatasetArgument,
    OutputOption,
    OverwriteOption,
    QuietOption,
    SetOption,
    UseOption,
    VerboseOption,
    overrides,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors


def tune(
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
    settings: SetOption = None,
    use: UseOption = None,
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Find the noise that makes the data most likely: how far the model may be trusted, and with --sensors these.

    Process noise is what the model leaves out. The smoother follows the data again and again, with more noise
    and with less. What it finds is in tuned.yaml, which `auvid identify` takes behind --set.
    """
    with reporting_errors() as command:
        from auvid_cli.cli import found_settings
        from auvid_cli.data.files import write_text

        terminal, changes = Terminal(quiet, verbose), (*overrides(settings, use=use), "identification.noise=stated")
        search = found_settings.begin_search(command, dataset, changes, output, overwrite, "tuned.yaml")
        read = search.dataset
        with terminal.compiling():
            from auvid_cli.api import core
            from auvid_cli.api.identification import identify
            from auvid_cli.api.judgement import judge
            from auvid_cli.api.tuning import tune as tune_noise
            from auvid_cli.report.csv_tables import write_csv_tables
            from auvid_cli.report.tuning_screen import choice_text, print_tuning

            core.load_sensors()
        with terminal.stage("fit with the stated noise") as say:
            before, passes = identify(read, "smoother"), 0

            def count() -> None:
                nonlocal passes
                passes += 1
                say(f"tune: pass {passes} through the data")

            tuning = tune_noise(read, sensors, count, disturbance)
            say("fit with the tuned noise")
            after = identify(replace(read, experiment=tuning.experiment), "smoother")
        judged = ((estimate, judge(estimate)[estimate.filter]) for estimate in (before, after))
        print_tuning(terminal.out, tuning, *judged)
        terminal.say(f"log-likelihood: {tuning.gain:.4g} more than as stated")
        if tuning.choice is not None:
            terminal.say(choice_text(tuning.choice))
        terminal.say_all(write_csv_tables({"tuning": tuning.rows()}, search.folder / "tables"))
        write_text(search.file, tuning.settings())
        found_settings.say_next(terminal, dataset, settings, use, search.file)
