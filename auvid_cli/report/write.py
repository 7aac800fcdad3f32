"""The tables of a run as files."""

from pathlib import Path

from auvid_cli.data.files import write_text
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.csv_tables import write_csv_tables
from auvid_cli.report.latex import render_latex
from auvid_cli.report.layout import lay_out, table_iv
from auvid_cli.report.markdown import render_markdown


def write_tables(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write the CSV, Markdown and LaTeX tables.

    Raises
    ------
    FileError
        If one cannot be written; it is then not there, or as it was before.
    """
    paths = write_csv_tables(evaluation.tables() | table_iv(evaluation), folder)
    markdown, latex = folder / "tables.md", folder / "tables.tex"
    write_text(markdown, render_markdown(lay_out(evaluation)))
    write_text(latex, render_latex(lay_out(evaluation)))
    return [*paths, markdown, latex]
