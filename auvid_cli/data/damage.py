"""Where the libraries that parse files fail."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from auvid_cli.errors import FileError
from auvid_cli.printable import one_line, shortened


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
        reason = one_line(str(error)).rstrip(".") or type(error).__name__
        raise FileError(complaint(shortened(reason))) from error
