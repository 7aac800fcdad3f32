"""The screen samples of the pages, against what the commands print about a short run."""

import re
import shlex
from itertools import pairwise
from pathlib import Path

import pytest
from typer.testing import CliRunner

from auvid_cli.cli.app import app
from docs.make_screens import SCREENS, Screen, sample

DOCS = Path(__file__).parents[1] / "docs"
SAMPLE = re.compile(r"<!-- ([^>]*): measured -->\n\n```text\n(.*?)\n```\n\n<!-- \1: end -->", re.DOTALL)
# Pages with fences that are no screens: pseudo-code and parts of settings.
OTHERS = {"theory.md", "survey-logs.md"}
SHORTER = {
    " --use 65:110": "",
    r"^run\b(?!.*duration)": "run --set 'manoeuvre.duration=15 s'",
    "duration=(60|100) s": "duration=30 s",
    "--use [0-9:]+": "--use 0:20",
}
# They take long, or need files that this test does not make.
SKIPPED = ("fit", "terms", "validate", "compare", "import", "cat")


def shown(screen: Screen) -> str:
    """Return a sample as its page shows it."""
    return dict(SAMPLE.findall((DOCS / f"{screen.page}.md").read_text(encoding="utf-8")))[screen.name]


def headings(text: str) -> list[list[str]]:
    """Return the words of each column heading, which a rule follows."""
    lines = text.splitlines()
    return [above.split() for above, rule in pairwise(lines) if set(rule.strip()) == {"─"}]


def test_each_screen_of_the_pages_is_made_by_a_command():
    made = {(screen.page, screen.name) for screen in SCREENS}
    for page in DOCS.rglob("*.md"):
        if page.name not in OTHERS:
            text = page.read_text(encoding="utf-8")
            names = [name for name, _ in SAMPLE.findall(text)]
            assert text.count("```text\n") == len(names), f"{page.name}: a screen outside of a section"
            assert {(page.relative_to(DOCS).with_suffix("").as_posix(), name) for name in names} <= made
    assert all(shown(screen) for screen in SCREENS)


@pytest.mark.slow
def test_rows_and_headings_of_the_screens_are_printed(tmp_path, monkeypatch, without_figures, walked_here):
    monkeypatch.chdir(tmp_path)
    printed: dict[str, str] = {}
    for screen in SCREENS:
        command = screen.command
        if command.split()[0] in SKIPPED:
            continue
        for long, short in SHORTER.items():
            command = re.sub(long, short, command)
        if command not in printed:
            result = CliRunner().invoke(app, shlex.split(command))
            assert result.exit_code in (0, 1), f"{command}:\n{result.output}"
            printed[command] = result.output
        assert headings(sample(printed[command], screen.kept)) == headings(shown(screen)), screen
