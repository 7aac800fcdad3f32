"""auvid import, inspect, fit and export: from the logs of a vehicle to a model, and to other programs."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli import DONE, VERDICT_FAILED, options
from auvid_cli.cli.terminal import Terminal, interrupts_deferred
from auvid_cli.config.enums import FormatName
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from auvid_cli.api.analysis import FitResult
    from auvid_cli.api.files import RecordedData
    from auvid_cli.data.dataset import Dataset


_IMPORTED = "Output file. Default: results/NAME/dataset.h5; with --suggest the map is printed."
_EXPORTED = "Output file. Default: export/VEHICLE_FILTER.* in the results folder."
_MODELS = ", ".join(form.value for form in FormatName if not form.is_of_a_run)
_FORM = f"Format of the model: {_MODELS}; or mcap for the whole run."


@options.command
def import_log(
    *,
    logs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="LOG",
            help="Log file or bag, in the order of `logs` in the map, or NAME=FILE. Default: the files in the map.",
            show_default=False,
        ),
    ] = None,
    map_file: Annotated[
        Path | None, options.optional("MAP", "YAML file that assigns columns of the logs to signals.", "--map", "-m")
    ] = None,
    suggest: Annotated[
        bool, typer.Option("--suggest", help="Write a first map from the logs; check and complete it by hand.")
    ] = False,
    vehicle: Annotated[
        Path | None, options.optional("FILE", "Vehicle file for the suggested map. Default: the map asks.", "--vehicle")
    ] = None,
    like: Annotated[
        str | None, options.optional("NAME", "Shipped vehicle for the suggested map, such as remus100.", "--like")
    ] = None,
    output: Annotated[Path | None, options.optional("FILE", _IMPORTED, "--output", "-o")] = None,
    overwrite: options.OverwriteOption = False,
    console: options.TerminalOptions,
) -> None:
    """Convert logs of a vehicle to a dataset with a map file, or suggest a map file."""
    with interrupts_deferred():
        from auvid_cli.api.data import MappedLogs, import_into, suggest_into
        from auvid_cli.report.screens import print_import_report

    terminal = console.terminal()
    if suggest and map_file is not None:
        raise ConfigError("--suggest and --map: expected one of them; --suggest writes a map, --map reads one")
    if suggest and not logs:
        raise ConfigError("--suggest: expected log files, as in: auvid import --suggest LOG")
    if vehicle is not None and like is not None:
        raise ConfigError("--vehicle and --like: expected one of them")
    if not suggest and (vehicle is not None or like is not None):
        raise ConfigError("--vehicle and --like are for --suggest; a map names its vehicle itself")
    if suggest:
        text = suggest_into(output, [Path(log) for log in logs or ()], terminal, vehicle, like)
        if output is None:
            print(text, end="")
        else:
            terminal.print_wrapped(f"{output}: check every line marked `check:` and fill in the required values")
            terminal.print(f"next: auvid import --map {output}")
        return
    if map_file is None:
        raise ConfigError("missing --map MAP; to get a first map from the logs, use --suggest")
    mapped = MappedLogs(map_file, logs or [])
    terminal.print_sanity_warnings(mapped.settings.vehicle)
    path, _, conversion = import_into(output, mapped, overwrite, terminal)
    print_import_report(terminal.out, conversion.summaries, conversion.remarks)
    terminal.print_wrapped(f"{path}: t = 0 is {conversion.origin:.6f} s on the clock of the log")
    terminal.print(f"next: auvid inspect {path}")


@options.command
def inspect(
    *,
    dataset: options.DatasetArgument,
    use: Annotated[
        list[str] | None,
        options.optional("BEGIN:END", "Inspect only the data from BEGIN to END, s, such as 0:80. Default: all."),
    ] = None,
    output: options.OutputOptions,
    figures: options.FigureOptions,
    console: options.VerdictTerminalOptions,
) -> int:
    """Check recorded data before identification: signs, units, axes, clocks, gaps, spikes, excitation.

    Prints each check that did not pass, with advice. First fix every FAIL (exit code 1); a note is for information.
    Writes all verdicts (tables/inspection.csv), a timeline of the samples (figures/timeline) and a page
    (inspection.html) into the results folder.
    """
    from auvid_cli.api.data import inspect_into
    from auvid_cli.report.screen import print_checks

    dataset = options.dataset_file(dataset)
    terminal = console.terminal()
    place = output.destination(terminal, figures)
    inspected, inspection, files, page = inspect_into(place, dataset, options.overrides(None, use=use))
    print_checks(terminal.out, inspection.checks, passed=console.verbose)
    terminal.print_lines(files)
    part = "".join(f" --use {span}" for span in use or ())
    fails = len(inspection.checks.failed())
    if fails:
        checks = "1 check fails" if fails == 1 else f"{fails} checks fail"
        terminal.print_wrapped(
            f"{checks}. Next: correct the map and import again with --overwrite, or leave out bad times with "
            "--use BEGIN:END; then run `auvid inspect` again"
        )
    else:
        terminal.print_wrapped(f"no check fails{_missing_values(inspected)}")
        terminal.print(f"next: auvid fit {dataset}{part}")
    if figures.show:
        terminal.open_page(page)
    return VERDICT_FAILED if fails else DONE


def _missing_values(dataset: "Dataset") -> str:
    """Return the end of a sentence that names coefficients without a value; empty if all have one."""
    settings, stated = dataset.experiment.identification, dataset.experiment.vehicle.stated_coefficients()
    missing = [symbol for symbol in settings.fixed(dataset.experiment.vehicle) if symbol not in stated]
    if not missing:
        return ""
    return (
        f". First add values of {', '.join(missing)} to the vehicle file, or estimate them as well (add them to "
        "identification.coefficients)"
    )


@options.command
def export(
    *,
    path: Annotated[Path, typer.Argument(metavar="ESTIMATE", help="Estimate file, results/NAME/estimates/FILTER.h5.")],
    target: Annotated[FormatName, options.optional("FORM", _FORM, "--to")],
    output: Annotated[Path | None, options.optional("FILE", _EXPORTED, "--output", "-o")] = None,
    dataset: Annotated[
        Path | None, options.optional("DATASET", "Dataset of the estimate. Default: dataset.h5 in the results folder.")
    ] = None,
    overwrite: options.OverwriteOption = False,
    console: options.TerminalOptions,
) -> None:
    """Write an identified model, or a whole run (`--to mcap`), in the format of another program.

    Prints the features that the format does not support.
    """
    dataset = None if dataset is None else options.dataset_file(dataset)
    terminal = console.terminal()
    with terminal.compiling():
        from auvid_cli.api.export import export_into

    file, remarks = export_into(output, path, target, dataset, overwrite, terminal)
    terminal.print_lines([*remarks, file])


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
    the first model. If it is not sound, the process noise is estimated from the data. Then errors, delays, noise, a
    disturbance or terms are added one at a time, each only if the data support it. Ctrl-C ends the search and keeps the
    best model. The settings are written to fit.yaml; `auvid identify --set fit.yaml` repeats the estimate. Logs are
    imported first, with the map next to them.
    """
    changes, terminal = settings.overrides(), console.terminal()
    limit = float("inf") if max_time is None else _seconds(max_time)
    with terminal.compiling():
        from auvid_cli.api.analysis import fit_into
        from auvid_cli.api.files import RecordedData, read_dataset

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
    from auvid_cli.api.analysis import fit_into

    return print_fit(fit_into(output.destination(terminal), source), terminal)


def print_fit(result: "FitResult", terminal: Terminal) -> int:
    """Print what a search found, and the next command; returns the exit code."""
    from auvid_cli.report.screen import print_estimate
    from auvid_cli.report.sentences import fit_sentences, unexplained_sentences

    print_estimate(terminal.out, result.fit.estimate, result.fit.judgement)
    for sentence in [*fit_sentences(result.fit), *unexplained_sentences(result.fit)]:
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
