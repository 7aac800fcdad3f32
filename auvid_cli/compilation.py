"""Ahead-of-use compilation of the numerical core, kept on disk from one session to the next.

numba judges a cached function by the time stamp and size of its own file. It does not see that a
function compiled into it has changed in another file, and installers give all files one time stamp, so
after an upgrade it could run yesterday's physics. The cache therefore lives in a folder named after the
content of every part of the package that has compiled functions, or constants of theirs.
"""

import atexit
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import platformdirs
from numba import njit
from numba.core import config
from numba.core.event import Event, Listener, install_listener

from auvid_cli.children import parentage

CORE = "vehicle", "simulation", "filters", "identification", "blocks.py", "compilation.py"
_KEPT = 5
# An interrupt at the terminal ends it at once; the process that started it says so.
_IMPORT_ALL = """
import importlib, signal, sys
from auvid_cli.children import end_with_parent
end_with_parent()
signal.signal(signal.SIGINT, signal.SIG_DFL)
for module in sys.argv[1:]:
    importlib.import_module(module)
"""


def compiled(
    *signature: Any, reassociate: bool = False, inline: bool = False, internal: bool = False
) -> Callable[[Callable], Any]:
    """Decorator: compile for exactly this signature, now, or take the machine code from the cache.

    Parameters
    ----------
    *signature : numba signature
    reassociate : bool
        Whether sums may be reordered, which vectorises dot products. It would cancel the range reduction
        of a sine, so only linear algebra asks for it; fused multiply-add is always allowed.
    inline : bool
        Whether to insist on inlining: handing over a tuple of many arrays costs as much as a short function.
    internal : bool
        Whether only compiled functions call it, as they do those that are inlined: a door for Python takes a while to
        compile.

    Notes
    -----
    Compiled functions release the interpreter lock, and division by zero yields infinity, as in NumPy. They make no
    arrays but slices of their arguments, which then carry no reference count: its atomic increments were an eighth of
    a filter's time, and what makes and assigns whole arrays takes long to compile.
    """
    options = {
        "cache": True,
        "nogil": True,
        "error_model": "numpy",
        "fastmath": {"contract", "reassoc"} if reassociate else {"contract"},
        "forceinline": inline,
        "no_cpython_wrapper": inline or internal,
        "no_cfunc_wrapper": inline or internal,
        # numba has no public name for it.
        "_nrt": False,
    }

    def decorate(function: Callable) -> Any:
        settings = config.__dict__
        before, settings["CACHE_DIR"] = settings["CACHE_DIR"], str(_cache_folder())
        try:
            return njit(*signature, **options)(function)
        finally:
            settings["CACHE_DIR"] = before

    return decorate


def is_compiled(module: str) -> bool:
    """Whether the cache has something of a module, and so of all that it needs, which is compiled before."""
    return any(_cache_folder().glob(f"*/{module.rpartition('.')[2]}.*.nbc"))


class _Told(Listener):
    """Calls a function when numba begins to compile something, whatever else it then does."""

    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell = tell

    def on_start(self, event: Event) -> None:
        self._tell()

    def on_end(self, event: Event) -> None:
        pass


@contextmanager
def told_of_compilation(tell: Callable[[], None]) -> Iterator[None]:
    """Call a function whenever something is compiled, and not taken from the cache, within a block."""
    with install_listener("numba:compile", _Told(tell)):
        yield


def compile_elsewhere(*modules: str) -> subprocess.Popen:
    """Begin to compile modules into the cache in another process.

    Where that fails this process finds nothing there, compiles for itself, and says what is wrong.
    """
    command = [sys.executable, "-P", "-c", _IMPORT_ALL, *modules]
    # This very package, wherever it was found.
    path = os.pathsep.join(filter(None, [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH")]))
    cache = str(_cache_folder().parent)
    environment = os.environ | {"NUMBA_CACHE_DIR": cache, "PYTHONPATH": path} | parentage()
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, env=environment)


@cache
def _cache_folder() -> Path:
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
    siblings = sorted((p for p in folder.parent.iterdir() if len(p.name) == 16), key=lambda p: p.stat().st_mtime)
    for outdated in siblings[:-_KEPT]:
        shutil.rmtree(outdated, ignore_errors=True)
    return folder
