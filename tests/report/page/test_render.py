"""A page is one file that needs no other, and what it is handed stays text."""

import base64
import json
import re
import struct
from hashlib import sha256
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from auvid_cli.config.enums import FilterName
from auvid_cli.errors import FileError
from auvid_cli.report.figures.style import FILTER_STYLES
from auvid_cli.report.lines import FILTER_LINES
from auvid_cli.report.page.looks import filter_styles
from auvid_cli.report.page.parts import (
    Card,
    Cards,
    Dot,
    Listing,
    Matrix,
    Page,
    PathTrack,
    Picture,
    Plot,
    PlotLine,
    Plots,
    Section,
    Space,
    TablePart,
    TextLabel,
    Words,
)
from auvid_cli.report.page.render import _asset, render_page, with_code, write_page
from auvid_cli.report.table import Column, Table
from auvid_cli.text import one_line

_VOID = {"meta", "input", "rect", "circle", "path", "line", "polyline"}
hostile = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=30) | st.lists(
    st.sampled_from(
        ["<script>", "</script>", "<!--", "-->", "]]>", '"', "'", "&", "{{", "{%", "\\u003c", "\u2028", "x"]
    ),
    min_size=1,
    max_size=6,
).map("".join)


class Elements(HTMLParser):
    """Elements of a page, in order, each with its attributes and its text; refuses what is not closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None], list[str]]] = []
        self._open: list[tuple[str, dict[str, str | None], list[str]]] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        element = (tag, dict(attrs), [])
        self.found.append(element)
        if tag not in _VOID:
            self._open.append(element)

    def handle_startendtag(self, tag, attrs):
        self.found.append((tag, dict(attrs), []))

    def handle_endtag(self, tag):
        assert self._open.pop()[0] == tag

    def handle_data(self, data):
        for _, _, texts in self._open:
            texts.append(data)

    def texts(self, tag: str) -> list[str]:
        return ["".join(texts) for name, _, texts in self.found if name == tag]

    def attributes(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes, _ in self.found if name == tag]


def page_of(text: str) -> Page:
    time = np.arange(3.0)
    table = Table("key", text, (Column(text, numeric=False),), [[text]], notes=(text,))
    parts = [
        Words([text]),
        Cards([Card(text, "ekf", "sound", text, {text: text})]),
        TablePart(table, sortable=True),
        Matrix(text, ["X_u|u|"], np.eye(1)),
        Listing(text, text),
        Picture(
            text, text, 10.0, 10.0, [TextLabel(0.0, 0.0, text, below=text), Dot(0.0, 0.0, "ekf", text)], [("ekf", text)]
        ),
        Plots([Plot(text, text, text, [PlotLine(text, "ekf", time, time)], x_label=text)], choice={"ekf": text}),
        Space(text, [PathTrack(text, "ekf", np.zeros((2, 3)))]),
    ]
    return Page(text, text, [Section("all", "All", parts)])


def test_a_page_is_closed_in_order_and_has_its_headings(page):
    elements = Elements(render_page(page))
    assert elements.texts("h1") == ["spiral"]
    assert elements.texts("h2") == [
        *("Verdict", "Coefficients", "Convergence", "Coefficients that cannot be separated", "Innovations"),
        *("Inputs, sensors, residuals", "Path", "Tables", "Checks", "Settings, hashes, versions"),
    ]
    keys = {attributes["id"] for _, attributes, _ in elements.found if "id" in attributes}
    for attributes in elements.attributes("a"):
        assert attributes["href"].removeprefix("#") in keys
    for _, attributes, _ in elements.found:
        for name in ("aria-labelledby", "for"):
            assert attributes.get(name) is None or attributes[name] in keys


def test_every_picture_has_words_and_every_heading_of_a_table_a_scope(page):
    elements = Elements(render_page(page))
    pictures = [attributes for _, attributes, _ in elements.found if attributes.get("role") == "img"]
    assert len(pictures) > 40
    assert all(attributes["aria-label"] for attributes in pictures)
    assert all("scope" in attributes for attributes in elements.attributes("th"))
    assert all(
        attributes["tabindex"] == "0" for name, attributes, _ in elements.found if attributes.get("class") == "canvas"
    )


def test_a_page_asks_no_network_and_runs_nothing_but_what_it_brings(page):
    elements = Elements(render_page(page))
    for tag in ("link", "img", "iframe", "object", "embed", "form", "base"):
        assert elements.texts(tag) == []
    for _, attributes, _ in elements.found:
        assert not {"src", "style", "srcset", "action", "data"} & {*attributes}
        assert not any(name.startswith("on") for name in attributes)
        assert (attributes.get("href") or "#").startswith("#")
    (policy,) = [a["content"] for a in elements.attributes("meta") if a.get("http-equiv") == "Content-Security-Policy"]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    scripts = [text for tag, a, text in elements.found if tag == "script" and "type" not in a]
    for name, texts in (("script-src", ["".join(text) for text in scripts]), ("style-src", elements.texts("style"))):
        hashes = [f"'sha256-{base64.b64encode(sha256(text.encode()).digest()).decode()}'" for text in texts]
        assert rules[name].split() == hashes


@settings(max_examples=15)
@given(hostile)
@example("<script>alert(1)</script>")
@example("</title><img src=x onerror=alert(1)>")
@example("{{ 7 * 7 }}{% raw %}")
@example("X_u|u|</script>")
def test_hostile_text_stays_text(text):
    elements = Elements(render_page(page_of(text)))
    plain = Elements(render_page(page_of("plain")))
    tags, expected = ([tag for tag, _, _ in page.found if tag != "sub"] for page in (elements, plain))
    assert tags == expected
    assert elements.texts("h1") == [one_line(text)]
    (data,) = [json.loads("".join(t)) for tag, a, t in elements.found if tag == "script" and a.get("id") == "data"]
    assert set(data) == {"groups", "spaces", "arrays"}


def test_numbers_of_a_plot_are_those_of_its_lines():
    time = 1e6 + np.array([0.25, 0.5, 0.75])
    values = np.array([1.5, np.nan, -2.0])
    page = Page("t", "s", [Section("k", "K", [Plots([Plot("p", "says", "m", [PlotLine("l", "ekf", time, values)])])])])
    (text,) = [
        "".join(t)
        for tag, a, t in Elements(render_page(page)).found
        if tag == "script" and a.get("type") == "application/json"
    ]
    data = json.loads(text)
    line = data["groups"]["k-0"]["plots"][0]["lines"][0]
    read = [struct.unpack("<3f", base64.b64decode(data["arrays"][line[name]])) for name in ("t", "v")]
    np.testing.assert_array_equal(np.array(read[0]) + line["from"], time)
    np.testing.assert_array_equal(read[1], values)


def test_what_a_page_does_not_know_is_left_out():
    page = Page("t", "s", [Section("empty", "Empty", []), Section("full", "Full", [Words(["Something."])])])
    assert Elements(render_page(page)).texts("h2") == ["Full"]


def test_a_page_is_written_over_and_another_file_is_not(tmp_path):
    path = tmp_path / "report.html"
    write_page(page_of("first"), path)
    assert "second" in write_page(page_of("second"), path).read_text(encoding="utf-8")
    path.write_text("<h1>My own report</h1>")
    with pytest.raises(FileError, match="not a page of auvid's"):
        write_page(page_of("third"), path)
    assert path.read_text() == "<h1>My own report</h1>"


def test_the_licence_of_what_is_brought_along_is_on_the_page(page):
    text = re.sub(r"\s+", " ", render_page(page))
    assert "Copyright (c) 2022 Leon Sorokin" in text
    assert "Permission is hereby granted, free of charge" in text


@pytest.mark.parametrize("name", [name.value for name in FilterName])
def test_every_filter_has_one_line_in_figures_and_on_pages(name):
    line, sheet = FILTER_STYLES[name], filter_styles()
    assert re.findall(rf"--{name}: (#\w+)", sheet) == [line.color, FILTER_LINES[name].color_on_dark]
    assert f".{name} {{ color: var(--{name}); }}" in sheet
    drawn = re.search(rf"polyline\.{name} {{ stroke-width: (.*?); stroke-dasharray: (.*?); }}", sheet)
    assert drawn is not None
    assert float(drawn[1]) == line.linewidth
    dash = [] if drawn[2] == "none" else [float(length) / line.linewidth for length in drawn[2].split()]
    assert dash == pytest.approx([] if line.linestyle == "-" else line.linestyle[1])
    assert _asset("page.css").count(f"--{name}") == 0


def test_what_stands_between_backticks_is_code_and_stays_text():
    words = "Set `a.b=<i>` of X_u|u|, or `none; a lone ` is text."
    elements = Elements(render_page(Page("t", "s", [Section("k", "K", [Words([words])])])))
    assert elements.texts("code") == ["a.b=<i>", "none; a lone "]
    assert elements.texts("i") == []
    assert with_code("a lone ` of it") == [("a lone ` of it", False)]


def test_a_long_table_is_scrolled_within_so_that_what_follows_is_near():
    def region(rows):
        table = Table("key", "Title", (Column("a"),), [[1.0]] * rows)
        elements = Elements(render_page(Page("t", "s", [Section("k", "K", [TablePart(table)])])))
        return next(one["class"] for one in elements.attributes("div") if one.get("role") == "region")

    assert (region(24), region(25)) == ("scroll", "scroll tall")
