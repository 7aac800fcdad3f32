"""A results folder: what auvid writes there, and nothing that a user put there."""

import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from auvid_cli.config.figure_format import FigureFormat
from auvid_cli.config.filter_name import FilterName
from auvid_cli.errors import FileError

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
