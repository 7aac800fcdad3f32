"""auvid fit: from a dataset, or logs with their map, to a model that holds."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli import options
from auvid_cli.cli.streams import DONE, VERDICT_FAILED
from auvid_cli.cli.terminal import Terminal
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from auvid_cli.api.files import RecordedData
    from auvid_cli.api.fit import FitResult

_DATA = "Dataset file (.h5) or its results folder, or log files or bags with a map."
_MAP_NAME = "map.yaml"
_MAP = f"Map of the logs. Default: {_MAP_NAME} next to the first log."
_ONLY = "Kinds of additions that may be tried, such as current,gyro; see docs/how-to/fit.md. Default: all."
_NOT = "Kinds of additions that may not be tried, such as disturbance,term."
_IGNORE = "Search even if the inspection finds a wrong sign, unit, axis or clock."
_TIME = "Processor time after which the search ends with the best model so far, such as '5 min'. Default: no limit."


@options.command
def fit(
    *,
    data: Annotated[list[Path], typer.Argument(metavar="DATASET|LOG...", help=_DATA)],
    map_file: Annotated[Path | None, options.optional("MAP", _MAP, "--map", "-m")] = None,
    only: Annotated[str | None, options.optional("KINDS", _ONLY)] = None,
    excluded: Annotated[str | None, options.optional("KINDS", _NOT, "--not")] = None,
    max_time: Annotated[str | None, options.optional("QUANTITY", _TIME)] = None,
    ignore_inspection: Annotated[bool, typer.Option("--ignore-inspection", help=_IGNORE)] = False,
    settings: options.SettingOptions,
    output: options.OutputOptions,
    console: options.TerminalOptions,
) -> int:
    """Find a model that explains a dataset, and show every decision; exit code 1 if the model is not sound.

    The data are inspected first; a wrong sign, unit, axis or clock ends the command. The settings of the dataset are
    the first model. If it does not hold, the process noise is found from the data, and
    errors, delays, noise, a disturbance or terms are added one at a time, each only if the data support it. Ctrl-C
    ends the search and keeps the best model. The settings are written to fit.yaml; `auvid identify --set fit.yaml`
    repeats the estimate. Logs are imported first, with the map that lies next to them.
    """
    changes, terminal = settings.overrides(), console.terminal()
    limit = float("inf") if max_time is None else _seconds(max_time)
    with terminal.compiling():
        from auvid_cli.api.files import RecordedData, read_dataset
        from auvid_cli.api.fit import fit_into

    path = (
        _imported(data, map_file, output.overwrite, terminal)
        if map_file or _are_logs(data)
        else options.dataset_file(data[0])
    )
    source = RecordedData(path, read_dataset(path, *changes))
    result = fit_into(output.destination(terminal), source, _kinds(only), _kinds(excluded), limit, ignore_inspection)
    return print_fit(result, terminal)


def fit_of_run(source: "RecordedData", output: options.OutputOptions, terminal: Terminal) -> int:
    """Find a model of the dataset of a run, and print it; returns the exit code."""
    from auvid_cli.api.fit import fit_into

    return print_fit(fit_into(output.destination(terminal), source), terminal)


def print_fit(result: "FitResult", terminal: Terminal) -> int:
    """Print what a search found, and the next command; returns the exit code."""
    from auvid_cli.report.sentences import fit_sentences

    for sentence in fit_sentences(result.fit):
        terminal.print_wrapped(sentence)
    terminal.print_lines([*result.files, result.page])
    folder, is_sound = shlex.quote(str(result.folder)), result.fit.is_sound
    terminal.print(f"next: auvid {'report' if is_sound else 'check'} {folder}")
    return DONE if is_sound else VERDICT_FAILED


def _are_logs(data: list[Path]) -> bool:
    if len(data) == 1:
        return options.is_log(data[0])
    if datasets := [path for path in data if path.suffix in options.DATASETS]:
        raise ConfigError(f"{datasets[0]}: expected one dataset, or only logs")
    return True


def _imported(logs: list[Path], map_file: Path | None, overwrite: bool, terminal: Terminal) -> Path:
    """Import logs, and return the path of the dataset."""
    from auvid_cli.api.data import MappedLogs, import_into

    chosen = map_file or logs[0].parent / _MAP_NAME
    if not chosen.is_file():
        words = shlex.join(["auvid", "import", "--suggest", *map(str, logs), "-o", str(chosen)])
        raise ConfigError(f"{chosen}: no such map; name one with --map, or write a first one: {words}")
    mapped = MappedLogs(chosen, [str(log) for log in logs])
    terminal.print_sanity_warnings(mapped.settings.vehicle)
    path, _, _ = import_into(None, mapped, overwrite, terminal)
    terminal.print(f"{path}: imported with {chosen}")
    return path


def _kinds(text: str | None) -> list[str]:
    return [] if text is None else [kind.strip() for kind in text.split(",") if kind.strip()]


def _seconds(text: str) -> float:
    from auvid_cli.config.units import parse_quantity

    try:
        value = parse_quantity(text, "s")
    except ValueError as error:
        raise ConfigError(f"--max-time: {error}") from None
    if not value > 0.0:
        raise ConfigError(f"--max-time {text}: must be larger than 0 s")
    return value
