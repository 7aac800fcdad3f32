"""What in a map does not fit the logs, collected so that all of it is said at once."""

from collections.abc import Iterator
from contextlib import contextmanager

from auvid_cli.config.locate import at_value
from auvid_cli.config.position import KeyPath, Mistake, mistakes_text
from auvid_cli.config.tree import Tree
from auvid_cli.errors import ConfigError


class RefusedError(Exception):
    """What the map says does not fit the numbers in the log; `path` is where the map says it."""

    def __init__(self, path: KeyPath, message: str) -> None:
        super().__init__(message)
        self.path = path


class Refusals:
    """Mistakes of a map, each at its place.

    Parameters
    ----------
    tree : Tree
        The map as it was read.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self._mistakes: list[Mistake] = []
        self._said = 0

    def say(self, path: KeyPath, message: str) -> None:
        """Keep a mistake, once where several settings lead to it."""
        mistake = at_value(self._tree, path, message)
        if mistake not in self._mistakes:
            self._mistakes.append(mistake)
        self._said += 1

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Keep what ends the block, and go on after it."""
        try:
            yield
        except RefusedError as error:
            self.say(error.path, str(error))

    def stop_if_any(self) -> None:
        """Raise ConfigError with all mistakes kept so far."""
        if self._mistakes:
            raise ConfigError(mistakes_text(self._mistakes))

    def __len__(self) -> int:
        return self._said
