"""Options that several commands share, their completion, and the help of commands."""

import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, cleandoc, signature
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from rich.markup import escape
from typer.core import TyperCommand, TyperGroup

from auvid_cli.api import Destination
from auvid_cli.cli import DONE
from auvid_cli.cli.terminal import Terminal, reporting_errors
from auvid_cli.config.enums import FigureFormat, FilterName, shipped_configs
from auvid_cli.data.files import dataset_in
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from auvid_cli.api.files import DataSource, SimulatedData
    from auvid_cli.config.experiment import RunSettings

BOTH_HELPS = {"help_option_names": ["-h", "--help"]}  # context settings of each command
_SETTINGS = (".yaml", ".yml")
DATASETS = (".h5", ".hdf5")
_LOGS = (".csv", ".csv.gz", ".npz", ".mat", ".bag", ".mcap", ".db3", ".bin", ".tlog", ".ulg", ".lsf", ".alog")
_KEYS = Path(__file__).with_name("setting_keys.txt")


def optional(metavar: str, text: str, *names: str, **more: Any) -> Any:
    """Return an option whose help shows no default value."""
    return typer.Option(*names, metavar=metavar, help=text, show_default=False, **more)


def _offering(names: Callable[[], Iterable[str]], suffixes: tuple[str, ...]) -> Callable[[str], list[str]]:
    """Return a completion by names, then by files in the working folder with one of the suffixes."""

    def complete(incomplete: str) -> list[str]:
        files = sorted(path.name for path in Path().iterdir() if path.suffix in suffixes)
        return [name for name in (*names(), *files) if name.startswith(incomplete)]

    return complete


def _shipped(folder: str) -> Callable[[], list[str]]:
    return lambda: sorted(path.stem for path in (shipped_configs() / folder).glob("*.yaml"))


complete_campaign = _offering(_shipped("campaigns"), _SETTINGS)
_complete_experiment = _offering(_shipped("."), _SETTINGS)
_complete_data = _offering(_shipped("."), (*_SETTINGS, *DATASETS))
_complete_setting = _offering(lambda: (f"{key}=" for key in _KEYS.read_text(encoding="utf-8").split()), _SETTINGS)


def _as_folder(path: Path | None) -> Path | None:
    """Refuse a results folder with the name of a dataset file."""
    if path is not None and path.suffix in DATASETS:
        raise typer.BadParameter(f"{path}: expected a results folder, such as {path.stem}")
    return path


DatasetArgument = Annotated[
    Path,
    typer.Argument(
        metavar="DATASET", help="Dataset file (.h5), or its results folder: results/NAME after `auvid import`."
    ),
]
ResultsArgument = Annotated[
    Path, typer.Argument(metavar="RESULTS", help="Results folder with dataset.h5 and estimates/.")
]
DataArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="EXPERIMENT|DATASET",
        help="Dataset file (.h5), or experiment (file or shipped name). Default: spiral.",
        autocompletion=_complete_data,
        show_default=False,
    ),
]
_FILTERS = (
    f"Filter to run: {', '.join(name.value for name in FilterName)}; repeatable. Default: identification.filters. The "
    "smoother runs as well, because it judges the others; identification.judge=false omits it."
)
FilterOption = Annotated[list[FilterName] | None, optional("FILTER", _FILTERS, "--filter", "-f")]
SeedOption = Annotated[int | None, optional("N", "Seed of all noise. Default: seed of the experiment.", min=0)]
_USE = (
    "Use only the data from BEGIN to END, s; one of them may be missing. Repeatable; each part has its own initial "
    "state."
)
UseOption = Annotated[list[str] | None, optional("BEGIN:END", _USE)]
_SET = 'Override a setting, e.g. --set sensors.dvl.rate="5 Hz", or all settings that a YAML file contains; repeatable.'
SetOption = Annotated[list[str] | None, optional("KEY=VALUE|FILE", _SET, "--set", autocompletion=_complete_setting)]
_OUTPUT = "Results folder. Default: results/NAME, or the folder of the dataset."
OverwriteOption = Annotated[
    bool, typer.Option("--overwrite", help="Replace existing results, and all files derived from them.")
]
_FORMATS = f"Format of figures: {', '.join(FigureFormat)}; repeatable. Default: png."
FigureFormatOption = Annotated[list[FigureFormat] | None, optional("FORMAT", _FORMATS)]
_SCHEDULER = (
    "Dask scheduler, such as tls://HOST:8786. Default: this machine only. "
    "With tcp://, anyone who can reach the scheduler can run code on it."
)
SchedulerOption = Annotated[str | None, optional("ADDRESS", _SCHEDULER)]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors.")]
DryRunOption = Annotated[bool, typer.Option("--dry-run", help="Print the resolved settings as YAML and exit.")]


class Command(TyperCommand):
    """Command whose help shows no Python types of flags and arguments."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, without the types of flags and arguments."""
        return _without_types(super().get_params(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line; remove the prefix of pydantic from error messages."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            error.message = error.message.removeprefix("Value error, ")
            raise


class Group(TyperGroup):
    """Group of commands whose help shows no Python types."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, without the types of flags and arguments."""
        return _without_types(super().get_params(ctx))


def paragraphs(function: Callable[..., None]) -> str:
    """Return the docstring of a command, one line per paragraph."""
    return "\n\n".join(" ".join(part.split()) for part in cleandoc(function.__doc__ or "").split("\n\n"))


def examples_text(examples: Sequence[str]) -> str:
    """Return the examples below the help of a command."""
    return "\n".join(["Example:" if len(examples) == 1 else "Examples:", *map(escape, examples)])


def _without_types(params: list[Any]) -> list[Any]:
    for param in params:
        if param.param_type_name == "argument":
            param.display_type_rich = lambda ctx: None
        elif param.is_flag:
            param.metavar = ""
    return params


def command(function: Callable[..., int | None]) -> Callable[..., None]:
    """Return a function for typer that has one option for each field of the option groups of `function`.

    The result of `function` is the exit code; errors that it raises are printed.
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

    experiment: Annotated[
        str | None,
        typer.Argument(
            metavar="EXPERIMENT",
            help="Experiment file, folder with an experiment.yaml, or name of a shipped experiment. Default: spiral.",
            autocompletion=_complete_experiment,
            show_default=False,
        ),
    ] = None
    settings: SetOption = None
    seed: SeedOption = None

    def load(self) -> "SimulatedData":
        """Return the experiment, and the files that it was read from."""
        refuse_log(self.experiment)
        return _experiment(self.experiment, overrides(self.settings, self.seed))


def _experiment(name: str | None, changes: tuple[str, ...]) -> "SimulatedData":
    from auvid_cli.api.files import SimulatedData
    from auvid_cli.config.loading import find_experiment, load_with_files

    return SimulatedData(*load_with_files(find_experiment(name), changes))


def data_source(name: str | None, changes: tuple[str, ...]) -> "DataSource":
    """Return a dataset file, read with overrides of its settings, or an experiment."""
    path = dataset_path(name)
    if path is None:
        return _experiment(name, changes)
    from auvid_cli.api.files import RecordedData, read_dataset

    return RecordedData(path, read_dataset(path, *changes))


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

    output: Annotated[Path | None, optional("DIR", _OUTPUT, "--output", "-o", callback=_as_folder)] = None
    overwrite: OverwriteOption = False

    def words(self) -> list[str]:
        """Return the same results folder as words of a command line."""
        return [] if self.output is None else ["-o", str(self.output)]

    def destination(self, progress: Terminal, figures: "FigureOptions | None" = None) -> Destination:
        """Return where and how a command writes its results."""
        return Destination(self.output, self.overwrite, progress, figures.formats if figures else ())


@dataclass(frozen=True)
class FigureOptions:
    """Formats of figures, and whether the page is opened."""

    figure_format: FigureFormatOption = None
    show: Annotated[bool, typer.Option("--open", help="Open the page in a browser at the end.")] = False

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


def is_log(source: str | Path | None) -> bool:
    """Whether a path has the suffix of a log, or is a folder of logs."""
    return source is not None and (
        str(source).lower().endswith(_LOGS) or (Path(source).is_dir() and dataset_file(Path(source)) == Path(source))
    )


def refuse_log(source: str | Path | None) -> None:
    """Raise a ConfigError for a log where a dataset or an experiment is expected."""
    if str(source).lower().endswith(_LOGS):
        raise ConfigError(f"{source}: expected a dataset; first run auvid import --suggest {source} -o map.yaml")


def dataset_file(path: Path) -> Path:
    """Return the path of a dataset file; of a results folder, that of its dataset.

    Raises
    ------
    ConfigError
        If it is a log.
    """
    refuse_log(path)
    of_folder = path / "dataset.h5"
    return of_folder if of_folder.is_file() else path


def dataset_path(source: str | None) -> Path | None:
    """Return the path of a dataset file, or None for an experiment."""
    if source is None:
        return None
    path = dataset_file(Path(source))
    return path if path.name.endswith(DATASETS) else None


def overrides(settings: list[str] | None, seed: int | None = None, use: list[str] | None = None) -> tuple[str, ...]:
    """Return the overrides of --set, --seed and --use in the order in which they apply."""
    seeds = () if seed is None else (f"seed={seed}",)
    return (*(settings or ()), *seeds, *((f"identification.use.spans={spans(use)}",) if use else ()))


def fit_command(folder: Path, settings: "RunSettings | None") -> str:
    """Return the command that finds a model of the data of an estimate, in the folder `fit` next to the estimate.

    Parameters
    ----------
    folder : Path
        Results folder with the dataset.
    settings : RunSettings, optional
        Of the estimate; the same spans are used.
    """
    spans = () if settings is None else settings.identification.use.spans
    ends = [[f"{time:.10g}" if isfinite(time) else "" for time in span] for span in spans]
    used = [f"--use={begin}:{end}" for begin, end in ends]
    return shlex.join(["auvid", "fit", str(dataset_in(folder)), *used, "-o", str(folder / "fit")])


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
