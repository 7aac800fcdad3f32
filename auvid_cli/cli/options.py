"""Arguments and options that commands share."""

from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.config.filter_name import FilterName

ExperimentArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="EXPERIMENT",
        help="Experiment file, or the name of one that ships with auvid. Default: the spiral.",
        show_default=False,
    ),
]
DataArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="EXPERIMENT|DATASET",
        help="Experiment whose dataset has been simulated, or a dataset file (.h5). Default: the spiral.",
        show_default=False,
    ),
]
ResultsArgument = Annotated[
    Path,
    typer.Argument(metavar="RESULTS", help="Results folder with dataset.h5 and estimates/."),
]
FilterOption = Annotated[
    list[FilterName] | None,
    typer.Option(
        "--filter", "-f", help="Filter to run; repeatable. Default: all of the experiment.", show_default=False
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help='Override a setting, e.g. --set sensors.dvl.rate="5 Hz"; repeatable.',
        show_default=False,
    ),
]
SeedOption = Annotated[
    int | None,
    typer.Option("--seed", min=0, help="Seed of all noise. Default: the experiment's.", show_default=False),
]
OutputOption = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="DIR", help="Results folder. Default: results/NAME.", show_default=False),
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
VerboseOption = Annotated[bool, typer.Option("--verbose", "-v", help="Also say how long each part took.")]
DryRunOption = Annotated[bool, typer.Option("--dry-run", help="Print the resolved settings as YAML and stop.")]


def overrides(settings: list[str] | None, seed: int | None) -> tuple[str, ...]:
    """Overrides in the order in which they apply; `--seed` is short for one of them."""
    return (*(settings or ()), *(() if seed is None else (f"seed={seed}",)))
