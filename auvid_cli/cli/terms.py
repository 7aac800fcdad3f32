"""auvid terms."""

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

    The smoother is fitted to the first two thirds of the data. Of some two hundred candidates the best
    few, and what comes nearest to the best of them, are added and fitted, one at a time; the best of these is kept
    only if it makes the last third likelier; then come the next. What is found stands in terms.yaml, which `auvid
    identify` takes behind --set.
    """
    with reporting_errors() as command:
        from auvid_cli.cli import found_settings
        from auvid_cli.data.files import write_text

        terminal, changes = Terminal(quiet, verbose), overrides(settings, use=use)
        search = found_settings.begin_search(command, dataset, changes, output, overwrite, "terms.yaml")
        with terminal.compiling():
            from auvid_cli.api import core
            from auvid_cli.api.terms import find_terms
            from auvid_cli.report.csv_tables import write_csv_tables
            from auvid_cli.report.term_screen import print_terms

            core.load_sensors()
        with terminal.stage("fit of the model as it is") as say:
            findings = find_terms(search.dataset, any_symmetry, most, say)
        print_terms(terminal.out, findings)
        terminal.say_all(write_csv_tables({"terms": findings.rows()}, search.folder / "tables"))
        if findings.found:
            write_text(search.file, findings.settings())
            found_settings.say_next(terminal, dataset, settings, use, search.file)
