"""A terminal on which text of a user's file is nothing but text."""

from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from auvid_cli.printable import printable_lines


class PlainConsole(Console):
    """A console whose own signs alone steer the terminal: those in a text are written out."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Turn something into segments, as `Console.render`."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable_lines(text), style, control)
