"""Compiled functions, their cache on disk, and the layout of the arrays that they work on.

Many states are laid out side by side. A block is a flat vector of rows, one row per quantity and `LANES` states to a
row, so that one instruction works on several states.

numba compares the time stamp of a cached function with that of its own file. It does not notice a change in another
file whose functions were compiled into it, and installers give all files one time stamp. The cache therefore lives in
a folder that is named by the content of the core: after an upgrade no old machine code runs.
"""

import atexit
import gc
import hashlib
import os
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray

from auvid_cli.child_processes import Workers
from auvid_cli.errors import ConfigError

_CPU_FEATURES = os.environ.get("NUMBA_CPU_FEATURES", "")
if not all(feature.startswith(("+", "-")) for feature in filter(None, _CPU_FEATURES.split(","))):
    # The compiler would abort the process.
    raise ConfigError(f"environment variable NUMBA_CPU_FEATURES: {_CPU_FEATURES}; expected +NAME,-NAME,...")
try:
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "Environment variable", RuntimeWarning)
        import numba
        from numba import config
        from numba import types as types
        from numba.core import event as compiler_event  # documented as "Event API"
except Exception as _error:
    # Invalid values raise exceptions of any class in numba.
    if _names := sorted(name for name in os.environ if name.startswith("NUMBA_")):
        _reason = str(_error).splitlines()[0].rstrip(".")
        raise ConfigError(f"environment: {_reason}; correct or unset {', '.join(_names)}") from None
    raise

LANES = 64  # states per row of a block
LINE = 64  # bytes of a cache line, the length of the longest vector registers

CORE = (
    "vehicle",
    "simulation",
    "filters",
    "identification",
    "design",
    "config/extra_states.py",
    "data/faults.py",
    "arrays.py",
    "numerics.py",
)
"""Folders and modules of the package with compiled functions, or with constants that these use."""
FOLDERS_KEPT = 5  # versions of the core in the cache
OLDEST_NUMBA = (0, 61)
FIRST_UNTESTED_NUMBA = (0, 69)
_SETTINGS: Any = config  # settings of numba; `Any`, because numba makes their attributes when it is loaded


def check_numba(version: str = numba.__version__) -> None:
    """Raise an error if the core is not tested with a version of numba.

    Raises
    ------
    ImportError
        If the version is too old or too new.
    """
    major, minor = (int(part) for part in version.split(".")[:2])
    if not OLDEST_NUMBA <= (major, minor) < FIRST_UNTESTED_NUMBA:
        oldest, untested = (".".join(map(str, bound)) for bound in (OLDEST_NUMBA, FIRST_UNTESTED_NUMBA))
        raise ImportError(f'numba {version} is not supported; install "numba>={oldest},<{untested}"', name="numba")


check_numba()


def zeros_on_lines(*shape: int) -> NDArray[np.float64]:
    """Return an array of zeros that begins at a cache line, so that no vector register needs two lines."""
    size = int(np.prod(shape))
    spare = np.zeros(size + LINE // 8)
    begin = -spare.ctypes.data % LINE // 8
    return spare[begin : begin + size].reshape(shape)


@cache
def cache_folder() -> Path:
    """Return the cache folder of the present version of the core; create it if missing."""
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
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        # Without a writable home (a service account, a read-only container), compile for this session only, in a
        # folder that no other user can fill with machine code.
        base = Path(tempfile.mkdtemp(prefix="auvid-"))
        atexit.register(shutil.rmtree, base, ignore_errors=True)
        folder = base / folder.name
        folder.mkdir()
    # Another command may remove the same folders.
    with suppress(FileNotFoundError):
        siblings = sorted((p for p in folder.parent.iterdir() if len(p.name) == 16), key=lambda p: p.stat().st_mtime)
        for outdated in siblings[:-FOLDERS_KEPT]:
            shutil.rmtree(outdated, ignore_errors=True)
    return folder


def compiled(signature: Any = None, *, reassociate: bool = False, inline: bool = False) -> Callable[[Callable], Any]:
    """Return a decorator that compiles a function.

    Parameters
    ----------
    signature : numba signature, optional
        Compile for these types at once, or load the machine code from the cache. Without one, only compiled functions
        may call the function: it is compiled with the first caller, and is part of the machine code of each.
    reassociate : bool
        Whether sums may be reordered, which vectorises dot products. Only linear algebra uses this, because
        reordering makes the range reduction of a sine wrong. Fused multiply-add is always allowed.
    inline : bool
        Whether to force inlining: passing a tuple of many arrays costs as much as a short function.

    Notes
    -----
    Compiled functions release the interpreter lock. Division by zero yields infinity, as in NumPy.
    """
    options: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": {"contract", "reassoc"} if reassociate else {"contract"},
        "forceinline": inline,
        # No reference counts for arrays, because no function of the core creates or keeps an array. With them, a CKF
        # takes a quarter more processor time, and a smoother a tenth.
        "_nrt": False,
    }
    if signature is None:
        # Leave out the wrappers for calls from Python and C: they take a fifth of the compilation time.
        options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        return numba.njit(**options)

    def decorate(function: Callable) -> Any:
        elsewhere, _SETTINGS.CACHE_DIR = _SETTINGS.CACHE_DIR, str(cache_folder())
        try:
            return numba.njit(signature, cache=True, **options)(function)
        except Exception:
            # A damaged cache file may raise any exception. Remove it, and compile without the cache in this session.
            for path in cache_folder().glob(f"*/{Path(function.__code__.co_filename).stem}.{function.__qualname__}-*"):
                path.unlink(missing_ok=True)
            return numba.njit(signature, **options)(function)
        finally:
            _SETTINGS.CACHE_DIR = elsewhere

    return decorate


def is_compiled(module: str) -> bool:
    """Return whether the cache holds functions of a module, and so of all modules that it imports."""
    return any(cache_folder().glob(f"*/{module.rpartition('.')[2]}.*.nbc"))


class _OnStart(compiler_event.Listener):
    """Calls a function when an event starts."""

    def __init__(self, call: Callable[[], None]) -> None:
        self._call = call

    def on_start(self, event: compiler_event.Event) -> None:
        self._call()

    def on_end(self, event: compiler_event.Event) -> None:
        pass


@contextmanager
def on_compilation(call: Callable[[], None]) -> Iterator[None]:
    """Call a function whenever a function is compiled within a block."""
    with compiler_event.install_listener("numba:compile", _OnStart(call)):
        yield


@contextmanager
def compile_elsewhere(*modules: str) -> Iterator[Future[None]]:
    """Compile modules into the cache in another process, which ends with the block.

    Yields
    ------
    concurrent.futures.Future
        Done after the compilation. If that fails, this process compiles the modules itself and reports the error.
    """
    with Workers(1) as worker:
        yield worker.submit(_import_modules, modules, str(cache_folder().parent))


def _import_modules(modules: Iterable[str], cache: str) -> None:
    os.environ["NUMBA_CACHE_DIR"] = cache
    gc.set_threshold(50_000)
    for module in modules:
        import_module(module)
