"""All commands, grouped by task and in the order of use."""

from collections.abc import Callable
from typing import Annotated, NamedTuple

import typer

from auvid_cli._version import __version__
from auvid_cli.cli import data, design, experiment, judge, start
from auvid_cli.cli.options import BOTH_HELPS, Command, Group, examples_text, paragraphs


class Entry(NamedTuple):
    """A command with its function and the examples below its help (at most 80 columns each)."""

    name: str
    function: Callable[..., None]
    examples: tuple[str, ...]
    cls: type[Command] = Command


def _entry(name: str, function: Callable[..., None], *examples: str, cls: type[Command] = Command) -> Entry:
    return Entry(name, function, examples, cls)


GROUPS: dict[str, tuple[Entry, ...]] = {
    "Start with your own data": (
        _entry("import", data.import_log, "auvid import --suggest dive.csv -o map.yaml", "auvid import --map map.yaml"),
        _entry(
            "inspect",
            data.inspect,
            "auvid inspect results/dive/dataset.h5",
            "auvid inspect results/dive/dataset.h5 --use 0:80",
        ),
    ),
    "Start with a simulation": (
        _entry("list", start.list_shipped, "auvid list", "auvid list vehicles"),
        _entry(
            "init",
            start.init,
            "auvid init mine --like remus100",
            "auvid init my --length 2 --diameter .2 --mass 60 --fin-span .1 --fin-area .008",
            cls=start.OutlineCommand,
        ),
        _entry(
            "run",
            experiment.run,
            "auvid run",
            "auvid run remus100 --seed 7 --output results/seed7",
            'auvid run --set sensors.dvl.rate="5 Hz" --output results/slow_dvl',
        ),
        _entry(
            "simulate",
            experiment.simulate,
            "auvid simulate",
            "auvid simulate --set manoeuvre=manoeuvres/zigzag_20_20.yaml -o results/zigzag",
        ),
    ),
    "Plan the next run": (
        _entry(
            "design",
            design.design,
            "auvid design remus100 --box '150 m' --depth '20 m' --fins '14 deg'",
            "auvid design --at results/spiral/estimates/ckf.h5 --for N_uvl",
        ),
    ),
    "Identify": (
        _entry(
            "identifiability",
            judge.identifiability,
            "auvid identifiability",
            "auvid identifiability results/dive/dataset.h5 --use 0:80",
        ),
        _entry(
            "identify",
            experiment.identify,
            "auvid identify results/dive/dataset.h5 --use 0:80",
            "auvid identify spiral --filter tukf",
        ),
        _entry(
            "fit",
            data.fit,
            "auvid fit results/dive/dataset.h5",
            "auvid fit results/dive/dataset.h5 --not current,dvl --max-time '5 min'",
        ),
        _entry("tune", experiment.tune, "auvid tune results/dive/dataset.h5 --sensors"),
        _entry("terms", experiment.terms, "auvid terms results/dive/dataset.h5 --use 0:120"),
    ),
    "Judge the results": (
        _entry("report", experiment.report, "auvid report results/dive"),
        _entry("check", judge.check, "auvid check results/dive", "auvid check results/dive --verbose"),
        _entry("validate", judge.validate, "auvid validate results/spiral/estimates/ckf.h5 results/zigzag/dataset.h5"),
    ),
    "Use the results": (
        _entry(
            "compare",
            judge.compare,
            "auvid compare results/spiral results/reference",
            "auvid compare results/spiral results/old --relative rmse=0.05",
        ),
        _entry("export", data.export, "auvid export results/spiral/estimates/tukf.h5 --to python"),
        _entry(
            "campaign",
            design.campaign,
            "auvid campaign regimes --set seeds=2 --dry-run",
            "auvid campaign regimes --set seeds=2",
        ),
    ),
}

app = typer.Typer(
    name="auvid",
    cls=Group,
    context_settings=BOTH_HELPS,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    epilog="Options and examples of a command: auvid COMMAND -h",
)
for title, entries in GROUPS.items():
    for entry in entries:
        app.command(
            entry.name,
            cls=entry.cls,
            context_settings=BOTH_HELPS,
            rich_help_panel=title,
            help=paragraphs(entry.function),
            epilog=examples_text(entry.examples),
        )(entry.function)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"auvid {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Identify the hydrodynamic coefficients of an underwater vehicle from its own manoeuvre data."""
