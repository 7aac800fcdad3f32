"""Places in settings files, and error messages that point there."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

KeyPath = tuple[str | int, ...]
"""Keys and list indices from the top of the settings down to one of them."""

# Start of the name of a source that is an override.
OVERRIDE = "--set "
LINE_WIDTH = 100  # characters of an excerpt
MAX_MESSAGES = 50
MAX_MESSAGE_LENGTH = 600  # characters


@dataclass(frozen=True)
class ConfigSource:
    """Text with settings.

    Attributes
    ----------
    name : str
        Name in messages: the path of the file, or the override as it was given.
    folder : pathlib.Path
        Folder of relative paths in the text.
    text : str
        Whole content; empty for an override.
    path : pathlib.Path or None
        The file, if it is one.
    """

    name: str
    folder: Path
    text: str = ""
    path: Path | None = None


@dataclass(frozen=True)
class Position:
    """Place in a source; line and column count from 1, and line 0 is the source as a whole."""

    source: ConfigSource
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.source.name}:{self.line}:{self.column}" if self.line else self.source.name

    def excerpt(self) -> str:
        """Return the line with a caret under the column, indented; empty if there is no such line."""
        text = dict(enumerate(self.source.text.splitlines(), start=1)).get(self.line)
        if not text:
            return ""
        start = max(0, self.column - LINE_WIDTH // 2) if len(text) > LINE_WIDTH else 0
        shown = text[start : start + LINE_WIDTH]
        before = "".join("\t" if c == "\t" else " " for c in shown[: self.column - 1 - start])
        return f"\n    {self.line} | {shown}\n    {' ' * len(str(self.line))} | {before}^"


@dataclass(frozen=True)
class Mistake:
    """Error at a place of a source and a path of the settings, which is empty for the whole."""

    at: Position
    path: KeyPath
    message: str

    def under(self, path: KeyPath) -> "Mistake":
        """Return the mistake with `path` in front of its own."""
        return replace(self, path=path + self.path)

    def __str__(self) -> str:
        path = dotted(self.path)
        # An override begins with its key.
        is_named = str(self.at).startswith(f"{OVERRIDE}{path}=")
        return ": ".join(part for part in (str(self.at), "" if is_named else path, self.message) if part)


def dotted(path: KeyPath) -> str:
    """Return a path as the user writes it in an override."""
    return ".".join(map(str, path))


def mistakes_text(mistakes: Iterable[Mistake]) -> str:
    """Return the first mistakes, file by file: a line for each, then an excerpt for those at the same place."""
    ordered = list(mistakes)
    ranks = {file: rank for rank, file in enumerate(dict.fromkeys(m.at.source.name for m in ordered))}
    ordered.sort(key=lambda m: (ranks[m.at.source.name], m.at.line, m.at.column))
    groups = ((at, list(group)) for at, group in groupby(ordered[:MAX_MESSAGES], key=lambda mistake: mistake.at))
    text = "\n".join("\n".join(_shortened(str(m)) for m in group) + at.excerpt() for at, group in groups)
    if len(ordered) > MAX_MESSAGES:
        text += f"\nand {len(ordered) - MAX_MESSAGES} more mistakes"
    return "".join(c if c.isprintable() or c in "\n\t" else "?" for c in text)


def _shortened(text: str) -> str:
    half = MAX_MESSAGE_LENGTH // 2
    return text if len(text) <= MAX_MESSAGE_LENGTH else f"{text[:half]} ... {text[-half:]}"
