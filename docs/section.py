"""Measured tables of the documentation, between two marks on a page."""

from pathlib import Path

from auvid_cli.data.files import write_text

_DOCS = Path(__file__).parent


def replace_section(name: str, text: str, page: str = "performance") -> None:
    """Replace the text between the marks of a section of a page."""
    path = _DOCS / f"{page}.md"
    begin, end = f"<!-- {name}: measured -->\n", f"<!-- {name}: end -->"
    before, found, rest = path.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise SystemExit(f"{path}: has no section {name!r}")
    write_text(path, f"{before}{begin}\n{text.strip()}\n\n{end}{after}")
