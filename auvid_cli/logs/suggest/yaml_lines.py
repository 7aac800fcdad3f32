"""Lines of a suggested map: YAML with comments."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple, TypeAlias

from auvid_cli.text import printable

_WORDS_OF_YAML = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")
_PLAIN = re.compile(r"[A-Za-z_/][\w./-]*", re.ASCII)
Flow: TypeAlias = "str | int | Mapping[str, Flow] | tuple[Flow, ...] | None"
Value: TypeAlias = "Flow | list[Line] | list[YamlEntry]"


class Phrase(str):
    """Text with blanks that is written without quotes, such as a number with its unit."""

    __slots__ = ()


class Comment(NamedTuple):
    """A line with a comment only."""

    text: str


class YamlEntry(NamedTuple):
    """A key, its value (a list of lines is written as a block of its own) and a comment after it."""

    key: str
    value: "Value"
    comment: str = ""


Line: TypeAlias = YamlEntry | Comment


def commented_text(lines: Iterable[Line]) -> str:
    """Return lines as the YAML text of a mapping."""
    return "".join(f"{printable(line)}\n" for line in _block(lines, ""))


def quoted(name: str) -> str:
    """Return a name in the quotes that YAML needs for it."""
    if _PLAIN.fullmatch(name) and name.lower() not in _WORDS_OF_YAML:
        return name
    if not name.isprintable():
        escaped = name.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{printable(escaped)}"'
    return "'" + name.replace("'", "''") + "'"


def _block(lines: Iterable[Line], indent: str) -> Iterator[str]:
    for line in lines:
        if isinstance(line, Comment):
            yield f"{indent}# {line.text}"
            continue
        comment = f" # {line.comment}" if line.comment else ""
        if isinstance(line.value, list):
            yield f"{indent}{line.key}:{comment}"
            yield from _block(line.value, f"{indent}  ")
        else:
            yield f"{indent}{line.key}: {_flow(line.value)}{comment}"


def _flow(value: Flow) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return str(value).lower()
        case int() | Phrase():
            return str(value)
        case str():
            return quoted(value)
        case tuple():
            return f"[{', '.join(map(_flow, value))}]"
    return f"{{{', '.join(f'{key}: {_flow(item)}' for key, item in value.items())}}}"
