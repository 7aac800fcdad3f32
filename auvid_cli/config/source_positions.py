"""YAML text to a tree of plain values with their positions, and errors at these positions."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby
from pathlib import Path
from typing import Any

import yaml

from auvid_cli.text import shortened

KeyPath = tuple[str | int, ...]
"""Keys and list indices from the top of the settings to a value."""
# Prefix of the name of an override.
OVERRIDE = "--set "
LINE_WIDTH = 100  # characters of an excerpt
MAX_MESSAGES = 50
MAX_MESSAGE_LENGTH = 600  # characters
_TAGS = "tag:yaml.org,2002:"
_INT = f"{_TAGS}int"
_FLOAT = f"{_TAGS}float"
_MERGE = f"{_TAGS}merge"
_KEPT_TAGS = (f"{_TAGS}null", f"{_TAGS}bool", _MERGE)
# Real settings are smaller; larger files would take long to read.
MAX_VALUES = 10_000
MAX_DEPTH = 50


@dataclass(frozen=True)
class ConfigSource:
    """Text with settings."""

    name: str  # name in messages: the path of the file, or the text of the override
    folder: Path  # folder of relative paths in the text
    text: str = ""  # whole content; empty for an override
    path: Path | None = None  # the file; None for other text


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

    def __str__(self) -> str:
        path = dotted(self.path)
        # The text of an override already begins with its key.
        is_named = str(self.at).startswith(f"{OVERRIDE}{path}=")
        return ": ".join(part for part in (str(self.at), "" if is_named else path, self.message) if part)


def dotted(path: KeyPath) -> str:
    """Return a path in dotted form, as in an override."""
    return ".".join(map(str, path))


def mistakes_text(mistakes: Iterable[Mistake]) -> str:
    """Return the first mistakes, file by file: a line for each, then an excerpt of their position."""
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


@dataclass(frozen=True)
class Tree:
    """Value with its position; children are trees."""

    content: Any
    at: Position  # start of the value
    key_at: Position | None = None  # start of its key, if it has one
    readable: bool = True  # False for a file that could not be read, whose missing values are not reported

    @property
    def children(self) -> dict[str | int, "Tree"]:
        """Return the children by key or list index."""
        if isinstance(self.content, list):
            return dict(enumerate(self.content))
        return self.content if isinstance(self.content, dict) else {}

    @property
    def data(self) -> Any:
        """Return the plain dict, list or scalar."""
        if isinstance(self.content, list):
            return [child.data for child in self.content]
        if isinstance(self.content, dict):
            return {key: child.data for key, child in self.content.items()}
        return self.content

    @property
    def heading(self) -> Position:
        """Return the position of the key, if it is in the same source, else that of the value."""
        return self.key_at if self.key_at is not None and self.key_at.source == self.at.source else self.at

    def child(self, part: str | int) -> "Tree | None":
        """Return the child at a key or list index; None if it does not exist."""
        return self.children.get(part)

    def descend(self, path: KeyPath) -> "Iterator[Tree]":
        """Yield the trees along a path, this one first, as far as they exist."""
        node: Tree | None = self
        yield self
        for part in path:
            if (node := node.child(part)) is None:
                return
            yield node

    def files(self) -> set[Path]:
        """Return the files from which the values were read."""
        own = {self.at.source.path} if self.at.source.path is not None else set()
        return own.union(*(child.files() for child in self.children.values()))

    def placed_at(self, at: Position) -> "Tree":
        """Return the tree with all positions replaced by one."""
        content = self.content
        if isinstance(content, dict):
            content = {key: child.placed_at(at) for key, child in content.items()}
        elif isinstance(content, list):
            content = [child.placed_at(at) for child in content]
        return Tree(content, at, at)

    def put(self, path: KeyPath, new: "Tree") -> "Tree":
        """Return a copy with `new` at `path`; missing mappings are created.

        Raises
        ------
        ValueError
            If the path leads through a scalar, or a list without that index.
        """
        if not path:
            return replace(new, key_at=self.key_at or new.key_at)
        part, *rest = path
        if isinstance(self.content, list):
            index = int(part) if str(part).isdecimal() else -1
            if (child := self.child(index)) is None:
                raise ValueError(f"no entry {part} in a list of {len(self.content)}; entries count from 0")
            content = list(self.content)
            content[index] = child.put(tuple(rest), new)
        elif isinstance(self.content, dict) or self.content is None:
            child = self.child(part) or Tree(None, new.at, new.at)
            content = {**self.children, part: child.put(tuple(rest), new)}
        else:
            raise ValueError(f"cannot set {part!r} in {self.content!r}: it has no keys")
        return replace(self, content=content)


# Campaigns and notebooks read the same files many times; each override is a source, too.
@lru_cache(maxsize=256)
def read_tree(source: ConfigSource) -> tuple[Tree, tuple[Mistake, ...]]:
    """Read a YAML document safely; return its tree and its errors.

    The first value of a duplicate key counts. The content is None if the text is not valid YAML.
    """
    start = Position(source, 1, 1)
    try:
        loader = _Loader(source)
        root = loader.get_single_node()
        return (loader.tree(root) if root else Tree(None, start)), tuple(loader.mistakes)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        message = ", ".join(part for part in (error.context, error.problem) if part)
        message = "a tab in the indentation; use spaces" if "'\\t'" in message else message
        mistake = Mistake(_position(source, mark) if mark else start, (), f"not valid YAML: {message}")
    except yaml.reader.ReaderError as error:
        mistake = _unreadable_character(source, error.position)
    return Tree(None, start, readable=False), (mistake,)


class _Loader(yaml.SafeLoader):
    """Loader of trees, with the mistakes found in them.

    Its rules for scalars are plainer than those of PyYAML: 010 is not 8, 1:30 is not 90, and a date is text.
    """

    yaml_implicit_resolvers = {  # noqa: RUF012
        first: [(tag, pattern) for tag, pattern in kinds if tag in _KEPT_TAGS]
        for first, kinds in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def __init__(self, source: ConfigSource) -> None:
        super().__init__(source.text)
        self.source = source
        self.mistakes: list[Mistake] = []
        self._composed = self._depth = self._values = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose the next node; raise an error as soon as the text is too large or unsafe."""
        event: Any = self.peek_event()
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise _error(event, f"the tag {tag.replace(_TAGS, '!!')!r} is not allowed")
        # A lone surrogate cannot be written to a file or terminal.
        if any("\ud800" <= letter <= "\udfff" for letter in getattr(event, "value", None) or ""):
            raise _error(event, "half of a character (\\ud800 to \\udfff); expected text")
        self._composed += 1
        _check_size(event, self._composed, self._depth)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def tree(self, node: yaml.Node, path: KeyPath = (), above: tuple[yaml.Node, ...] = ()) -> Tree:
        """Return the tree of a node; `above` are the nodes that contain it. Each use of an alias counts."""
        self._values += 1
        if node in above:
            raise _error(node, "an alias to a value that contains it")
        _check_size(node, self._values, len(above))
        above = (*above, node)
        if isinstance(node, yaml.ScalarNode):
            content = self._scalar(node)
        elif isinstance(node, yaml.MappingNode):
            content = self._mapping(node, path, above)
        else:
            content = [self.tree(item, (*path, index), above) for index, item in enumerate(node.value)]
        return Tree(content, _position(self.source, node.start_mark))

    def _scalar(self, node: yaml.ScalarNode) -> Any:
        # YAML 1.1 and pydantic read 5_0 as 50.
        numbers = yaml.SafeLoader.yaml_implicit_resolvers.get(node.value[:1], [])
        is_number = any(tag in (_INT, _FLOAT) and pattern.match(node.value) for tag, pattern in numbers)
        if node.style is None and "_" in node.value and is_number:
            raise _error(node, f"{node.value!r}: underscore in a number; put text in quotes")
        try:
            return self.construct_object(node)
        except ValueError:  # more digits than Python reads
            raise _error(node, f"{shortened(node.value, 60)}: too many digits for a number") from None

    def _mapping(self, node: yaml.MappingNode, path: KeyPath, above: tuple[yaml.Node, ...]) -> dict[str, Tree]:
        """Return the children of a mapping, and of merged mappings for keys that it lacks."""
        content: dict[str, Tree] = {}
        merged: list[yaml.Node] = []
        for key, value in node.value:
            if key.tag == _MERGE:
                merged += value.value if isinstance(value, yaml.SequenceNode) else [value]
                continue
            if not isinstance(key, yaml.ScalarNode):
                raise _error(key, "a key must be a plain word")
            inner, at = (*path, key.value), _position(self.source, key.start_mark)
            if key.value in content:
                first = content[key.value].heading.line
                self.mistakes.append(Mistake(at, inner, f"duplicate key {key.value!r} (first in line {first})"))
                continue
            content[key.value] = replace(self.tree(value, inner, above), key_at=at)
        for other in merged:
            if not isinstance(other, yaml.MappingNode):
                raise _error(other, "only a mapping can be merged with '<<'")
            content = {**self.tree(other, path, above).content, **content}
        return content


_Loader.add_implicit_resolver(_INT, re.compile(r"[-+]?(?:0|[1-9][0-9]*)$"), list("-+0123456789"))
_Loader.add_implicit_resolver(
    _FLOAT,
    re.compile(r"[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+][0-9]+)?$|[-+]?\.(?:inf|Inf|INF)$|\.(?:nan|NaN|NAN)$"),
    list("-+0123456789."),
)


def _check_size(node: yaml.Node | yaml.Event, n_values: int, depth: int) -> None:
    if n_values > MAX_VALUES:
        raise _error(node, f"more than {MAX_VALUES} values")
    if depth > MAX_DEPTH:
        raise _error(node, "nested too deeply")


def _error(node: yaml.Node | yaml.Event, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)


def _position(source: ConfigSource, mark: Any) -> Position:
    return Position(source, mark.line + 1, mark.column + 1)


def _unreadable_character(source: ConfigSource, index: int) -> Mistake:
    code = ord(source.text[index])
    before = f"{source.text[:index]}.".splitlines()
    is_byte = 0xDC80 <= code <= 0xDCFF
    message = f"not UTF-8 text: byte 0x{code - 0xDC00:02x}" if is_byte else f"character U+{code:04X} is not allowed"
    return Mistake(Position(source, len(before), len(before[-1])), (), message)
