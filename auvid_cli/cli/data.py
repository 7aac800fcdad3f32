"""auvid import, inspect and export: data from a vehicle, and models for other programs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli import options
from auvid_cli.cli.streams import DONE, VERDICT_FAILED
from auvid_cli.cli.terminal import interrupts_deferred
from auvid_cli.config.enums import FormatName
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
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
