"""Options that several commands share, and their completion."""

from collections.abc import Callable, Iterable
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from auvid_cli.cli.streams import DONE
from auvid_cli.cli.terminal import Terminal, reporting_errors
from auvid_cli.config.enums import FigureFormat, FilterName
from auvid_cli.config.shipped import shipped_configs
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from auvid_cli.config.experiment import Experiment

_SETTINGS = (".yaml", ".yml")
_DATASETS = (".h5", ".hdf5")
_LOGS = (".csv", ".csv.gz", ".npz", ".mat", ".bag", ".mcap", ".db3", ".bin", ".tlog", ".ulg", ".lsf", ".alog")
_KEYS = Path(__file__).with_name("setting_keys.txt")
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
        help=f"Filter to run: {', '.join(name.value for name in FilterName)}; repeatable. Default: "
        "identification.filters. The smoother runs as well, because it judges the others; "
        "identification.judge=false omits it.",
        show_default=False,
    ),
]
SeedOption = Annotated[
    int | None,
    typer.Option(
        "--seed", metavar="N", min=0, help="Seed of all noise. Default: seed of the experiment.", show_default=False
    ),
]
UseOption = Annotated[
    list[str] | None,
    typer.Option(
        "--use",
        metavar="BEGIN:END",
        help="Use only this part of the data, s; BEGIN or END may be left out. Repeatable; each part has its own "
        "initial state.",
        show_default=False,
    ),
]
OverwriteOption = Annotated[
    bool,
    typer.Option("--overwrite", help="Replace existing results, and all files derived from them."),
]
OpenOption = Annotated[bool, typer.Option("--open", help="Open the page in a browser at the end.")]
FigureFormatOption = Annotated[
    list[FigureFormat] | None,
    typer.Option(
        "--figure-format",
        metavar="FORMAT",
        help=f"Format of figures: {', '.join(FigureFormat)}; repeatable. Default: png.",
        show_default=False,
    ),
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors.")]
DryRunOption = Annotated[bool, typer.Option("--dry-run", help="Print the resolved settings as YAML and exit.")]


def complete_experiment(incomplete: str) -> list[str]:
    """Return matching shipped experiments, and settings files of this folder."""
    return _beginning(incomplete, _shipped("."), _files_here(_SETTINGS))


def complete_data(incomplete: str) -> list[str]:
    """Return matching shipped experiments, and settings files and datasets of this folder."""
    return _beginning(incomplete, _shipped("."), _files_here((*_SETTINGS, *_DATASETS)))


def complete_campaign(incomplete: str) -> list[str]:
    """Return matching shipped campaigns, and settings files of this folder."""
    return _beginning(incomplete, _shipped("campaigns"), _files_here(_SETTINGS))


def complete_setting(incomplete: str) -> list[str]:
    """Return matching keys of an experiment, and settings files of this folder."""
    keys = _KEYS.read_text(encoding="utf-8").split()
    return _beginning(incomplete, (f"{key}=" for key in keys), _files_here(_SETTINGS))


def _beginning(incomplete: str, *offers: Iterable[str]) -> list[str]:
    return [name for names in offers for name in names if name.startswith(incomplete)]


def _shipped(folder: str) -> list[str]:
    return sorted(path.stem for path in (shipped_configs() / folder).glob("*.yaml"))


def _files_here(suffixes: tuple[str, ...]) -> list[str]:
    return sorted(path.name for path in Path().iterdir() if path.suffix in suffixes)


ExperimentArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="EXPERIMENT",
        help="Experiment file, folder with an experiment.yaml, or name of a shipped experiment. Default: spiral.",
        autocompletion=complete_experiment,
        show_default=False,
    ),
]


DataArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="EXPERIMENT|DATASET",
        help="Dataset file (.h5), or a simulated experiment. Default: spiral.",
        autocompletion=complete_data,
        show_default=False,
    ),
]


SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE|FILE",
        help='Override a setting, e.g. --set sensors.dvl.rate="5 Hz", or all settings of a YAML file; repeatable.',
        autocompletion=complete_setting,
        show_default=False,
    ),
]


def _as_folder(path: Path | None) -> Path | None:
    """Refuse a results folder with the name of a dataset file."""
    if path is not None and path.suffix in _DATASETS:
        raise typer.BadParameter(f"{path}: expected a results folder, such as {path.stem}")
    return path


OutputOption = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        callback=_as_folder,
        metavar="DIR",
        help="Results folder. Default: results/NAME, or the folder of the dataset.",
        show_default=False,
    ),
]


def command(function: Callable[..., int | None]) -> Callable[..., None]:
    """Return a function for typer that has one option for each field of the option groups of `function`.

    The result of `function` is the exit code; its errors are printed.
    """
    hints = get_type_hints(function, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    parameters: list[Parameter] = []
    for name, parameter in signature(function).parameters.items():
        if name in groups:
            parameters += _options_of(groups[name])
        else:
            parameters.append(parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[name]))

    @wraps(function)
    def parsed(**values: Any) -> None:
        for name, kind in groups.items():
            values[name] = kind(**{option.name: values.pop(option.name) for option in fields(kind)})
        with reporting_errors():
            raise typer.Exit(function(**values) or DONE)

    parsed.__signature__ = Signature(parameters)  # pyright: ignore[reportAttributeAccessIssue]
    parsed.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return parsed


def _options_of(kind: Any) -> list[Parameter]:
    hints = get_type_hints(kind, include_extras=True)
    return [
        Parameter(
            option.name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if option.default is MISSING else option.default,
            annotation=hints[option.name],
        )
        for option in fields(kind)
    ]


@dataclass(frozen=True)
class ExperimentOptions:
    """An experiment and overrides of its settings."""

    experiment: ExperimentArgument = None
    settings: SetOption = None
    seed: SeedOption = None

    def load(self) -> "tuple[Experiment, list[Path]]":
        """Return the experiment, and the files that it was read from."""
        from auvid_cli.config.loading import find_experiment, load_with_files

        refuse_log(self.experiment)
        return load_with_files(find_experiment(self.experiment), overrides(self.settings, self.seed))


def dataset_or_experiment(source: str | None, changes: tuple[str, ...]) -> "Path | tuple[Experiment, list[Path]]":
    """Return the path of a dataset file, or an experiment with the files that it was read from."""
    from auvid_cli.config.loading import find_experiment, load_with_files

    return dataset_path(source) or load_with_files(find_experiment(source), changes)


@dataclass(frozen=True)
class SettingOptions:
    """Overrides of the settings in a dataset."""

    settings: SetOption = None
    use: UseOption = None

    def overrides(self) -> tuple[str, ...]:
        """Return the overrides in the order in which they apply."""
        return overrides(self.settings, use=self.use)

    def words(self) -> list[str]:
        """Return the same overrides as words of a command line."""
        return [*(f"--set={setting}" for setting in self.settings or ()), *(f"--use={span}" for span in self.use or ())]


@dataclass(frozen=True)
class OutputOptions:
    """Results folder, and whether its results may be replaced."""

    output: OutputOption = None
    overwrite: OverwriteOption = False


@dataclass(frozen=True)
class FigureOptions:
    """Formats of figures, and whether the page is opened."""

    figure_format: FigureFormatOption = None
    show: OpenOption = False

    @property
    def formats(self) -> tuple[FigureFormat, ...]:
        """Return the formats of figures; png without the option."""
        return tuple(self.figure_format or (FigureFormat.PNG,))


@dataclass(frozen=True)
class TerminalOptions:
    """Amount of output."""

    quiet: QuietOption = False
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Also print the duration of each step.")] = False

    def terminal(self) -> Terminal:
        """Return the terminal that prints this amount."""
        return Terminal(self.quiet, self.verbose)


@dataclass(frozen=True)
class VerdictTerminalOptions(TerminalOptions):
    """Amount of output of a command that prints verdicts."""

    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also print passed checks and the duration of each step.")
    ] = False


def refuse_log(source: str | Path | None) -> None:
    """Raise a ConfigError for a log where a dataset or an experiment is expected."""
    if str(source).lower().endswith(_LOGS):
        raise ConfigError(f"{source}: expected a dataset; first run auvid import --suggest {source} -o map.yaml")


def dataset_path(source: str | None) -> Path | None:
    """Return the path of a dataset file, or None for an experiment."""
    refuse_log(source)
    return Path(source) if source is not None and source.endswith(_DATASETS) else None


def overrides(settings: list[str] | None, seed: int | None = None, use: list[str] | None = None) -> tuple[str, ...]:
    """Return the overrides of --set, --seed and --use in the order in which they apply."""
    seeds = () if seed is None else (f"seed={seed}",)
    return (*(settings or ()), *seeds, *((f"identification.use.spans={spans(use)}",) if use else ()))


def spans(texts: list[str]) -> str:
    """Return the spans of `--use` as a YAML list, with null for an open end."""
    from auvid_cli.config.units import parse_quantity

    pairs = []
    for span in texts:
        begin, colon, end = (part.strip() for part in span.partition(":"))
        try:
            times = [parse_quantity(bound, "s") for bound in (begin, end) if bound]
        except ValueError:
            times = []
        if not colon or not times:
            raise ConfigError(f"--use {span}: expected BEGIN:END in seconds, such as 0:80 or 80:")
        if times != sorted(set(times)):
            raise ConfigError(f"--use {span}: END must be later than BEGIN")
        pairs.append(f"[{begin or 'null'}, {end or 'null'}]")
    return f"[{', '.join(pairs)}]"
