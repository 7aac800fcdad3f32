"""Files from outside are gone through by another process before they are read: see `auvid_cli.data.walk`."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from math import ceil
from pathlib import Path

from auvid_cli.errors import FileError
from auvid_cli.printable import one_line

# What going through files may take, s; what a busy machine may take to start Python and to load h5py comes first.
_SECONDS, _BYTES_PER_SECOND = 10, 20e6
_STARTING = 60
_WALK = Path(__file__).with_name("walk.py")
_Version = tuple[int, ...]
# What is wrong with files that were gone through; nothing with those that this process wrote.
_known: dict[_Version, str] = {}


class _Walk:
    """A process that goes through files.

    Parameters
    ----------
    versions : mapping
        Of the files, by path.
    """

    def __init__(self, versions: Mapping[Path, _Version]) -> None:
        self.versions = versions
        self._seconds = _SECONDS + ceil(sum(path.stat().st_size for path in versions) / _BYTES_PER_SECOND)
        command = [sys.executable, "-P", "-X", "utf8", str(_WALK), str(os.getpid()), str(self._seconds)]
        quiet, pipe = subprocess.DEVNULL, subprocess.PIPE
        # In a session of its own an interrupt at the terminal does not reach it: it is for this process to handle.
        self._process = subprocess.Popen(
            [*command, *map(str, versions)], stdin=quiet, stdout=pipe, stderr=quiet, start_new_session=True
        )

    def flaws(self) -> list[str]:
        """Say what is wrong with each file, in order, up to the first with which the process did not come to an end."""
        with self._process as process:
            try:
                output, _ = process.communicate(timeout=_STARTING + self._seconds)
            except subprocess.TimeoutExpired:
                process.kill()
                output, _ = process.communicate()
            finally:
                process.kill()
        flaws = output.decode("ascii").split("\n")[:-1]
        if len(flaws) < len(self.versions):
            stopped = process.returncode in (-getattr(signal, "SIGALRM", 0), -getattr(signal, "SIGKILL", 0))
            flaws.append("reading it does not end" if stopped else "reading it ends in a crash of the HDF5 library")
        return flaws


_begun: list[_Walk] = []


def trust(path: Path) -> None:
    """Take a file that this process has just written for sound."""
    _known[_version(path)] = ""


def begin(paths: Iterable[Path]) -> None:
    """Begin to go through files, all in one process, so that `screen` need not wait for each."""
    if new := _unknown(_versions(paths)):
        _begun.append(_Walk(new))


def screen(paths: Iterable[Path]) -> None:
    """Make sure that HDF5 files, as far as they are there, can be read to their ends: all together and each once.

    Raises
    ------
    FileError
        If one is damaged, or going through them takes more than 10 s and 1 s for every 20 MB.
    """
    versions = _versions(paths)
    while _begun and _unknown(versions):
        walk = _begun.pop()
        _note(walk.versions, walk.flaws())
    if new := _unknown(versions):
        _note(new, _flaws(new))
    for path, version in versions.items():
        # Of several, those behind one that ended the process have not been looked at.
        if flaw := _known.get(version):
            raise FileError(f"{path}: damaged or not an auvid file: {one_line(flaw)}")


def _versions(paths: Iterable[Path]) -> dict[Path, _Version]:
    return {path: _version(path) for path in paths if path.is_file()}


def _version(path: Path) -> _Version:
    known = path.stat()
    return known.st_dev, known.st_ino, known.st_size, known.st_mtime_ns, known.st_ctime_ns


def _unknown(versions: Mapping[Path, _Version]) -> dict[Path, _Version]:
    return {path: version for path, version in versions.items() if version not in _known}


def _flaws(versions: Mapping[Path, _Version]) -> list[str]:
    return _Walk(versions).flaws()


def _note(versions: Mapping[Path, _Version], flaws: Sequence[str]) -> None:
    _known.update(zip(versions.values(), flaws, strict=False))
