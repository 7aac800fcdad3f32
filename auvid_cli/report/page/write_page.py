"""A page as a file."""

from pathlib import Path

from auvid_cli.data.files import write_text
from auvid_cli.data.replacement import refuse_other_page
from auvid_cli.report.page.parts import Page
from auvid_cli.report.page.render import render_page


def write_page(page: Page, path: Path) -> Path:
    """Write a page, whole or not at all, and return its path.

    Raises
    ------
    FileError
        If it cannot be written, or another file than a page of auvid's has its name.
    """
    refuse_other_page(path)
    write_text(path, render_page(page))
    return path
