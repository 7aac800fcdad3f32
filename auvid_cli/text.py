"""Text for users: printable characters, single lines, sentences, and YAML with comments."""

import re
from collections.abc import Iterable, Iterator, Mapping
from math import degrees
from typing import NamedTuple, TypeAlias

_WORDS_OF_YAML = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")
_PLAIN = re.compile(r"[A-Za-z_/][\w./-]*", re.ASCII)
Flow: TypeAlias = "str | int | Mapping[str, Flow] | tuple[Flow, ...] | None"
Value: TypeAlias = "Flow | list[Line] | list[YamlEntry]"


def degrees_for(unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which a number of an SI unit is shown: degrees for an angle and its rates."""
    return (degrees(1.0), unit.replace("rad", "deg", 1)) if unit.startswith("rad") else (1.0, unit)


def printable(text: str) -> str:
    r"""Return a text with characters that cannot be displayed written as escapes, for example ``\x1b``."""
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in text)


def printable_lines(text: str) -> str:
    """Return a text of several lines with characters that cannot be displayed written as escapes."""
    return "\n".join(map(printable, text.split("\n")))


def shortened(text: str, limit: int = 300) -> str:
    """Return a text, cut after `limit` characters."""
    return text if len(text) <= limit else f"{text[:limit]} ..."


def one_line(text: str) -> str:
    """Return a text in one printable line, with single blanks between words."""
    return printable(" ".join(text.split()))


def sentence(remark: str) -> str:
    """Return a remark with a capital letter and a full stop."""
    return f"{remark[0].upper()}{remark[1:]}."


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
