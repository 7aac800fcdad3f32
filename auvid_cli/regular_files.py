"""Refuse folders, pipes and devices, which a reader could wait for forever."""

import stat
from pathlib import Path


def check_regular_file(path: Path) -> None:
    """Check that a path is a regular file.

    Raises
    ------
    ValueError
        If it is missing, a folder, a pipe or a device, or its status cannot be read; the message omits the path.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        raise ValueError("is a link to a missing file" if path.is_symlink() else "no such file") from None
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from None
    if stat.S_ISDIR(mode):
        raise ValueError("is a folder, not a file")
    if not stat.S_ISREG(mode):
        raise ValueError("is a pipe or a device, not a regular file")


def read_bytes(path: Path, limit: int) -> bytes:
    """Read a regular file of at most `limit` bytes.

    Raises
    ------
    ValueError
        Like `check_regular_file`, or if the file is larger or cannot be read.
    """
    check_regular_file(path)
    try:
        with path.open("rb") as file:
            content = file.read(limit + 1)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from None
    if len(content) > limit:
        raise ValueError(f"is larger than {limit / 1e6:g} MB")
    return content
