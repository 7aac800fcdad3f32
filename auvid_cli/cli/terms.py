"""auvid terms."""

import shlex
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


def terms(
    dataset: DatasetArgument,
    any_symmetry: Annotated[
        bool,
        typer.Option("--any-symmetry", help="Look also for terms that differ between port and starboard."),
    ] = False,
    most: Annotated[int, typer.Option(min=1, max=20, metavar="NUMBER", help="Look for so many terms at most.")] = 4,
    settings: SetOption = None,
    use: UseOption = None,
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Find terms that the model lacks: products of velocities and fins that explain what its fit leaves of the data.

    The iterated smoother is fitted to the first two thirds of the data. Of some two hundred candidates the best is
    added and fitted, and kept only if that makes the last third likelier; then the next. What is found stands in
    terms.yaml, which `auvid identify` takes behind --set.
    """
    with reporting_errors():
        from auvid_cli.api.files import read_dataset
        from auvid_cli.data.files import keep_apart, write_text
        from auvid_cli.data.replacement import put_copy
        from auvid_cli.data.results_folder import folder_of_dataset, tables_and_figures

        terminal, changes = Terminal(quiet, verbose), overrides(settings, use=use)
        read, folder = read_dataset(dataset, *changes), output or folder_of_dataset(dataset)
        files, written = [dataset, *read.experiment.data_files()], folder / "terms.yaml"
        put_copy(dataset, read, folder, files, overwrite)
        keep_apart([written, *tables_and_figures(folder)], files)
        with terminal.compiling():
            from auvid_cli.api.terms import find_terms
            from auvid_cli.report.csv_tables import write_csv_tables
            from auvid_cli.report.term_screen import print_terms
        with terminal.stage("fit of the model as it is") as say:
            findings = find_terms(read, any_symmetry, most, say)
        print_terms(terminal.out, findings)
        terminal.say_all(write_csv_tables({"terms": findings.rows()}, folder / "tables"))
        if findings.found:
            write_text(written, findings.settings())
            given = [*(f"--set={setting}" for setting in settings or ()), *(f"--use={span}" for span in use or ())]
            terminal.say(f"next: {shlex.join(['auvid', 'identify', str(dataset), *given, '--set', str(written)])}")
