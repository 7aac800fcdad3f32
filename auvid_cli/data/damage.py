"""Where the libraries that parse files fail."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from auvid_cli.errors import FileError

_LONGEST_REASON = 300


@contextmanager
def refusing_damage(complaint: Callable[[str], str]) -> Iterator[None]:
    """Turn whatever a library raises within a block, which is to hold nothing but its calls, into an error of the file.

    Parameters
    ----------
    complaint : callable
        What to say, given the library's reason.
    """
    try:
        yield
    # Of damaged files they let pass whatever they meet: errors of unpacking, of attributes that are not there, of
    # memory for lengths that cannot be, of SQLite, of their own; and some raise Exception itself.
    except Exception as error:
        reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        short = reason if len(reason) <= _LONGEST_REASON else f"{reason[:_LONGEST_REASON]} ..."
        raise FileError(complaint(short)) from error
