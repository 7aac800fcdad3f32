"""How far the search for a manoeuvre has come, in a file from which it goes on."""

import json
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from auvid_cli.data.files import write_text
from auvid_cli.errors import FileError

_KIND = "auvid design search"


class SearchState(NamedTuple):
    """What of a search cannot be had again at once.

    Attributes
    ----------
    key : str
        Of all that the search depends on; the same for the same search.
    elapsed : float
        Time that it took, s.
    costs : tuple of tuple of float
        Of all manoeuvres that were tried, generation by generation.
    """

    key: str
    elapsed: float
    costs: tuple[tuple[float, ...], ...]


def write_search(path: Path, state: SearchState) -> None:
    """Write a file whole or not at all.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    write_text(path, json.dumps({"kind": _KIND} | state._asdict()) + "\n")


def read_search(path: Path) -> SearchState | None:
    """Read a file; None if there is none.

    Raises
    ------
    FileError
        If it is something else, or damaged.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot be read: {error}") from None
    try:
        held = json.loads(text)
    except (ValueError, RecursionError):
        held = None
    if not (isinstance(held, dict) and held.get("kind") == _KIND and _is_whole(held)):
        raise FileError(f"{path}: is damaged, or no state of a search; take it away to search anew")
    return SearchState(held["key"], float(held["elapsed"]), tuple(map(tuple, held["costs"])))


def _is_whole(held: dict[str, Any]) -> bool:
    costs = held.get("costs")
    if not (isinstance(held.get("key"), str) and _is_number(held.get("elapsed")) and isinstance(costs, list)):
        return False
    sizes = {len(each) if isinstance(each, list) else 0 for each in costs}
    return len(sizes) == 1 and 0 not in sizes and all(_is_number(cost) for each in costs for cost in each)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
