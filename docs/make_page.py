"""Take pictures of parts of a page, light and dark, after `auvid run`: `python -m docs.make_page`, with Chromium."""

import argparse
import os
import shutil
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, sync_playwright

_IMAGES = Path(__file__).with_name("images")
_TARGETS: dict[Literal["light", "dark"], str] = {"light": "page.png", "dark": "page-dark.png"}
_WIDTH, _MARGIN = 1120, 12
# Parts left out of the picture, so that every kind of part fits.
_LEFT_OUT = "#coefficients figure, #coefficients h3, #convergence .plot:nth-child(n + 4)"


def main() -> None:
    """Write a picture for each colour scheme."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, default=Path("results/spiral/report.html"))
    options = parser.parse_args()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=os.environ.get("CHROMIUM") or shutil.which("chromium"))
        for scheme in _TARGETS:
            _take(browser, options.page, scheme)
        browser.close()


def _take(browser: Browser, page: Path, scheme: Literal["light", "dark"]) -> None:
    """Open the page, narrow its list down, and write the picture."""
    tab = browser.new_page(viewport={"width": _WIDTH, "height": 900}, bypass_csp=True, color_scheme=scheme)
    tab.goto(page.absolute().as_uri())
    tab.add_style_tag(content=f"{_LEFT_OUT} {{ display: none; }}")
    tab.locator("#coefficients input").fill("ckf y_")
    tab.get_by_role("button", name="Error / sd").click()
    tab.locator("#convergence").scroll_into_view_if_needed()
    tab.wait_for_function("document.querySelectorAll('#convergence canvas').length >= 3")
    box = tab.locator("#convergence").bounding_box()
    assert box is not None
    bottom = box["y"] + box["height"] + tab.evaluate("scrollY") + _MARGIN
    file = _IMAGES / _TARGETS[scheme]
    tab.screenshot(path=file, full_page=True, clip={"x": 0, "y": 0, "width": _WIDTH, "height": bottom})
    tab.close()


if __name__ == "__main__":
    main()
