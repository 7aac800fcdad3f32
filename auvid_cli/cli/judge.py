"""auvid check, identifiability, validate and compare: how good data and estimates are."""

from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli.options import (
    DataArgument,
    FigureOptions,
    OutputOptions,
    QuietOption,
    ResultsArgument,
    SeedOption,
    SettingOptions,
    TerminalOptions,
    UseOption,
    VerdictTerminalOptions,
    command,
    dataset_or_experiment,
    overrides,
    refuse_log,
)
from auvid_cli.cli.streams import DONE, VERDICT_FAILED
from auvid_cli.cli.terminal import Terminal
from auvid_cli.errors import ConfigError


@command
def check(*, results: ResultsArgument = Path("results/spiral"), console: VerdictTerminalOptions) -> int:
    """Judge every estimate of a results folder; exit code 1 if a verdict fails.

    Prints what did not pass, each with what to do about it: FAIL is against the estimate, note is worth knowing. The
    results folder gets all verdicts (tables/checks.csv).
    """
    terminal = console.terminal()
    with terminal.compiling():
        from auvid_cli.api.results import check_into
        from auvid_cli.report.screen import print_checks

    verdicts, file = check_into(results, terminal)
    print_checks(terminal.out, verdicts, passed=console.verbose)
    terminal.print(file)
    return VERDICT_FAILED if verdicts.failed() else DONE


@command
def identifiability(
    *,
    data: DataArgument = None,
    settings: SettingOptions,
    seed: SeedOption = None,
    at: Annotated[
        Path | None,
        typer.Option(
            "--at",
            metavar="ESTIMATE",
            help="Estimate file (.h5) at whose coefficients to look; for a vehicle that states none.",
            show_default=False,
        ),
    ] = None,
    output: OutputOptions,
    figures: FigureOptions,
    console: TerminalOptions,
) -> None:
    """Say what data can tell of each coefficient at best, before any filter runs.

    An experiment is simulated for it, a dataset file taken as it is. The bounds hold at the true coefficients of a
    simulation, else at those of the vehicle file.
    """
    changes = overrides(settings.settings, seed, settings.use)
    source, terminal = dataset_or_experiment(data, changes), console.terminal()
    with terminal.compiling():
        from auvid_cli.api.results import identifiability_into
        from auvid_cli.report.screen import print_identifiability

    if not isinstance(source, Path):
        terminal.print_sanity_warnings(source[0].vehicle)
    result = identifiability_into(output.output, source, changes, at, output.overwrite, figures.formats, terminal)
    terminal.print(f"{result.dataset.experiment.vehicle.name}, at {result.where}:")
    print_identifiability(terminal.out, result.bounds)
    terminal.print_lines(result.files)
    if figures.show:
        terminal.open_page(result.page)


@command
def validate(
    *,
    estimate_file: Annotated[
        Path, typer.Argument(metavar="ESTIMATE", help="Estimate file (.h5), e.g. results/spiral/estimates/ckf.h5.")
    ],
    dataset_files: Annotated[
        list[Path],
        typer.Argument(metavar="DATASET", help="Dataset files (.h5) of other runs than it was made from."),
    ],
    use: UseOption = None,
    anew: Annotated[
        bool, typer.Option("--anew", help="Find thrust, fin trims and ballast anew in each run, constants too.")
    ] = False,
    output: OutputOptions,
    figures: FigureOptions,
    console: VerdictTerminalOptions,
) -> int:
    """Say how well an identified model predicts a run that it has not seen; exit code 1 if it does not.

    The estimate's vehicle and coefficients move by the dataset's inputs alone: in one free run, and from many starts
    over horizons of 0.5 to 50 s. The errors stand beside those of the prior, of a motion that goes on unchanged, and
    beside what the stated uncertainties amount to. Several datasets, and all segments of each (--use, of all of them),
    are judged together; the results stand beside the first.
    """
    for path in dataset_files:
        refuse_log(path)
    changes, terminal = overrides(None, use=use), console.terminal()
    with terminal.compiling():
        from auvid_cli.api.results import validate_into
        from auvid_cli.report.screen import print_validation

    validation, files, page = validate_into(
        output.output, estimate_file, dataset_files, changes, anew, output.overwrite, figures.formats, terminal
    )
    print_validation(terminal.out, validation, passed=console.verbose)
    terminal.print_lines(files)
    if figures.show:
        terminal.open_page(page)
    return VERDICT_FAILED if validation.checks.failed() else DONE


@command
def compare(
    *,
    first: Annotated[Path, typer.Argument(metavar="RESULTS", help="Results folder.")],
    second: Annotated[
        Path, typer.Argument(metavar="REFERENCE", help="Results folder to compare with, or a copy of its tables.")
    ],
    relative: Annotated[
        list[str] | None,
        typer.Option(
            "--relative",
            "-r",
            metavar="SHARE|COLUMN=SHARE",
            help="Share that values may differ by, of all columns or of one (inf: not compared); repeatable. Default: "
            "0.01, and none of estimates.",
            show_default=False,
        ),
    ] = None,
    deviations: Annotated[
        float | None,
        typer.Option(
            "--deviations",
            metavar="N",
            min=0.0,
            help="What an estimate may differ by, in its standard deviations. Default: 0.01.",
            show_default=False,
        ),
    ] = None,
    quiet: QuietOption = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print all values, not only those that differ.")] = (
        False
    ),
) -> int:
    """Put the tables of two results side by side; exit code 1 if they differ by more than they may.

    What the second has in coefficients.csv, summary.csv and velocity_error.csv, the first must have, and alike: text to
    the letter, numbers within tolerances. Processor times, and judgements in sentences, are not compared.
    """
    from auvid_cli.api.data import compare_results
    from auvid_cli.report.screens import print_comparison

    terminal = Terminal(quiet, verbose)
    comparison = compare_results(first, second, *_shares(relative or []), deviations)
    terminal.print(f"first: {first}; second: {second}")
    print_comparison(terminal.out, comparison, everything=verbose)
    differing = len(comparison.differing())
    terminal.print(f"{differing} of {len(comparison.values)} values differ" if differing else "the results agree")
    return VERDICT_FAILED if differing else DONE


def _shares(texts: list[str]) -> tuple[float | None, dict[str, float]]:
    """Return the share of all columns, if there is one, and those of single columns; the last one counts.

    Raises
    ------
    ConfigError
        If one is not a share.
    """
    everywhere, by_column = None, {}
    for text in texts:
        column, equals, number = text.rpartition("=")
        try:
            share = float(number)
        except ValueError:
            share = -1.0
        if not share >= 0.0 or (equals and not column):
            raise ConfigError(f"--relative {text}: expected a share such as 0.01, or COLUMN=SHARE such as rmse=0.05")
        if column:
            by_column[column] = share
        else:
            everywhere = share
    return everywhere, by_column
