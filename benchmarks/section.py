"""Where measured tables stand: between two marks in the documentation."""

from pathlib import Path

from auvid_cli.data.files import write_text

PERFORMANCE = Path(__file__).parents[1] / "docs" / "performance.md"


def replace_section(name: str, text: str) -> None:
    """Put text between the marks of a section, in place of what is there."""
    begin, end = f"<!-- {name}: measured -->\n", f"<!-- {name}: end -->"
    before, found, rest = PERFORMANCE.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise SystemExit(f"{PERFORMANCE}: has no section {name!r}")
    write_text(PERFORMANCE, f"{before}{begin}\n{text.strip()}\n\n{end}{after}")
