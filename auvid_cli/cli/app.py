"""The commands together."""

from typing import Annotated

import typer

from auvid_cli import __version__
from auvid_cli.cli.campaign import campaign
from auvid_cli.cli.check import check
from auvid_cli.cli.export import export
from auvid_cli.cli.identifiability import identifiability
from auvid_cli.cli.identify import identify
from auvid_cli.cli.import_log import import_log
from auvid_cli.cli.inspect import inspect
from auvid_cli.cli.report import report
from auvid_cli.cli.run import run
from auvid_cli.cli.simulate import simulate
from auvid_cli.cli.tune import tune
from auvid_cli.cli.validate import validate

app = typer.Typer(
    name="auvid",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
for command in (run, simulate, identify, report, check, identifiability, inspect, tune, validate, export, campaign):
    app.command()(command)
app.command("import")(import_log)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"auvid {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """Identify the hydrodynamic coefficients of an underwater vehicle from its own manoeuvre data."""
