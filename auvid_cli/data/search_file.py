"""How far the search for a manoeuvre has come, in a file from which it goes on."""

import json
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import AfterValidator, BaseModel, Field, FiniteFloat, ValidationError

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


def _alike(costs: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len({len(generation) for generation in costs}) > 1:
        raise ValueError("generations of different sizes")
    return costs


_Costs = Annotated[tuple[FiniteFloat, ...], Field(min_length=1)]


class _Held(BaseModel, strict=True):
    """What stands in a file."""

    kind: Annotated[str, Field(pattern=f"^{_KIND}$")]
    key: str
    elapsed: FiniteFloat
    costs: Annotated[tuple[_Costs, ...], Field(min_length=1), AfterValidator(_alike)]


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
        held = _Held.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return None
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error}") from None
    except ValidationError:
        raise FileError(f"{path}: is damaged, or no state of a search; take it away to search anew") from None
    return SearchState(held.key, held.elapsed, held.costs)
