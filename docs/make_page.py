"""Take pictures of the pages of results, light and dark, with Chromium: `python -m docs.make_page`.

Takes half a minute of processor time. `--slow` also fits the log of the tutorial, which takes three minutes more.
"""

import argparse
import os
import shutil
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, NamedTuple

from PIL import Image, ImageOps
from playwright.sync_api import Browser, Page, sync_playwright

from docs.make_figures import IMAGES, run_all, save

_SCHEMES: dict[Literal["light", "dark"], str] = {"light": "", "dark": "-dark"}  # end of the name of a picture
_WIDTH, _MARGIN = 1120, 12  # px


def _run(tab: Page) -> None:
    """Leave a part of each kind, so that every kind fits."""
    hidden = "#coefficients figure, #coefficients h3, #convergence .plot:nth-child(n + 4)"
    tab.add_style_tag(content=f"{hidden} {{ display: none; }}")
    # Coefficients of the fins. A word is searched in all columns, so "y_" would also find causes of uncertainty.
    tab.locator("#coefficients input").fill("ckf uu")
    tab.get_by_role("button", name="Error / sd").click()
    tab.locator("#convergence").scroll_into_view_if_needed()
    tab.wait_for_function("document.querySelectorAll('#convergence canvas').length >= 3")


class _Picture(NamedTuple):
    """Picture of a page from its top to the end of a section."""

    name: str  # without suffix
    commands: tuple[str, ...]
    page: str
    last: str  # selector of the last part that is shown
    prepare: Callable[[Page], None] = lambda tab: None
    is_slow: bool = False


_FIT = (
    "simulate field --as-log -o field",
    "import --map field/map.yaml",
    "fit results/survey/dataset.h5 --use 0:320",
)
_PICTURES = (
    _Picture("page", ("run",), "results/spiral/report.html", "#convergence", _run),
    _Picture("fit", _FIT, "results/survey/fit.html", "#steps", is_slow=True),
)


def main() -> None:
    """Write a picture of each page for each colour scheme."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--slow", action="store_true", help="also the page that takes minutes")
    options = parser.parse_args()
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        # The sandbox of Chromium refuses to run as root, as in containers. The pages are auvid's own.
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for picture in _PICTURES:
            if options.slow or not picture.is_slow:
                run_all(picture.commands, Path(folder))
                _take(browser, picture, Path(folder))
        browser.close()


def _take(browser: Browser, picture: _Picture, folder: Path) -> None:
    """Open a page of a folder, and write its pictures."""
    for scheme, suffix in _SCHEMES.items():
        tab = browser.new_page(viewport={"width": _WIDTH, "height": 900}, bypass_csp=True, color_scheme=scheme)
        tab.goto((folder / picture.page).absolute().as_uri())
        picture.prepare(tab)
        box = tab.locator(picture.last).bounding_box()
        assert box is not None
        bottom = box["y"] + box["height"] + tab.evaluate("scrollY") + _MARGIN
        shot = tab.screenshot(full_page=True, clip={"x": 0, "y": 0, "width": _WIDTH, "height": bottom})
        with Image.open(BytesIO(shot)) as image:
            # A frame separates it from the page that shows it.
            save(ImageOps.expand(image, 1, "#808080"), IMAGES / f"{picture.name}{suffix}.png")
        tab.close()


if __name__ == "__main__":
    main()
