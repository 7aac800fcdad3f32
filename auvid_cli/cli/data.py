"""auvid import, inspect and export: data from a vehicle, and models for other programs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli.options import (
    DatasetArgument,
    FigureOptions,
    OutputOptions,
    OverwriteOption,
    TerminalOptions,
    VerdictTerminalOptions,
    command,
    overrides,
    refuse_log,
)
from auvid_cli.cli.streams import DONE, VERDICT_FAILED
from auvid_cli.cli.terminal import interrupts_deferred
from auvid_cli.config.enums import FormatName
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from auvid_cli.data.dataset import Dataset


@command
def import_log(
    *,
    logs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="LOG",
            help="Log files or bags, in the order of the map's `logs`, or NAME=FILE. Default: those that it names.",
            show_default=False,
        ),
    ] = None,
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map", "-m", metavar="MAP", help="YAML file that says what is what in the logs.", show_default=False
        ),
    ] = None,
    suggest: Annotated[
        bool, typer.Option("--suggest", help="Look at the logs and write a first map, to be checked and filled in.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Dataset, or with --suggest the map. Default: results/NAME/dataset.h5; a map goes to the screen.",
            show_default=False,
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    console: TerminalOptions,
) -> None:
    """Convert a vehicle's logs to a dataset, or suggest the map by which to do so."""
    with interrupts_deferred():
        from auvid_cli.api.data import MappedLogs, import_into, suggest_into
        from auvid_cli.report.screens import print_import_report

    terminal = console.terminal()
    if suggest and map_file is not None:
        raise ConfigError("--suggest writes a map and --map reads one: say one of them")
    if suggest and not logs:
        raise ConfigError("name the logs that a map is to be suggested from: auvid import --suggest LOG")
    if suggest:
        text = suggest_into(output, [Path(log) for log in logs or ()], terminal)
        if output is None:
            print(text, end="")
        else:
            terminal.print_wrapped(f"{output}: look at every line with `check:` and fill in what is required, then")
            terminal.print(f"auvid import --map {output}")
        return
    if map_file is None:
        raise ConfigError("say --map MAP to import logs, or --suggest to have a map suggested from them")
    mapped = MappedLogs(map_file, logs or [])
    terminal.print_sanity_warnings(mapped.settings.vehicle)
    path, _, conversion = import_into(output, mapped, overwrite, terminal)
    print_import_report(terminal.out, conversion.summaries, conversion.remarks)
    terminal.print_wrapped(f"{path}: t = 0 is {conversion.origin:.6f} s by the log's clock")
    terminal.print(f"next: auvid inspect {path}")


@command
def inspect(
    *,
    dataset: DatasetArgument,
    use: Annotated[
        list[str] | None,
        typer.Option(
            "--use",
            metavar="BEGIN:END",
            help="Look at this time of the data only, s, such as 0:80. Default: all.",
            show_default=False,
        ),
    ] = None,
    output: OutputOptions,
    figures: FigureOptions,
    console: VerdictTerminalOptions,
) -> int:
    """Judge recorded data before anybody identifies from them: signs, units, axes, clocks, gaps, spikes, excitation.

    Prints what did not pass, each with what to do about it: FAIL is to be mended first (exit code 1), note is worth
    knowing. The results folder gets all verdicts (tables/inspection.csv), what was recorded when (figures/timeline),
    and both on a page (inspection.html).
    """
    from auvid_cli.api.data import inspect_into
    from auvid_cli.report.screen import print_checks

    refuse_log(dataset)
    terminal = console.terminal()
    inspected, inspection, files, page = inspect_into(
        output.output, dataset, overrides(None, use=use), output.overwrite, figures.formats, terminal
    )
    print_checks(terminal.out, inspection.checks, passed=console.verbose)
    terminal.print_lines(files)
    part = "".join(f" --use {span}" for span in use or ())
    fails = len(inspection.checks.failed())
    if fails:
        verdicts = "1 verdict fails" if fails == 1 else f"{fails} verdicts fail"
        terminal.print_wrapped(
            f"{verdicts}. Next: mend the map and import again with --overwrite, or leave out bad times with "
            "--use BEGIN:END; then `auvid inspect` again"
        )
    else:
        terminal.print_wrapped(f"nothing fails. Next: {_next(inspected, f'{dataset}{part}')}")
    if figures.show:
        terminal.open_page(page)
    return VERDICT_FAILED if fails else DONE


def _next(dataset: "Dataset", name: str) -> str:
    """Return the commands that work with the known properties of the vehicle."""
    settings = dataset.experiment.identification
    known = dataset.known_coefficients()
    stated = dataset.experiment.vehicle.stated_coefficients()
    if without_value := [symbol for symbol in settings.fixed(dataset.experiment.vehicle) if symbol not in stated]:
        return (
            f"state values of {', '.join(without_value)} in the vehicle file, or estimate them "
            "(identification.coefficients leaves them out)"
        )
    if all(symbol in known for symbol in settings.estimated(dataset.experiment.vehicle)):
        return f"`auvid identifiability {name}`, then `auvid identify` alike"
    filters = settings.with_judge(settings.default_filters())
    return (
        f"`auvid identify {name}`, then `auvid identifiability {name} --at` with its estimate "
        f"estimates/{filters[0].value}.h5, for the vehicle file does not state every coefficient"
    )


@command
def export(
    *,
    path: Annotated[Path, typer.Argument(metavar="ESTIMATE", help="Estimate file, results/NAME/estimates/FILTER.h5.")],
    target: Annotated[
        FormatName,
        typer.Option(
            "--to",
            metavar="FORM",
            help=f"Form of the model, {', '.join(form.value for form in FormatName if not form.is_of_a_run)}, "
            "or of the run, mcap.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="File to write. Default: export/VEHICLE_FILTER.* in the results folder.",
            show_default=False,
        ),
    ] = None,
    dataset: Annotated[
        Path | None,
        typer.Option(
            "--dataset",
            metavar="DATASET",
            help="Dataset that the estimate was made from. Default: dataset.h5 of the results folder.",
            show_default=False,
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    console: TerminalOptions,
) -> None:
    """Write an identified model, or with `--to mcap` a whole run, for other programs, and say what they cannot hold."""
    refuse_log(dataset)
    terminal = console.terminal()
    with terminal.compiling():
        from auvid_cli.api.export import export_into

    file, remarks = export_into(output, path, target, dataset, overwrite, terminal)
    terminal.print_lines([*remarks, file])
