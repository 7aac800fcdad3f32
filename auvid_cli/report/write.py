"""The whole report of a run as files."""

from collections.abc import Callable
from pathlib import Path

from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.files import write_text
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.csv_tables import write_csv_tables
from auvid_cli.report.figures import draw_figures
from auvid_cli.report.latex import render_latex
from auvid_cli.report.layout import lay_out
from auvid_cli.report.markdown import render_markdown


def write_report(
    dataset: Dataset,
    estimates: list[Estimate],
    evaluation: Evaluation,
    folder: Path,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Path]:
    """Write tables and figures.

    Parameters
    ----------
    dataset : Dataset
    estimates : list of Estimate
    evaluation : Evaluation
        Of these estimates.
    folder : pathlib.Path
        Gets the folders ``tables`` and ``figures``.
    progress : callable
        Told how many figures are done, and of how many.

    Returns
    -------
    list of pathlib.Path
        All files written.

    Raises
    ------
    FileError
        If one cannot be written; it is then not there, or as it was before.
    """
    return [
        *write_tables(evaluation, folder / "tables"),
        *draw_figures(dataset, estimates, evaluation, folder / "figures", progress),
    ]


def write_tables(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write the CSV, Markdown and LaTeX tables; see `write_report`."""
    paths = write_csv_tables(evaluation, folder)
    markdown, latex = folder / "tables.md", folder / "tables.tex"
    write_text(markdown, render_markdown(lay_out(evaluation, with_paper=True)))
    write_text(latex, render_latex(lay_out(evaluation, with_paper=False)))
    return [*paths, markdown, latex]
