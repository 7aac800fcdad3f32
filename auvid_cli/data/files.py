"""Files and folders: atomic writes, temporary files, errors of libraries that parse files, and the parts of a
results folder.
"""

import hashlib
import os
import platform
import re
import shutil
import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from auvid_cli.config.enums import FigureFormat, FilterName
from auvid_cli.errors import FileError
from auvid_cli.text import one_line, shortened

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
_LOCK_PATIENCE = 1.0  # s
_REPORT_FIGURES = ("path", "estimates", "convergence", "motion_errors", "free_runs", "innovations")
_OTHER_FIGURES = (
    *("identifiability_bounds", "identifiability_correlation", "timeline"),
    *("validation_velocities", "validation_attitude", "validation_horizons"),
)
_TABLES = (
    *("coefficients", "summary", "table_iv", "velocity_error", "consistency", "sensor_errors", "faults", "checks"),
    *("inspection", "identifiability", "collinear", "validation", "manoeuvres", "validation_checks", "tuning", "terms"),
)
# Beside the dataset, where users keep files of their own as well.
_PAGES = ("report", "identifiability", "inspection", "validation")
# As it stands in the head of a page, so many bytes from its beginning at most.
_GENERATOR, _HEAD = b'<meta name="generator" content="auvid ', 2000
_EXPORTS = (".yaml", ".json", ".py", ".m", ".sdf", ".mcap")
# Characters; no exported model comes near, and an MCAP says it at once.
_LONGEST_EXPORT = 10_000_000
# As it stands in the heading of an exported model, in its JSON, or at the beginning of a run's MCAP.
_EXPORTED_FROM = re.compile(r'dataset(?: with SHA-256 |_sha256": ")([0-9a-f]{64})\b')


@contextmanager
def damage_as_file_error(complaint: Callable[[str], str]) -> Iterator[None]:
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


def check_no_overlap(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
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


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other commands from writing into a results folder; the operating system ends the lock of a killed one.

    A step within a locked step of the same command enters the same lock.

    Raises
    ------
    FileError
        If another command still writes there after a moment, or the folder cannot be made.
    """
    from filelock import FileLock, Timeout

    # A group of users may share the folder.
    lock = FileLock(folder / ".lock", timeout=_LOCK_PATIENCE, mode=0o666, is_singleton=True)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # Some network disks have no locks.
        with suppress(NotImplementedError):
            lock.acquire()
    except Timeout:
        raise FileError(f"{folder}: another auvid command is writing here; wait for it, or give --output") from None
    except OSError as error:
        raise FileError(f"{folder}: cannot be written: {error.strerror or error}") from None
    try:
        yield
    finally:
        lock.release()


def folder_of_run(name: str) -> Path:
    """Return where the results of a run go, unless the user says otherwise."""
    return Path("results") / name


def folder_of_dataset(path: Path) -> Path:
    """Return the results folder of a dataset file: its own folder if it is one, else that of a run of its name."""
    return path.parent if path.name == "dataset.h5" else folder_of_run(path.stem)


def folder_of_estimate(path: Path) -> Path:
    """Return the results folder of an estimate file."""
    return path.parent.parent if path.parent.name == "estimates" else path.parent


def dataset_in(folder: Path) -> Path:
    """Return the path of a folder's dataset."""
    return folder / "dataset.h5"


def page_in(folder: Path) -> Path:
    """Return the path of a folder's page."""
    return folder / "report.html"


def estimates_in(folder: Path) -> dict[FilterName, Path]:
    """Return the estimates that are there, in the order of `FilterName`."""
    paths = {name: folder / "estimates" / f"{name.value}.h5" for name in FilterName}
    return {name: path for name, path in paths.items() if path.exists()}


def tables_and_figures(folder: Path) -> list[Path]:
    """Find those that auvid wrote into a folder, and its pages."""
    tables = [f"{name}.csv" for name in _TABLES] + ["tables.md", "tables.tex"]
    figures = _figures(folder, (*_REPORT_FIGURES, *_OTHER_FIGURES))
    pages = [path for path in (folder / f"{name}.html" for name in _PAGES) if is_page(path)]
    return [*(path for path in (folder / "tables" / name for name in tables) if path.exists()), *figures, *pages]


def is_page(path: Path) -> bool:
    """Say whether a file is a page that auvid made."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return _GENERATOR in file.read(_HEAD)


def products(folder: Path) -> list[Path]:
    """Find all that auvid made from a folder's dataset, and nothing that a user put there."""
    exports = [
        path for path in sorted((folder / "export").glob("*.*")) if path.suffix in _EXPORTS and exported_from(path)
    ]
    return [*estimates_in(folder).values(), *tables_and_figures(folder), *exports]


def exported_from(path: Path) -> str:
    """Return the SHA-256 of the dataset behind an exported model; empty if the file is no such thing."""
    if not path.is_file():
        return ""
    with path.open(encoding="utf-8", errors="replace") as file:
        match = _EXPORTED_FROM.search(file.read(_LONGEST_EXPORT))
    return match[1] if match else ""


def remove(paths: Iterable[Path]) -> None:
    """Take away results that are true no more."""
    for path in paths:
        path.unlink(missing_ok=True)


def remove_former(folder: Path, drawn: Collection[Path]) -> None:
    """Take away what earlier reports drew and the present one did not."""
    remove(path for path in _figures(folder, _REPORT_FIGURES) if path not in drawn)


def _figures(folder: Path, names: Iterable[str]) -> list[Path]:
    paths = [folder / "figures" / f"{name}.{kind}" for name in names for kind in FigureFormat]
    return [path for path in paths if path.exists()]
