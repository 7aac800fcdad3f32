"""Take the picture of parts of a page, after `auvid run`: `python -m docs.make_page`, with the tests' Chromium."""

import argparse
import os
import shutil
from pathlib import Path

from playwright.sync_api import sync_playwright

_TARGET = Path(__file__).with_name("images") / "page.png"
_WIDTH, _MARGIN = 1120, 12
# Parts left out of the picture, so that every kind of part fits.
_LEFT_OUT = "#coefficients figure, #coefficients h3, #convergence .plot:nth-child(n + 4)"


def main() -> None:
    """Open the page, narrow its list down, and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, default=Path("results/spiral/report.html"))
    options = parser.parse_args()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=os.environ.get("CHROMIUM") or shutil.which("chromium"))
        tab = browser.new_page(viewport={"width": _WIDTH, "height": 900}, bypass_csp=True)
        tab.goto(options.page.absolute().as_uri())
        tab.add_style_tag(content=f"{_LEFT_OUT} {{ display: none; }}")
        tab.locator("#coefficients input").fill("ckf y_")
        tab.get_by_role("button", name="Error / sd").click()
        tab.locator("#convergence").scroll_into_view_if_needed()
        tab.wait_for_function("document.querySelectorAll('#convergence canvas').length >= 3")
        box = tab.locator("#convergence").bounding_box()
        assert box is not None
        bottom = box["y"] + box["height"] + tab.evaluate("scrollY") + _MARGIN
        tab.screenshot(path=_TARGET, full_page=True, clip={"x": 0, "y": 0, "width": _WIDTH, "height": bottom})
        browser.close()


if __name__ == "__main__":
    main()
