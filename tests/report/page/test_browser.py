"""Pages in a real browser: Debian's Chromium, or one that CHROMIUM names."""

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe

from auvid_cli.report.page.parts import Page, Plot, PlotLine, Plots, Section
from auvid_cli.report.page.render import render_page, write_page

from .test_render import page_of

pytestmark = pytest.mark.browser
NARROW, WIDE = {"width": 400, "height": 900}, {"width": 1280, "height": 900}


@pytest.fixture(scope="module")
def complaints():
    """What consoles say, and what is asked of anybody but the file itself; nothing, when all is done."""
    complaints: list[str] = []
    yield complaints
    assert complaints == []


@pytest.fixture(scope="module")
def opened(browser, complaints, tmp_path_factory):
    """Function: open a page offline, and draw all of it."""

    def show(page, viewport=WIDE, scheme="light"):
        path = write_page(page, tmp_path_factory.mktemp("page") / "page.html")
        tab = browser.new_page(viewport=viewport, color_scheme=scheme, offline=True)
        tab.on("console", lambda message: complaints.append(message.text))
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.on("request", lambda request: request.url == path.as_uri() or complaints.append(request.url))
        tab.goto(path.as_uri())
        tab.evaluate("dispatchEvent(new Event('beforeprint')); dispatchEvent(new Event('afterprint'))")
        assert tab.evaluate("auvid.drawn.length") == tab.locator(".canvas").count() > 0
        return tab

    return show


@pytest.fixture(scope="module")
def tab(opened, page):
    """The page of a run, of which each test looks at another place."""
    return opened(page)


def ranges(tab, link):
    shown = "({ chart }) => [chart.scales.x.min, chart.scales.x.max]"
    return tab.evaluate(f"link => auvid.drawn.filter(one => one.link === link).map({shown})", link)


def inked(tab, selector):
    """Count the points of a canvas that are not empty."""
    return tab.evaluate(
        """selector => {
          const canvas = document.querySelector(selector);
          const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
          return data.filter((value, k) => k % 4 === 3 && value > 0).length;
        }""",
        selector,
    )


@pytest.mark.slow
@pytest.mark.parametrize("viewport", [NARROW, WIDE], ids=["narrow", "wide"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_is_drawn_and_fits_its_window(page, opened, viewport, scheme):
    tab = opened(page, viewport, scheme)
    assert tab.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    assert tab.locator(".uplot canvas").count() == tab.locator(".canvas").count() > 30
    for selector in (".uplot canvas", "canvas[data-space]"):
        assert inked(tab, selector) > 500
    paper, ink = tab.evaluate(
        "[getComputedStyle(document.body).backgroundColor, getComputedStyle(document.body).color]"
    )
    darker = min(paper, ink, key=lambda colour: sum(map(int, colour.strip("rgb()").split(","))))
    assert darker == (paper if scheme == "dark" else ink)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_whoever_hears_the_page_or_sees_little_can_use_it(page, opened, scheme):
    broken = Axe().run(opened(page, scheme=scheme)).response["violations"]
    assert [(rule["id"], rule["nodes"][0]["html"]) for rule in broken] == []


@pytest.mark.slow
def test_paper_has_room_for_all_of_it(page, opened):
    tab = opened(page, scheme="dark")
    # What Letter leaves between its margins, CSS pixels.
    tab.set_viewport_size({"width": 702, "height": 900})
    tab.emulate_media(media="print")
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert tab.evaluate("document.documentElement.scrollWidth") <= 702
    outside = """[...document.querySelectorAll('canvas, svg, table')]
        .filter(one => one.getBoundingClientRect().right > document.body.getBoundingClientRect().right + 1)
        .map(one => one.outerHTML.slice(0, 80))"""
    assert tab.evaluate(outside) == []
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    # What line is what, and whose innovations these are.
    assert tab.locator("#convergence .entry").first.is_visible()
    assert tab.locator("#innovations select").is_visible()
    tab.evaluate("dispatchEvent(new Event('afterprint'))")


@pytest.mark.slow
def test_a_zoom_is_one_of_all_over_the_same_time(tab):
    whole = ranges(tab, "time")
    assert len(whole) > 20
    assert {tuple(span) for span in whole} == {(0.0, 80.0)}
    plot = tab.locator("#course .canvas").first
    plot.scroll_into_view_if_needed()
    box = plot.locator(".u-over").bounding_box()
    tab.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 20)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 20, steps=3)
    tab.mouse.up()
    for low, high in ranges(tab, "time"):
        assert (low, high) == pytest.approx((20.0, 40.0), abs=0.5)
    # What is not over time stays as it is.
    others = tab.evaluate("auvid.drawn.filter(one => one.plot.x !== 'time (s)').map(one => one.chart.scales.x.max)")
    assert set(others) == {20}
    plot.focus()
    tab.keyboard.press("ArrowRight")
    assert ranges(tab, "time")[0] == pytest.approx([24.0, 44.0], abs=0.6)
    tab.keyboard.press("0")
    assert {tuple(span) for span in ranges(tab, "time")} == {(0.0, 80.0)}


@pytest.mark.slow
def test_a_table_is_sorted_and_filtered_by_the_keyboard(tab):
    table = tab.locator("#coefficients table")
    heading = table.locator("th[aria-sort]", has_text="Bound").first
    heading.locator("button").focus()
    tab.keyboard.press("Enter")
    assert heading.get_attribute("aria-sort") == "ascending"
    column = heading.evaluate("heading => heading.cellIndex")

    def bounds():
        return table.locator("tbody tr").evaluate_all(
            "(rows, column) => rows.filter(row => !row.hidden).map(row => row.cells[column].textContent)", column
        )

    # What is not known comes last, both ways.
    assert bounds()[-3:] == ["—"] * 3
    tab.keyboard.press("Enter")
    assert heading.get_attribute("aria-sort") == "descending"
    assert bounds()[-3:] == ["—"] * 3
    assert table.locator("th[aria-sort=none]").count() == table.locator("thead th").count() - 1
    tab.locator("#coefficients input").fill("ckf y_uudr")
    assert len(bounds()) == 1
    assert tab.locator("#coefficients [role=status]").inner_text() == "1 of 12"
    tab.locator("#coefficients input").fill("")
    assert len(bounds()) == 12


@pytest.mark.slow
def test_numbers_are_sorted_as_numbers(tab):
    table = tab.locator("#coefficients table")
    heading = table.locator("th[aria-sort]", has_text="True").first
    heading.locator("button").click()
    column = heading.evaluate("heading => heading.cellIndex")
    texts = table.locator("tbody tr").evaluate_all("(rows, k) => rows.map(row => row.cells[k].textContent)", column)
    values = [float(text) for text in texts]
    assert values == sorted(values)
    assert len(set(values)) == 4


def test_the_choice_of_an_estimator_shows_its_innovations(tab):
    shown = """auvid.drawn.filter(one => one.key.startsWith('innovations')).flatMap(({ chart, plot }) =>
      plot.lines.filter((line, k) => line.of && chart.series[k + 1].show).map(line => line.of))"""
    assert set(tab.evaluate(shown)) == {"ekf"}
    tab.locator("#innovations select").select_option("tukf")
    assert set(tab.evaluate(shown)) == {"tukf"}


def test_the_lines_of_an_autocorrelation_are_named_below_it(tab):
    plot = tab.locator("#innovations figure", has_text="dvl: autocorrelation")
    assert plot.locator(".own").inner_text().split() == ["u", "v", "w"]
    looks = plot.locator(".own svg").evaluate_all("pieces => pieces.map(piece => getComputedStyle(piece).stroke)")
    assert len(set(looks)) == 3


@pytest.mark.slow
def test_of_many_lines_the_one_nearest_to_the_pointer_is_read_out(opened, page):
    time = np.arange(20.0)
    lines = [PlotLine(f"line {k}", "input", time, np.full(20, float(k))) for k in range(12)]
    tab = opened(Page("Many", "", [Section("many", "Many", [Plots([Plot("many", "Lines.", "m", lines)], wide=True)])]))
    over = tab.locator(".u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    scale = tab.evaluate("auvid.drawn[0].chart.valToPos(7, 'y')")
    tab.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + scale + 1)
    assert tab.locator(".readout").inner_text().endswith(": line 7 7")


@pytest.mark.slow
def test_what_a_matrix_says_is_not_cut_off_on_a_phone(opened, page):
    tab = opened(page, NARROW)
    note = tab.locator(".matrix .note").bounding_box()
    assert note["x"] + note["width"] <= NARROW["width"]


@pytest.mark.slow
def test_a_line_is_taken_away_by_its_legend(tab):
    button = tab.locator("#convergence button.entry", has_text="EKF").first
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    group = "auvid.drawn.filter(one => one.key === auvid.drawn.find(one => one.key.startsWith('convergence')).key)"
    shown = f"{group}.map(one => one.chart.series.find(line => line.label === 'EKF').show)"
    assert set(tab.evaluate(shown)) == {False}


@pytest.mark.slow
def test_the_path_is_turned_by_pointer_and_keys(tab):
    canvas = tab.locator("canvas[data-space]")
    canvas.scroll_into_view_if_needed()
    picture = "canvas => canvas.toDataURL()"
    first = canvas.evaluate(picture)
    canvas.focus()
    tab.keyboard.press("ArrowLeft")
    turned = canvas.evaluate(picture)
    assert turned != first
    tab.keyboard.press("0")
    assert canvas.evaluate(picture) == first
    box = canvas.bounding_box()
    tab.mouse.move(box["x"] + 100, box["y"] + 100)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 160, box["y"] + 130)
    tab.mouse.up()
    assert canvas.evaluate(picture) != first


@pytest.mark.slow
@pytest.mark.parametrize("text", ["<script>document.title = 'owned'</script>", "</script><img src=x onerror=alert(1)>"])
def test_hostile_names_stay_text(opened, text):
    tab = opened(page_of(text))
    assert tab.locator("h1").inner_text() == text
    assert tab.title() == f"{text} - auvid"
    assert tab.locator("script, img").count() == render_page(page_of("plain")).count("<script")
    assert tab.locator("#all-6-0-title").inner_text().startswith(text)


@pytest.mark.slow
def test_a_page_is_printed_whole(tab):
    assert tab.pdf().count(b"/Type /Page\n") > 3
