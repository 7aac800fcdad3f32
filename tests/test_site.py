"""The site of the documentation: built as CONTRIBUTING says, warnings as errors; without any network."""

import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
import yaml

from docs.site_markdown import SuperFencesException, mathml

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
# What a browser fetches by itself; links that a person follows are others.
FETCHED = {"audio", "embed", "iframe", "img", "link", "object", "script", "source", "track", "video"}


def build(docs: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "zensical", "build", "--strict", "--config-file", str(docs / "mkdocs.yml")]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The built site."""
    docs = shutil.copytree(
        DOCS, tmp_path_factory.mktemp("site") / "docs", ignore=shutil.ignore_patterns("*.py", "site", ".cache")
    )
    result = build(docs)
    assert result.returncode == 0, result.stdout + result.stderr
    return docs / "site"


def pages() -> set[str]:
    """Pages that are written, by their path."""
    return {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")}


class Fetched(HTMLParser):
    """Addresses that a browser asks for when it shows a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag in FETCHED:
            self.addresses += [value for name, value in attrs if name in {"src", "href", "data", "srcset"} and value]


@pytest.mark.slow
def test_every_page_is_in_the_contents_and_on_the_site(site):
    named = set(re.findall(r"(?m)^ +- .*: (\S+\.md)$", (DOCS / "mkdocs.yml").read_text(encoding="utf-8")))
    assert named == pages()
    assert {path.relative_to(site).with_suffix(".md").as_posix() for path in site.rglob("*.html")} == {*named, "404.md"}


@pytest.mark.slow
def test_a_page_asks_no_network_for_anything(site):
    for page in site.rglob("*.html"):
        for address in Fetched(page.read_text(encoding="utf-8")).addresses:
            assert not re.match(r"(\w+:)?//", address), f"{page.name} asks for {address}"
            if page.name != "404.html":
                assert (page.parent / address.partition("#")[0]).exists(), f"{page.name} asks for {address}"
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*['\"]?(\w+:)?//", sheet.read_text(encoding="utf-8")), sheet.name


@pytest.mark.slow
def test_equations_are_drawn_by_the_browser_alone(site):
    theory = (DOCS / "theory.md").read_text(encoding="utf-8")
    drawn = (site / "theory.html").read_text(encoding="utf-8")
    assert drawn.count("<math") == theory.count("```math") + theory.count("$`") > 12
    assert "```" not in drawn


@pytest.mark.slow
def test_bars_in_the_code_of_a_table_have_no_backslash(site):
    text = re.sub("<pre>.*?</pre>", "", (site / "theory.html").read_text(encoding="utf-8"), flags=re.DOTALL)
    assert "<code>Y_v|v|</code>" in text
    assert "\\|" not in text


def test_search_finds_pages_by_their_words(site):
    items = json.loads((site / "search.json").read_text(encoding="utf-8"))["items"]
    assert {"how-to/tune-noise.html", "glossary.html"} <= {
        item["location"].partition("#")[0] for item in items if "process noise" in item["text"].lower()
    }


@pytest.mark.slow
@pytest.mark.browser
def test_a_reader_without_a_network_searches_and_finds(site, browser):
    complaints = []
    tab = browser.new_page(viewport={"width": 400, "height": 900}, offline=True)
    tab.on("console", lambda message: complaints.append(message.text))
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.on(
        "request",
        lambda request: request.url.startswith(("file:", "data:", "blob:")) or complaints.append(request.url),
    )
    tab.goto((site / "theory.html").as_uri())
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth")
    font = "document.fonts.load('1em \"Noto Sans Math\"').then(found => found.length)"
    assert tab.evaluate(font) == 1
    tab.keyboard.press("Control+k")
    tab.keyboard.type("normalised innovation squared")
    tab.get_by_text(re.compile(r"^[1-9]\d* results?$")).wait_for(timeout=10_000)
    tab.close()
    assert complaints == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "ends"),
    [("[here](index.md)", 0), ("[gone](gone.md)", 1), ("[gone](index.md#gone)", 1), ("$`\\frac{a}`$", 1)],
)
def test_what_is_wrong_on_a_page_ends_the_build(tmp_path, text, ends):
    settings = yaml.safe_load(
        re.sub(r"!!python/name:\S+|(?s:\nnav:.*)", "", (DOCS / "mkdocs.yml").read_text(encoding="utf-8"))
    )
    settings["markdown_extensions"] = ["docs.site_markdown"]
    (tmp_path / "mkdocs.yml").write_text(yaml.safe_dump(settings), encoding="utf-8")
    (tmp_path / "index.md").write_text(f"# Page\n\n{text}\n", encoding="utf-8")
    assert build(tmp_path).returncode == ends


@pytest.mark.slow
def test_an_equation_that_cannot_be_read_is_named():
    with pytest.raises(SuperFencesException, match=r"\\nowhere x"):
        mathml("\\nowhere x", block=True)
