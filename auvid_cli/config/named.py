"""A member of an enumeration by the name that users write."""

from enum import StrEnum
from typing import TypeVar

from auvid_cli.errors import ConfigError

Member = TypeVar("Member", bound=StrEnum)


def named(kind: type[Member], name: str, noun: str) -> Member:
    """Return the member of a name, such as ``"tukf"``; a member itself is its own name.

    Parameters
    ----------
    kind : enumeration of text
    name : str
    noun : str
        Noun for such a member in the message.

    Raises
    ------
    ConfigError
        If there is none of that name.
    """
    try:
        return kind(name)
    except ValueError:
        raise ConfigError(f"{name!r} is no {noun}; auvid knows {', '.join(kind)}") from None
