"""Write files: complete under their final name or not at all, and never over an input."""

import hashlib
import os
import platform
import re
import shutil
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from auvid_cli.errors import FileError

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}

# A temporary name holds the machine and the process that writes it.
_PREFIX = f".auvid-{hashlib.sha256(platform.node().encode()).hexdigest()[:8]}-"
_TEMPORARY = re.compile(rf"{re.escape(_PREFIX)}(\d+)-[0-9a-f]{{16}}")


@contextmanager
def temporary_in(folder: Path, is_folder: bool = False) -> Iterator[Path]:
    """Make a new file or folder in a folder, removed at the end of the block unless it has been moved.

    Those that killed processes of this machine left there are removed first.
    """
    remove_abandoned(folder)
    path = folder / f"{_PREFIX}{os.getpid()}-{token_hex(8)}"
    if is_folder:
        path.mkdir()
    else:
        path.touch(exist_ok=False)
    try:
        yield path
    finally:
        _remove(path)


def remove_abandoned(folder: Path) -> None:
    """Remove temporary files and folders of processes that have ended without removing them."""
    for path in folder.glob(f"{_PREFIX}*"):
        match = _TEMPORARY.fullmatch(path.name)
        if match and not _is_running(int(match[1])):
            with suppress(OSError):
                _remove(path)


def _is_running(process: int) -> bool:
    if os.name != "posix":
        # On Windows the signal 0 would interrupt it.
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    return True


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`, which gets its name when the block ends without an error.

    Where `path` is a link, the file that it leads to is replaced, and the link stays.

    Raises
    ------
    FileError
        If the folder or the file cannot be written, or a pipe, device or folder has that name; the temporary file is
        removed, and an earlier file of that name stays as it was.
    """
    try:
        place = _place_of(path)
        place.parent.mkdir(parents=True, exist_ok=True)
        with temporary_in(place.parent) as temporary:
            yield temporary
            temporary.replace(place)
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror or error}") from error


def _place_of(path: Path) -> Path:
    try:
        kind = stat.S_IFMT(path.stat().st_mode)
    except FileNotFoundError:
        kind = stat.S_IFREG
    if kind != stat.S_IFREG:
        raise FileError(f"{path}: cannot be written: it is {_KINDS.get(kind, 'something else')}, not a file")
    return path.resolve() if path.is_symlink() else path


def keep_apart(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Refuse to write over what is read, whatever it is called there.

    Raises
    ------
    FileError
        If one of the outputs is one of the inputs.
    """
    read = {_identity(path): path for path in inputs if path.exists()}
    for output in outputs:
        if output.exists() and (path := read.get(_identity(output))) is not None:
            same = "" if path == output else f" as {path}"
            raise FileError(f"{output}: is read from here{same}, and would be written over; name another place")


def _identity(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_dev, status.st_ino


def write_folder(folder: Path, texts: Mapping[str, str]) -> None:
    """Write a new folder of text files whole or not at all; one that is there already must be empty.

    Raises
    ------
    FileError
        If it cannot be written, is not empty, or is a file.
    """
    refuse_filled(folder)
    is_there = folder.exists()
    place = folder if is_there else folder.parent
    try:
        place.mkdir(parents=True, exist_ok=True)
        with temporary_in(place, is_folder=True) as temporary:
            for name, text in texts.items():
                (temporary / name).write_text(text, encoding="utf-8")
            if is_there:
                # It may be the working folder of a shell: keep it.
                for name in texts:
                    (temporary / name).rename(folder / name)
            else:
                temporary.rename(folder)
    except OSError as error:
        raise FileError(f"{folder}: cannot be written: {error.strerror or error}") from error


def refuse_filled(folder: Path) -> None:
    """Refuse a new folder whose name is taken.

    Raises
    ------
    FileError
        If it is a file, is not empty, or cannot be read.
    """
    try:
        if not folder.is_dir() and os.path.lexists(folder):
            raise FileError(f"{folder}: exists already, and is no folder; name another place")
        if folder.is_dir():
            remove_abandoned(folder)
        if folder.is_dir() and any(folder.iterdir()):
            raise FileError(f"{folder}: exists already, and is not empty; name another place")
    except OSError as error:
        raise FileError(f"{folder}: cannot be looked at: {error.strerror or error}") from error


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
