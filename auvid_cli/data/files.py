"""Files and folders: atomic writes, temporary files, damaged files, the lock and the contents of a results folder."""

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

# The name of a temporary file contains the machine and the process that writes it.
_PREFIX = f".auvid-{hashlib.sha256(platform.node().encode()).hexdigest()[:8]}-"
_TEMPORARY = re.compile(rf"{re.escape(_PREFIX)}(\d{{1,9}})-[0-9a-f]{{16}}")
LOCK_PATIENCE = 1.0  # s
_REPORT_FIGURES = ("path", "estimates", "convergence", "motion_errors", "free_runs", "innovations")
_OTHER_FIGURES = (
    *("identifiability_bounds", "identifiability_correlation", "timeline"),
    *("validation_velocities", "validation_attitude", "validation_horizons"),
)
_TABLES = (
    *("coefficients", "summary", "table_iv", "velocity_error", "consistency", "sensor_errors", "faults", "checks"),
    *("inspection", "identifiability", "collinear", "validation", "manoeuvres", "validation_checks", "tuning", "terms"),
)
_PAGES = ("report", "identifiability", "inspection", "validation")
# Mark in the head of every page.
_GENERATOR = b'<meta name="generator" content="auvid '
_HEAD = 2000  # bytes that are searched for the mark
_EXPORTS = (".yaml", ".json", ".py", ".m", ".sdf", ".mcap")
_MAX_EXPORT = 10_000_000  # characters that are searched for the digest; an MCAP has it before that
# Digest of the dataset: in the heading of an exported model, in its JSON, or at the beginning of an MCAP.
_EXPORTED_FROM = re.compile(r'dataset(?: with SHA-256 |_sha256": ")([0-9a-f]{64})\b')


@contextmanager
def damage_as_file_error(message: Callable[[str], str]) -> Iterator[None]:
    """Turn any exception of a block, which should only call a library, into a FileError.

    Parameters
    ----------
    message : callable
        Returns the message from the reason that the library gives.
    """
    try:
        yield
    # Libraries raise any exception on damaged files: of unpacking, attributes, memory or SQLite, even Exception.
    except Exception as error:
        reason = one_line(str(error)).rstrip(".") or type(error).__name__
        if isinstance(error, MemoryError) or "out of memory" in reason:
            reason = "not enough memory, or the file is damaged"
        raise FileError(message(shortened(reason))) from error


@contextmanager
def _cannot(what: str, path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise FileError(f"{path}: cannot be {what}: {error.strerror or error}") from error


@contextmanager
def temporary_in(folder: Path, is_folder: bool = False) -> Iterator[Path]:
    """Create a file or folder in a folder, removed at the end of the block unless it has been moved.

    Temporary files of killed processes of this machine are removed first.
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
    """Remove temporary files and folders of processes that no longer run."""
    from psutil import pid_exists

    for path in folder.glob(f"{_PREFIX}*"):
        match = _TEMPORARY.fullmatch(path.name)
        if match and not pid_exists(int(match[1])):
            with suppress(OSError):
                _remove(path)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path that is renamed to `path` when the block ends without an error.

    If `path` is a link, the file behind it is replaced, and the link stays.

    Raises
    ------
    FileError
        If the file cannot be written, or `path` is a pipe, device or folder. The temporary file is removed, and an
        earlier file stays as it was.
    """
    with _cannot("written", path):
        target = _target_of(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        with temporary_in(target.parent) as temporary:
            yield temporary
            temporary.replace(target)


def _target_of(path: Path) -> Path:
    with suppress(FileNotFoundError):
        if not stat.S_ISREG(path.stat().st_mode):
            raise FileError(f"{path}: cannot be written: it is a folder, pipe or device, not a file")
    return path.resolve() if path.is_symlink() else path


def check_no_overlap(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Raise a FileError if an output is the same file as an input, even under another name."""
    read = {_identity(path): path for path in inputs if path.exists()}
    for output in outputs:
        if output.exists() and (path := read.get(_identity(output))) is not None:
            same = "" if path == output else f" as {path}"
            raise FileError(f"{output}: is an input{same}, and would be written over; name another place")


def _identity(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_dev, status.st_ino


def write_folder(folder: Path, texts: Mapping[str, str]) -> None:
    """Write a new folder of text files completely or not at all; an existing folder must be empty.

    Raises
    ------
    FileError
        If it cannot be written, is not empty, or is a file.
    """
    refuse_filled(folder)
    exists = folder.exists()
    place = folder if exists else folder.parent
    with _cannot("written", folder):
        place.mkdir(parents=True, exist_ok=True)
        with temporary_in(place, is_folder=True) as temporary:
            for name, text in texts.items():
                (temporary / name).write_text(text, encoding="utf-8")
            if exists:
                # It may be the working folder of a shell: keep it.
                for name in texts:
                    (temporary / name).rename(folder / name)
            else:
                temporary.rename(folder)


def refuse_filled(folder: Path) -> None:
    """Raise a FileError if a new folder is a file, is not empty, or cannot be read."""
    with _cannot("read", folder):
        if not folder.is_dir() and os.path.lexists(folder):
            raise FileError(f"{folder}: exists already, and is not a folder; name another place")
        if folder.is_dir():
            remove_abandoned(folder)
        if folder.is_dir() and any(folder.iterdir()):
            raise FileError(f"{folder}: exists already, and is not empty; name another place")


def write_text(path: Path, text: str) -> None:
    """Write a text file completely or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a results folder against other commands; the operating system removes the lock of a killed command.

    Raises
    ------
    FileError
        If another command is writing there, or the folder cannot be created.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(folder / ".lock", timeout=LOCK_PATIENCE)
    # Some network disks have no locks.
    with _cannot("written", folder), suppress(NotImplementedError):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire()
        except Timeout:
            raise FileError(f"{folder}: another auvid command is writing here; wait, or give --output") from None
    try:
        yield
    finally:
        lock.release()


def folder_of_run(name: str) -> Path:
    """Return the default results folder of a run."""
    return Path("results") / name


def folder_of_dataset(path: Path) -> Path:
    """Return the results folder of a dataset file: the folder of ``dataset.h5``, otherwise one named like the file."""
    return path.parent if path.name == "dataset.h5" else folder_of_run(path.stem)


def folder_of_estimate(path: Path) -> Path:
    """Return the results folder of an estimate file."""
    return path.parent.parent if path.parent.name == "estimates" else path.parent


def dataset_in(folder: Path) -> Path:
    """Return the path of the dataset of a results folder."""
    return folder / "dataset.h5"


def page_in(folder: Path) -> Path:
    """Return the path of the report page of a results folder."""
    return folder / "report.html"


def estimates_in(folder: Path) -> dict[FilterName, Path]:
    """Return the existing estimates, in the order of `FilterName`."""
    paths = {name: folder / "estimates" / f"{name.value}.h5" for name in FilterName}
    return {name: path for name, path in paths.items() if os.path.lexists(path)}


def tables_and_figures(folder: Path) -> list[Path]:
    """Return the existing tables, figures and pages of auvid in a folder."""
    tables = [f"{name}.csv" for name in _TABLES] + ["tables.md", "tables.tex"]
    figures = _figures(folder, (*_REPORT_FIGURES, *_OTHER_FIGURES))
    pages = [path for path in (folder / f"{name}.html" for name in _PAGES) if is_page(path)]
    return [*(path for path in (folder / "tables" / name for name in tables) if path.exists()), *figures, *pages]


def is_page(path: Path) -> bool:
    """Whether a file is a page of auvid."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return _GENERATOR in file.read(_HEAD)


def products(folder: Path) -> list[Path]:
    """Return all files that auvid made from the dataset of a folder, and no files of the user."""
    exports = [
        path for path in sorted((folder / "export").glob("*.*")) if path.suffix in _EXPORTS and exported_from(path)
    ]
    return [*estimates_in(folder).values(), *tables_and_figures(folder), *exports]


def exported_from(path: Path) -> str:
    """Return the SHA-256 of the dataset of an exported model; empty for any other file."""
    if not path.is_file():
        return ""
    with path.open(encoding="utf-8", errors="replace") as file:
        match = _EXPORTED_FROM.search(file.read(_MAX_EXPORT))
    return match[1] if match else ""


def remove(paths: Iterable[Path]) -> None:
    """Remove outdated results."""
    for path in paths:
        path.unlink(missing_ok=True)


def remove_former(folder: Path, drawn: Collection[Path]) -> None:
    """Remove figures of earlier reports that are not in `drawn`."""
    remove(path for path in _figures(folder, _REPORT_FIGURES) if path not in drawn)


def _figures(folder: Path, names: Iterable[str]) -> list[Path]:
    paths = [folder / "figures" / f"{name}.{kind}" for name in names for kind in FigureFormat]
    return [path for path in paths if path.exists()]
