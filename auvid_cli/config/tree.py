"""YAML text to a tree of plain values that know where they are written."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from auvid_cli.config.position import ConfigSource, KeyPath, Mistake, Position
from auvid_cli.printable import shortened

_TAGS = "tag:yaml.org,2002:"
_INT_TAG, _FLOAT_TAG = f"{_TAGS}int", f"{_TAGS}float"
_MERGE_TAG = f"{_TAGS}merge"
_PLAIN_TAGS = (f"{_TAGS}null", f"{_TAGS}bool", _MERGE_TAG)
_NUMBER_TAGS = (_INT_TAG, _FLOAT_TAG)
# No settings hold or nest so many values; far more take long to read.
MOST_NODES = 10_000
DEEPEST = 50


@dataclass(frozen=True)
class Tree:
    """A value with its position; children are trees again.

    Attributes
    ----------
    content : dict of str to Tree, list of Tree, or scalar
        The value.
    at : Position
        Where the value starts.
    key_at : Position or None
        Where its key starts, if it has one.
    readable : bool
        False where a file could not be read: what the value lacks is no further mistake.
    """

    content: Any
    at: Position
    key_at: Position | None = None
    readable: bool = True

    @property
    def data(self) -> Any:
        """Return the plain dict, list or scalar."""
        match self.content:
            case dict():
                return {key: child.data for key, child in self.content.items()}
            case list():
                return [child.data for child in self.content]
        return self.content

    @property
    def heading(self) -> Position:
        """Return where to point for the value as a whole: its key, if that is in the same source."""
        same = self.key_at is not None and self.key_at.source == self.at.source
        return self.key_at if same and self.key_at else self.at

    def child(self, part: str | int) -> "Tree | None":
        """Return the child at a key or list index, None if there is none."""
        match self.content:
            case dict():
                return self.content.get(part)
            case list() if isinstance(part, int) and 0 <= part < len(self.content):
                return self.content[part]
        return None

    def descend(self, path: KeyPath) -> "Iterator[Tree]":
        """Yield the trees along a path, this one first, as far as they exist."""
        node: Tree | None = self
        yield self
        for part in path:
            node = node.child(part)
            if node is None:
                return
            yield node

    def files(self) -> set[Path]:
        """Return the files in which the values are written."""
        own = {self.at.source.path} if self.at.source.path is not None else set()
        match self.content:
            case dict():
                return own.union(*(child.files() for child in self.content.values()))
            case list():
                return own.union(*(child.files() for child in self.content))
        return own

    def put(self, path: KeyPath, new: "Tree") -> "Tree":
        """Return a copy with `new` at `path`; mappings on the way are made where there is nothing.

        Raises
        ------
        ValueError
            If a scalar, or a list without that index, is in the way.
        """
        if not path:
            return replace(new, key_at=self.key_at if self.key_at else new.key_at)
        part, *rest = path
        match self.content:
            case dict() | None:
                child = self.child(part) or Tree(None, new.at, new.at)
                content = {**(self.content or {}), part: child.put(tuple(rest), new)}
            case list():
                index = int(part) if str(part).isdecimal() else -1
                child = self.child(index)
                if child is None:
                    raise ValueError(f"there is no entry {part} in a list of {len(self.content)} (they count from 0)")
                content = list(self.content)
                content[index] = child.put(tuple(rest), new)
            case _:
                raise ValueError(f"cannot set {part!r} in {self.content!r}, which has no keys")
        return replace(self, content=content)


# A campaign, a notebook or a test reads the same few files again and again, which takes longer than to check them.
@lru_cache(maxsize=32)
def read_tree(source: ConfigSource) -> tuple[Tree, tuple[Mistake, ...]]:
    """Read YAML safely.

    Parameters
    ----------
    source : ConfigSource
        Text of one YAML document.

    Returns
    -------
    Tree
        The first value of a duplicate key counts; the content is None if the text cannot be read.
    tuple of Mistake
        What is wrong with it as YAML.
    """
    start = Position(source, 1, 1)
    mistakes: list[Mistake] = []
    try:
        loader = _Loader(source.text)
        root = loader.get_single_node()
        tree = _Builder(source, loader, mistakes).tree(root) if root else Tree(None, start)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        at = Position(source, mark.line + 1, mark.column + 1) if mark else start
        message = ", ".join(part for part in (error.context, error.problem) if part)
        mistakes.append(Mistake(at, (), _plain_words(message)))
    except yaml.reader.ReaderError as error:
        mistakes.append(_unreadable_character(source, error.position))
    else:
        return tree, tuple(mistakes)
    return Tree(None, start, readable=False), tuple(mistakes)


class _Loader(yaml.SafeLoader):
    """PyYAML's, for values that are what they look like.

    It knows none of the kinds of YAML 1.1 that surprise: 010 is no 8, 1:30 is no 90, and a date is text.
    """

    yaml_implicit_resolvers = {  # noqa: RUF012
        first: [(tag, pattern) for tag, pattern in kinds if tag in _PLAIN_TAGS]
        for first, kinds in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._composed = self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose the next node; count and judge nodes while they come, since the whole may be long or do harm."""
        event: Any = self.peek_event()
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise _error(event, f"the tag {tag.replace(_TAGS, '!!')!r} is not allowed")
        # "\ud800" is half of a character, which no file or terminal takes.
        if any("\ud800" <= letter <= "\udfff" for letter in getattr(event, "value", None) or ""):
            raise _error(event, "half of a character (\\ud800 to \\udfff), which is no text")
        self._composed += 1
        if self._composed > MOST_NODES:
            raise _error(event, f"more than {MOST_NODES} values")
        if self._depth > DEEPEST:
            raise _error(event, "nested too deeply")
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


_Loader.add_implicit_resolver(_INT_TAG, re.compile(r"[-+]?(?:0|[1-9][0-9]*)$"), list("-+0123456789"))
_Loader.add_implicit_resolver(
    _FLOAT_TAG,
    re.compile(r"[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+][0-9]+)?$|[-+]?\.(?:inf|Inf|INF)$|\.(?:nan|NaN|NAN)$"),
    list("-+0123456789."),
)


class _Builder:
    """Turns composed YAML nodes into trees."""

    def __init__(self, source: ConfigSource, loader: _Loader, mistakes: list[Mistake]) -> None:
        self.source = source
        self.construct: Callable[[yaml.Node], Any] = loader.construct_object
        self.mistakes = mistakes
        self.nodes = 0

    def tree(self, node: yaml.Node, path: KeyPath = (), above: tuple[yaml.Node, ...] = ()) -> Tree:
        """Make the tree of a node; `above` are the nodes that contain it."""
        self.nodes += 1
        if self.nodes > MOST_NODES:
            raise _error(node, f"more than {MOST_NODES} values")
        if node in above:
            raise _error(node, "an alias to a value that contains it")
        if len(above) > DEEPEST:
            raise _error(node, "nested too deeply")
        above = (*above, node)
        match node:
            case yaml.ScalarNode():
                content = self.scalar(node)
            case yaml.MappingNode():
                content = self.mapping(node, path, above)
            case _:
                content = [self.tree(item, (*path, index), above) for index, item in enumerate(node.value)]
        return Tree(content, self.position(node))

    def scalar(self, node: yaml.ScalarNode) -> Any:
        """Return the value of a scalar; a number with underscores or thousands of digits is an error."""
        if node.style is None and _is_grouped(node.value):
            raise _error(node, f"{node.value!r} is no number with an underscore in it; text like this stands in quotes")
        try:
            return self.construct(node)
        except ValueError:
            # Python reads whole numbers up to some length only.
            raise _error(node, f"{shortened(node.value, 60)} is not a number that can be") from None

    def mapping(self, node: yaml.MappingNode, path: KeyPath, above: tuple[yaml.Node, ...]) -> dict[str, Tree]:
        """Return the children of a mapping: its own keys, then those of merged mappings that it has not."""
        content: dict[str, Tree] = {}
        merged: list[yaml.Node] = []
        for key, value in node.value:
            if key.tag == _MERGE_TAG:
                merged += value.value if isinstance(value, yaml.SequenceNode) else [value]
                continue
            if not isinstance(key, yaml.ScalarNode):
                raise _error(key, "a key must be a plain word")
            here, at = (*path, key.value), self.position(key)
            if key.value in content:
                first = content[key.value].key_at
                where = f" (first in line {first.line})" if first else ""
                self.mistakes.append(Mistake(at, here, f"duplicate key {key.value!r}{where}"))
                continue
            content[key.value] = replace(self.tree(value, here, above), key_at=at)
        for other in merged:
            if not isinstance(other, yaml.MappingNode):
                raise _error(other, "only a mapping can be merged with '<<'")
            content = {**self.tree(other, path, above).content, **content}
        return content

    def position(self, node: yaml.Node) -> Position:
        """Return where a node starts."""
        return Position(self.source, node.start_mark.line + 1, node.start_mark.column + 1)


def _is_grouped(text: str) -> bool:
    """Say whether a text is a number with underscores to YAML 1.1; the validation would take it for one as well."""
    kinds = yaml.SafeLoader.yaml_implicit_resolvers.get(text[:1], [])
    return "_" in text and any(tag in _NUMBER_TAGS and pattern.match(text) for tag, pattern in kinds)


def _error(node: yaml.Node | yaml.Event, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)


def _plain_words(problem: str) -> str:
    if "'\\t'" in problem:
        return "not valid YAML: a tab where only spaces may stand"
    return f"not valid YAML: {problem}"


def _unreadable_character(source: ConfigSource, index: int) -> Mistake:
    code = ord(source.text[index])
    before = source.text[:index].splitlines(keepends=True) or [""]
    line, column = (len(before) + 1, 1) if before[-1].endswith("\n") else (len(before), len(before[-1]) + 1)
    is_byte = 0xDC80 <= code <= 0xDCFF
    message = f"not UTF-8 text: byte 0x{code - 0xDC00:02x}" if is_byte else f"character U+{code:04X} is not allowed"
    return Mistake(Position(source, line, column), (), message)
