"""Showing a page to who asked for it."""

from pathlib import Path

from auvid_cli.cli.terminal import Terminal


def open_page(page: Path, terminal: Terminal) -> None:
    """Open a page in the browser of the system, or say that there is none."""
    import webbrowser

    if not webbrowser.open(page.resolve().as_uri()):
        terminal.say(f"{page}: no browser could be started here; open the file in one")
