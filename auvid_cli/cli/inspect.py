"""auvid inspect."""

from typing import TYPE_CHECKING, Annotated

import typer

from auvid_cli.cli.exit_codes import DONE, VERDICT_FAILED
from auvid_cli.cli.options import (
    DatasetArgument,
    FigureFormatOption,
    OpenOption,
    OutputOption,
    OverwriteOption,
    QuietOption,
    VerboseVerdictsOption,
    overrides,
    refuse_log,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors
from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from auvid_cli.data.dataset import Dataset


def inspect(
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
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    figure_format: FigureFormatOption = None,
    show: OpenOption = False,
    quiet: QuietOption = False,
    verbose: VerboseVerdictsOption = False,
) -> None:
    """Judge recorded data before anybody identifies from them: signs, units, axes, clocks, gaps, spikes, excitation.

    Prints what did not pass, each with what to do about it: FAIL is to be mended first (exit code 1), note is worth
    knowing. The results folder gets all verdicts (tables/inspection.csv), what was recorded when (figures/timeline),
    and both on a page (inspection.html).
    """
    with reporting_errors() as command:
        from auvid_cli.api import inspection as api
        from auvid_cli.api.files import read_dataset
        from auvid_cli.cli.browser import open_page
        from auvid_cli.cli.tables import write_and_draw
        from auvid_cli.data.files import keep_apart
        from auvid_cli.data.replacement import put_copy, refuse_other_page
        from auvid_cli.data.results_folder import folder_of_dataset, locked, tables_and_figures
        from auvid_cli.data.time_window import within
        from auvid_cli.report.page.inspection_page import inspection_page
        from auvid_cli.report.screen import print_checks

        terminal = Terminal(quiet, verbose)
        refuse_log(dataset)
        folder = output or folder_of_dataset(dataset)
        with terminal.stage("read the dataset"):
            read = read_dataset(dataset, *overrides(None, use=use))
        if use:
            if len(use) > 1:
                raise ConfigError(f"--use: one part is inspected at a time, and there are {len(use)}")
            read = within(read, *read.experiment.identification.use.spans[0])
        files = [dataset, *read.experiment.data_files()]
        page = folder / "inspection.html"
        command.enter_context(locked(folder))
        refuse_other_page(page)
        put_copy(dataset, read, folder, files, overwrite)
        keep_apart(tables_and_figures(folder), files)
        with terminal.stage("inspect"):
            inspection = api.inspect(read)
        tables = {"inspection": inspection.rows()}
        laid_out = page, lambda: inspection_page(read, inspection)
        paths = write_and_draw(
            folder, tables, lambda figures: figures.add_timeline(read, inspection), laid_out, terminal, figure_format
        )
        print_checks(terminal.out, inspection.checks, passed=verbose)
        terminal.say_all(paths)
        part = "".join(f" --use {span}" for span in use or ())
        fails = len(inspection.checks.failed())
        if fails:
            verdicts = "1 verdict fails" if fails == 1 else f"{fails} verdicts fail"
            terminal.tell(
                f"{verdicts}. Next: mend the map and import again with --overwrite, or leave out bad times with "
                "--use BEGIN:END; then `auvid inspect` again"
            )
        else:
            terminal.tell(f"nothing fails. Next: {_next(read, f'{dataset}{part}')}")
        if show:
            open_page(page, terminal)
        raise typer.Exit(VERDICT_FAILED if fails else DONE)


def _next(dataset: "Dataset", named: str) -> str:
    """Name the commands that work with what is known of the vehicle."""
    settings = dataset.experiment.identification
    known = dataset.known_coefficients()
    stated = dataset.experiment.vehicle.stated_coefficients()
    if unheld := [symbol for symbol in settings.held(dataset.experiment.vehicle) if symbol not in stated]:
        return (
            f"state values of {', '.join(unheld)} in the vehicle file, or estimate them (identification.coefficients "
            "leaves them out)"
        )
    if all(symbol in known for symbol in settings.estimated(dataset.experiment.vehicle)):
        return f"`auvid identifiability {named}`, then `auvid identify` alike"
    filters = settings.with_judge(settings.by_default())
    return (
        f"`auvid identify {named}`, then `auvid identifiability {named} --at` with its estimate "
        f"estimates/{filters[0].value}.h5, for the vehicle file does not state every coefficient"
    )
