"""Numbers along three axes: one for all of them, or one each."""

from typing import Annotated

from pydantic import Field

Positive = tuple[Annotated[float, Field(gt=0)], ...]


def three(values: tuple[float, ...]) -> tuple[float, ...]:
    """Return the numbers of three axes."""
    return values if len(values) == 3 else values * 3
