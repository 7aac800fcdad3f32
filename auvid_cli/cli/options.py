"""Arguments and options that commands share."""

from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.completion import complete_data, complete_experiment, complete_setting
from auvid_cli.config.figure_format import FigureFormat
from auvid_cli.config.filter_name import FilterName
from auvid_cli.errors import ConfigError

ExperimentArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="EXPERIMENT",
        help="Experiment file, folder with an experiment.yaml, or the name of one that ships. Default: the spiral.",
        autocompletion=complete_experiment,
        show_default=False,
    ),
]
DataArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="EXPERIMENT|DATASET",
        help="Experiment whose dataset has been simulated, or a dataset file (.h5). Default: the spiral.",
        autocompletion=complete_data,
        show_default=False,
    ),
]
DatasetArgument = Annotated[
    Path,
    typer.Argument(metavar="DATASET", help="Dataset file (.h5): results/NAME/dataset.h5 after `auvid import`."),
]
ResultsArgument = Annotated[
    Path,
    typer.Argument(metavar="RESULTS", help="Results folder with dataset.h5 and estimates/."),
]
FilterOption = Annotated[
    list[FilterName] | None,
    typer.Option(
        "--filter",
        "-f",
        metavar="FILTER",
        help=f"Filter to run: {', '.join(name.value for name in FilterName)}; repeatable. Default: those of the "
        "settings. The smoother judges them.",
        show_default=False,
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE|FILE",
        help='Override a setting, e.g. --set sensors.dvl.rate="5 Hz", or those in a YAML file; repeatable.',
        autocompletion=complete_setting,
        show_default=False,
    ),
]
SeedOption = Annotated[
    int | None,
    typer.Option(
        "--seed", metavar="N", min=0, help="Seed of all noise. Default: the experiment's.", show_default=False
    ),
]
UseOption = Annotated[
    list[str] | None,
    typer.Option(
        "--use",
        metavar="BEGIN:END",
        help="Use only this time of the data, s; without BEGIN or END as far as they reach. Repeatable; each starts "
        "with a motion of its own.",
        show_default=False,
    ),
]


def _as_folder(path: Path | None) -> Path | None:
    """Refuse a name of a dataset for that of a folder, which would be made under it."""
    if path is not None and path.suffix in (".h5", ".hdf5"):
        raise typer.BadParameter(f"{path} is called like a file; expected a results folder, such as {path.stem}")
    return path


OutputOption = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        callback=_as_folder,
        metavar="DIR",
        help="Results folder. Default: results/NAME, or the folder of a dataset.h5.",
        show_default=False,
    ),
]
OverwriteOption = Annotated[
    bool,
    typer.Option("--overwrite", help="Replace what stands in the way, with all that was made from it."),
]
OpenOption = Annotated[bool, typer.Option("--open", help="Open the page in a browser when all is done.")]
FigureFormatOption = Annotated[
    list[FigureFormat] | None,
    typer.Option(
        "--figure-format",
        metavar="FORMAT",
        help=f"Write figures as {', '.join(FigureFormat)}; repeatable. Default: png.",
        show_default=False,
    ),
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
VerboseOption = Annotated[bool, typer.Option("--verbose", "-v", help="Also say how long each part took.")]
VerboseVerdictsOption = Annotated[
    bool, typer.Option("--verbose", "-v", help="Also print what passed, and how long each part took.")
]
DryRunOption = Annotated[bool, typer.Option("--dry-run", help="Print the resolved settings as YAML and stop.")]


_LOGS = (".csv", ".csv.gz", ".npz", ".mat", ".bag", ".mcap", ".db3", ".bin", ".tlog", ".ulg", ".lsf", ".alog")


def refuse_log(source: str | Path | None) -> None:
    """Refuse what is called like a log where a dataset or an experiment is meant; None is no log.

    Raises
    ------
    ConfigError
    """
    if str(source).lower().endswith(_LOGS):
        from auvid_cli.errors import ConfigError

        raise ConfigError(f"{source}: a log must become a dataset first: auvid import --suggest {source} -o map.yaml")


def dataset_path(source: str | None) -> Path | None:
    """Return the path of a dataset file, or None where an experiment is meant.

    Raises
    ------
    ConfigError
        If it is called like a log.
    """
    refuse_log(source)
    return Path(source) if source is not None and source.endswith((".h5", ".hdf5")) else None


def overrides(settings: list[str] | None, seed: int | None = None, use: list[str] | None = None) -> tuple[str, ...]:
    """Return overrides in the order in which they apply; `--seed` and `--use` are short for one each.

    Raises
    ------
    ConfigError
        If a span is no pair.
    """
    seeds = () if seed is None else (f"seed={seed}",)
    return (*(settings or ()), *seeds, *((f"identification.use.spans={spans(use)}",) if use else ()))


def spans(texts: list[str]) -> str:
    """Write spans, given as `--use` takes them, as a list in YAML; null where one has no beginning or no end.

    Raises
    ------
    ConfigError
        If one is no pair of times.
    """
    from auvid_cli.config.quantity import parse_quantity

    pairs = []
    for span in texts:
        begin, colon, end = (part.strip() for part in span.partition(":"))
        try:
            times = [parse_quantity(bound, "s") for bound in (begin, end) if bound]
        except ValueError:
            times = []
        if not colon or not times:
            raise ConfigError(f"--use {span}: expected BEGIN:END in seconds, such as 0:80, or 80: for all after that")
        if times != sorted(set(times)):
            raise ConfigError(f"--use {span}: ends before it begins, or as it does")
        pairs.append(f"[{begin or 'null'}, {end or 'null'}]")
    return f"[{', '.join(pairs)}]"
