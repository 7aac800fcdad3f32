"""Temporary files and folders that do not outlive who writes them, or not for long."""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

try:
    import fcntl
except ImportError:
    # Windows: what was killed leaves its temporary file behind.
    fcntl = None

_PREFIX, _BYTES = ".auvid-", 8
# A user's own file may begin alike.
_OURS = re.compile(rf"{re.escape(_PREFIX)}[0-9a-f]{{{2 * _BYTES}}}")


@contextmanager
def temporary_in(folder: Path) -> Iterator[Path]:
    """Make a new file in a folder, removed when the block ends; it may be moved away before.

    It is locked as long as its writer lives, whatever ends that. What is there of others and not locked was left behind
    by somebody who was killed, and is removed.
    """
    remove_abandoned(folder)
    path, handle = _new(folder)
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)
        if fcntl is not None:
            os.close(handle)


@contextmanager
def temporary_folder_in(folder: Path) -> Iterator[Path]:
    """Make a new folder in a folder, removed when the block ends; it may be moved away before.

    It is locked, and those that were left behind are removed, as with `temporary_in`.
    """
    remove_abandoned(folder)
    path, handle = _new_folder(folder)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
        if handle is not None:
            os.close(handle)


def _new_folder(folder: Path) -> tuple[Path, int | None]:
    while True:
        path = folder / f"{_PREFIX}{token_hex(_BYTES)}"
        path.mkdir()
        if fcntl is None:
            return path, None
        # Somebody may have found it, and removed it, before it was locked.
        with suppress(FileNotFoundError):
            handle = os.open(path, os.O_RDONLY)
            with suppress(OSError):
                fcntl.flock(handle, fcntl.LOCK_EX)
            if path.exists():
                return path, handle
            os.close(handle)


def _new(folder: Path) -> tuple[Path, int]:
    while True:
        path = folder / f"{_PREFIX}{token_hex(_BYTES)}"
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        if fcntl is None:
            # What is open there cannot be renamed.
            os.close(handle)
            return path, handle
        # Where files cannot be locked, as on some network disks, nobody finds this one unlocked either.
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        # Somebody may have found it before it was locked.
        if os.fstat(handle).st_nlink:
            return path, handle
        os.close(handle)


def remove_abandoned(folder: Path) -> None:
    """Take away the temporary files and folders in a folder that were left behind by somebody who was killed."""
    if fcntl is None:
        return
    with os.scandir(folder) as entries:
        candidates = [
            (entry.path, entry.is_dir(follow_symlinks=False))
            for entry in entries
            if _OURS.fullmatch(entry.name) and not entry.is_symlink()
        ]
    for path, is_folder in candidates:
        # It may be gone by now, be somebody else's, or be written at this moment: then it is left to its owner.
        with suppress(OSError):
            handle = os.open(path, (os.O_RDONLY if is_folder else os.O_RDWR | os.O_NONBLOCK) | os.O_NOFOLLOW)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if is_folder:
                    shutil.rmtree(path)
                else:
                    Path(path).unlink()
            finally:
                os.close(handle)
