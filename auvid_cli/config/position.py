"""Where a setting is written, and mistakes that point there."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

KeyPath = tuple[str | int, ...]
"""Keys and list indices from the top of the settings down to one of them."""

# What the name of a source begins with that is an override.
OVERRIDE = "--set "
WIDTH = 100
MOST_SHOWN = 50
LONGEST_SHOWN = 600


@dataclass(frozen=True)
class ConfigSource:
    """A text with settings.

    Attributes
    ----------
    name : str
        What messages call it: the file's path, or the override as it was given.
    folder : pathlib.Path
        What relative paths in it refer to.
    text : str
        Its whole content; empty for an override, whose name says it all.
    path : pathlib.Path or None
        The file, if it is one.
    """

    name: str
    folder: Path
    text: str = ""
    path: Path | None = None


@dataclass(frozen=True)
class Position:
    """A place in a source; line and column count from 1, and line 0 stands for the source as a whole."""

    source: ConfigSource
    line: int = 0
    column: int = 0

    @property
    def file(self) -> str:
        """Return the name of the source."""
        return self.source.name

    @property
    def text(self) -> str:
        """Return the line itself; empty if there is none."""
        lines = self.source.text.splitlines()
        return lines[self.line - 1] if 0 < self.line <= len(lines) else ""

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file

    def excerpt(self) -> str:
        """Return the line with a caret under the column, indented; empty if there is no such line."""
        if not self.text:
            return ""
        start = max(0, self.column - WIDTH // 2) if len(self.text) > WIDTH else 0
        shown = self.text[start : start + WIDTH]
        before = "".join("\t" if c == "\t" else " " for c in shown[: self.column - 1 - start])
        return f"\n    {self.line} | {shown}\n    {' ' * len(str(self.line))} | {before}^"


@dataclass(frozen=True)
class Mistake:
    """Something that the user has to mend, at a path of the settings ('' if it is the whole)."""

    at: Position
    path: KeyPath
    message: str

    def under(self, path: KeyPath) -> "Mistake":
        """Return the same mistake where its tree hangs at `path` of a larger one."""
        return replace(self, path=path + self.path)

    def __str__(self) -> str:
        # An override begins with its key.
        path = dotted(self.path)
        said = str(self.at).startswith(f"{OVERRIDE}{path}=")
        return ": ".join(part for part in (str(self.at), "" if said else path, self.message) if part)


def dotted(path: KeyPath) -> str:
    """Write a path as the user does in an override."""
    return ".".join(map(str, path))


def mistakes_text(mistakes: Iterable[Mistake]) -> str:
    """Write the first mistakes file by file: a line each, then the line of the file for those at one place."""
    ordered = list(mistakes)
    ranks = {file: rank for rank, file in enumerate(dict.fromkeys(mistake.at.file for mistake in ordered))}
    ordered.sort(key=lambda mistake: (ranks[mistake.at.file], mistake.at.line, mistake.at.column))
    groups = ((at, list(group)) for at, group in groupby(ordered[:MOST_SHOWN], key=lambda mistake: mistake.at))
    text = "\n".join("\n".join(map(_shortened, group)) + at.excerpt() for at, group in groups)
    if len(ordered) > MOST_SHOWN:
        text += f"\nand {len(ordered) - MOST_SHOWN} more mistakes"
    return "".join(c if c.isprintable() or c in "\n\t" else "?" for c in text)


def _shortened(mistake: Mistake) -> str:
    text = str(mistake)
    half = LONGEST_SHOWN // 2
    return text if len(text) <= LONGEST_SHOWN else f"{text[:half]} ... {text[-half:]}"
