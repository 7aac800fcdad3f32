"""Reading what may be anything: a pipe that never speaks, a device that never ends, a folder."""

import stat
from pathlib import Path


def check_regular_file(path: Path) -> None:
    """Refuse what is no file of some length.

    Raises
    ------
    ValueError
        If it is missing, a folder, a pipe or a device, or cannot be looked at; the message says so, without the path.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        raise ValueError("no such file") from None
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from None
    if stat.S_ISDIR(mode):
        raise ValueError("is a folder, not a file")
    if not stat.S_ISREG(mode):
        raise ValueError("is a pipe or a device, not a regular file")


def read_bytes(path: Path, most: int) -> bytes:
    """Read a regular file of at most so many bytes.

    Raises
    ------
    ValueError
        As of `check_regular_file`, or if it is larger, or cannot be read.
    """
    check_regular_file(path)
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from None
    if len(content) > most:
        raise ValueError(f"is larger than {most / 1e6:g} MB")
    return content
