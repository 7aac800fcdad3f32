"""Machine code kept on disk from one session to the next, each file with a digest: what is damaged is never run.

numba judges a cached function by the time stamp and size of its own file. It does not see that a
function compiled into it has changed in another file, and installers give all files one time stamp, so
after an upgrade it could run yesterday's physics. The cache therefore lives in a folder named after the
content of every part of the package that has compiled functions, or constants of theirs.
"""

import atexit
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import platformdirs
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, UserProvidedCacheLocator
from numba.core.event import Event, EventStatus, broadcast

CORE = (
    "vehicle",
    "simulation",
    "filters",
    "identification",
    "design",
    "config/extra_states.py",
    "angles.py",
    "lanes.py",
    "compilation.py",
    "code_cache.py",
    "code_library.py",
)
DAMAGED = "auvid:damaged"
"""Kind of the event that something in the cache turned out to be damaged."""
_KEPT = 5


class CodeCache(FunctionCache):
    """Cache of one function.

    Parameters
    ----------
    function : callable
        What is to be compiled.
    """

    def __init__(self, function: Callable) -> None:
        self._impl_class = _Named
        super().__init__(function)
        self._cache_file = _SealedFiles(
            self.cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep machine code, where there is room and leave to: else this session works with what it has compiled."""
        with suppress(OSError):
            super().save_overload(sig, data)


class _Locator(UserProvidedCacheLocator):
    """The folder of the package as it is now, whether or not it can be written."""

    def __init__(self, py_func: Callable, py_file: str) -> None:
        super().__init__(py_func, py_file)
        self._cache_path = str(cache_folder() / self.get_suitable_cache_subpath(py_file))

    @classmethod
    def from_function(cls, py_func: Callable, py_file: str) -> "_Locator":
        return cls(py_func, py_file)

    def get_source_stamp(self) -> bytes:
        # The name of the folder says it all.
        return b""


class _Named(CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _SealedFiles(IndexDataCacheFile):
    """Index and machine code of a function, each file with the digest of its content at its end."""

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        content = BytesIO()
        yield content
        with super()._open_for_write(filepath) as file:
            # What reads a pickle does not mind what follows it.
            file.write(content.getvalue() + _digest(content.getvalue()))

    def _load_index(self) -> dict[Any, str]:
        return super()._load_index() if _is_sound(Path(self._index_path)) else {}

    def _load_data(self, name: str) -> Any:
        path = Path(self._data_path(name))
        if not _is_sound(path):
            # To numba a file that went missing, which it compiles anew and writes over.
            raise FileNotFoundError(path)
        return super()._load_data(name)


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(content).digest()


def _is_sound(path: Path) -> bool:
    """Say whether a file of the cache is there as it was written; if not, take it away and tell whoever listens."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return False
    except OSError:
        content = b""
    size = hashlib.sha256().digest_size
    if len(content) > size and content[-size:] == _digest(content[:-size]):
        return True
    with suppress(OSError):
        path.unlink()
    broadcast(Event(DAMAGED, EventStatus.START, data={"path": path}))
    return False


@cache
def cache_folder() -> Path:
    """Return the folder of the machine code of this package as it is now; made if it is not there."""
    content = hashlib.sha256()
    package = Path(__file__).parent
    for path in sorted(path for part in CORE for path in [package / part, *(package / part).glob("*.py")]):
        if path.is_file():
            content.update(path.read_bytes())
    base = Path(os.environ.get("NUMBA_CACHE_DIR") or platformdirs.user_cache_path("auvid"))
    folder = base / content.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
    except OSError:
        # No home to write to (a service account, a read-only container): compile for this session only, in a
        # folder that nobody else could have filled with machine code of theirs.
        base = Path(tempfile.mkdtemp(prefix="auvid-"))
        atexit.register(shutil.rmtree, base, ignore_errors=True)
        folder = base / folder.name
        folder.mkdir()
    # Another command may be clearing away the same.
    with suppress(FileNotFoundError):
        siblings = sorted((p for p in folder.parent.iterdir() if len(p.name) == 16), key=lambda p: p.stat().st_mtime)
        for outdated in siblings[:-_KEPT]:
            shutil.rmtree(outdated, ignore_errors=True)
    return folder
