"""auvid check, identifiability, validate and compare: judge data and estimates."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from auvid_cli.cli import DONE, VERDICT_FAILED, options
from auvid_cli.cli.terminal import Terminal
from auvid_cli.data.files import dataset_in, estimates_in
from auvid_cli.errors import ConfigError

_RELATIVE = (
    "Largest relative difference allowed in all columns, or in one column (inf: not compared); repeatable. Default: "
    "0.01, except for estimates, see --deviations."
)


@options.command
def check(*, results: options.ResultsArgument = Path("results/spiral"), console: options.VerdictTerminalOptions) -> int:
    """Check every estimate of a results folder; exit code 1 if a check fails.

    Prints each check that did not pass, with advice. FAIL means: do not trust the estimate. A note is for information.
    Writes all verdicts into tables/checks.csv.
    """
    terminal = console.terminal()
    with terminal.compiling():
        from auvid_cli.api.results import check_into
        from auvid_cli.report.screen import print_checks

    verdicts, file = check_into(results, terminal)
    print_checks(terminal.out, verdicts, passed=console.verbose)
    terminal.print(file)
    if not verdicts.failed():
        return DONE
    terminal.print(f"next: {_after_failure(results)}")
    return VERDICT_FAILED


@options.command
def identifiability(
    *,
    data: options.DataArgument = None,
    settings: options.SettingOptions,
    seed: options.SeedOption = None,
    at: Annotated[
        Path | None,
        options.optional("ESTIMATE", "Estimate file (.h5) with coefficients, if the vehicle file has none."),
    ] = None,
    output: options.OutputOptions,
    figures: options.FigureOptions,
    console: options.TerminalOptions,
) -> None:
    """Compute the best possible accuracy of each coefficient (Cramér-Rao bound), before any filter runs.

    Takes a dataset file, or an experiment, which is simulated first. Without --at, the bounds are computed at the true
    coefficients of a simulation, or at those of the vehicle file.
    """
    source = options.data_source(data, options.overrides(settings.settings, seed, settings.use))
    terminal = console.terminal()
    with terminal.compiling():
        from auvid_cli.api.files import SimulatedData
        from auvid_cli.api.results import identifiability_into
        from auvid_cli.report.screen import print_identifiability

    if isinstance(source, SimulatedData):
        terminal.print_sanity_warnings(source.experiment.vehicle)
    result = identifiability_into(output.destination(terminal, figures), source, at)
    terminal.print(f"{source.experiment.vehicle.name}, at {result.where}:")
    print_identifiability(terminal.out, result.bounds)
    terminal.print_lines(result.files)
    if figures.show:
        terminal.open_page(result.page)


@options.command
def validate(
    *,
    estimate_file: Annotated[
        Path, typer.Argument(metavar="ESTIMATE", help="Estimate file (.h5), e.g. results/spiral/estimates/ckf.h5.")
    ],
    dataset_files: Annotated[
        list[Path],
        typer.Argument(metavar="DATASET", help="Dataset files (.h5) of other runs, which the estimate has not seen."),
    ],
    use: options.UseOption = None,
    anew: Annotated[
        bool, typer.Option("--anew", help="Estimate thrust, fin trims and ballast again in each run.")
    ] = False,
    output: options.OutputOptions,
    figures: options.FigureOptions,
    console: options.VerdictTerminalOptions,
) -> int:
    """Test how well an identified model predicts another run; exit code 1 if it fails.

    The model is simulated with the recorded inputs only: once over the whole run (free run), and from many starting
    times over horizons of 0.5 to 50 s. The errors are compared with those of the vehicle file, of the prior and of an
    unchanged motion, and with the uncertainty of the estimate. Several datasets are judged together; --use applies
    to all of them. The results are written next to the first dataset.
    """
    dataset_files = [options.dataset_file(path) for path in dataset_files]
    changes, terminal = options.overrides(None, use=use), console.terminal()
    with terminal.compiling():
        from auvid_cli.api.results import validate_into
        from auvid_cli.report.screen import print_validation

    place = output.destination(terminal, figures)
    validation, files, page = validate_into(place, estimate_file, dataset_files, changes, anew)
    print_validation(terminal.out, validation, passed=console.verbose)
    terminal.print_lines(files)
    failed = bool(validation.checks.failed())
    export = f"auvid export {shlex.quote(str(estimate_file))} --to yaml"
    results = estimate_file.parent.parent
    after = _after_failure(results, is_too_wide=validation.has_only_wide_bands)
    terminal.print(f"next: {after if failed else export}")
    if figures.show:
        terminal.open_page(page)
    return VERDICT_FAILED if failed else DONE


def _after_failure(folder: Path, is_too_wide: bool = False) -> str:
    """Return the command to continue with if an estimate in a results folder fails."""
    from auvid_cli.data.estimate_file import read_estimate

    dataset = dataset_in(folder)
    if is_too_wide and dataset.is_file():
        # The model predicts well, but states too much uncertainty: its process noise may be too large.
        return f"auvid tune {shlex.quote(str(dataset))}"
    if dataset.is_file() and not (folder / "fit.yaml").is_file():
        estimates = [*estimates_in(folder).values()]
        return options.fit_command(folder, read_estimate(estimates[0]).experiment if estimates else None)
    # A search has been made: the report shows what it left unexplained.
    return f"auvid report {shlex.quote(str(folder))}"


@options.command
def compare(
    *,
    first: Annotated[Path, typer.Argument(metavar="RESULTS", help="Results folder.")],
    second: Annotated[
        Path, typer.Argument(metavar="REFERENCE", help="Results folder of the reference, or a copy of its tables.")
    ],
    relative: Annotated[list[str] | None, options.optional("SHARE|COLUMN=SHARE", _RELATIVE, "--relative", "-r")] = None,
    deviations: Annotated[
        float | None,
        options.optional(
            "N", "Largest difference allowed in an estimate, in its standard deviations. Default: 0.01.", min=0.0
        ),
    ] = None,
    quiet: options.QuietOption = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print all values, not only those that differ.")] = (
        False
    ),
) -> int:
    """Compare the tables of two results folders; exit code 1 if they differ by more than the tolerances.

    Compares coefficients.csv, summary.csv and velocity_error.csv. Every value of the reference must be in the first
    folder: texts must be equal, numbers within the tolerances. Processor times and sentences are not compared.
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
    """Return the share of all columns (None: not given), and those of single columns; a later one overrides."""
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
