"""Files from outside are gone through by another process before they are read: see `auvid_cli.data.walk`."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Sequence
from math import ceil
from pathlib import Path

from auvid_cli.errors import FileError
from auvid_cli.printable import one_line

# What going through files may take, s; what a busy machine may take to start Python and to load h5py comes first.
_SECONDS, _BYTES_PER_SECOND = 10, 20e6
_STARTING = 60
_WALK = Path(__file__).with_name("walk.py")
_Identity = tuple[int, ...]
# Files that were gone through, or written, by this process, and not changed since.
_sound: set[_Identity] = set()


def trust(path: Path) -> None:
    """Take a file that this process has just written for sound."""
    _sound.add(_identity(path))


def screen(paths: Iterable[Path]) -> None:
    """Make sure that HDF5 files, as far as they are there, can be read to their ends: all together and each once.

    Raises
    ------
    FileError
        If one is damaged, or going through them takes more than 10 s and 1 s for every 20 MB.
    """
    identities = {path: _identity(path) for path in paths if path.is_file()}
    new = [path for path, identity in identities.items() if identity not in _sound]
    if not new:
        return
    # Of several, those behind one that ended the process have not been looked at.
    for path, flaw in zip(new, _flaws(new), strict=False):
        if flaw:
            raise FileError(f"{path}: damaged or not an auvid file: {one_line(flaw)}")
    _sound.update(identities.values())


def _identity(path: Path) -> _Identity:
    known = path.stat()
    return known.st_dev, known.st_ino, known.st_size, known.st_mtime_ns, known.st_ctime_ns


def _flaws(paths: Sequence[Path]) -> list[str]:
    """Say what is wrong with each file, in order, up to the first with which the process did not come to an end."""
    seconds = _SECONDS + ceil(sum(path.stat().st_size for path in paths) / _BYTES_PER_SECOND)
    command = [sys.executable, "-P", "-X", "utf8", str(_WALK), str(os.getpid()), str(seconds), *map(str, paths)]
    quiet, pipe = subprocess.DEVNULL, subprocess.PIPE
    # In a session of its own an interrupt at the terminal does not reach it: it is for this process to handle.
    with subprocess.Popen(command, stdin=quiet, stdout=pipe, stderr=quiet, start_new_session=True) as process:
        try:
            said, _ = process.communicate(timeout=_STARTING + seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            said, _ = process.communicate()
        finally:
            process.kill()
    flaws = said.decode("ascii").split("\n")[:-1]
    if len(flaws) < len(paths):
        stopped = process.returncode in (-getattr(signal, "SIGALRM", 0), -getattr(signal, "SIGKILL", 0))
        flaws.append("reading it does not end" if stopped else "reading it ends in a crash of the HDF5 library")
    return flaws
