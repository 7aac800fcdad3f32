"""Where measured tables stand: between two marks in the documentation."""

from pathlib import Path

from auvid_cli.data.files import write_text

_DOCS = Path(__file__).parent


def replace_section(name: str, text: str, page: str = "performance") -> None:
    """Put text between the marks of a section of a page, in place of what is there."""
    path = _DOCS / f"{page}.md"
    begin, end = f"<!-- {name}: measured -->\n", f"<!-- {name}: end -->"
    before, found, rest = path.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise SystemExit(f"{path}: has no section {name!r}")
    write_text(path, f"{before}{begin}\n{text.strip()}\n\n{end}{after}")
