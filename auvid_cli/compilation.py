"""Ahead-of-use compilation of the numerical core, kept on disk from one session to the next."""

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba import njit, types
from numba.core.event import Event, Listener, install_listener
from numba.core.typeinfer import register_dispatcher
from numba.extending import intrinsic

from auvid_cli.child_processes import start_python
from auvid_cli.code_cache import DAMAGED, CodeCache, cache_folder
from auvid_cli.code_library import ApartCompiler, CompilerFlags, PartCompiler, WholeCompiler, stay_apart
from auvid_cli.lanes import LINE

_IMPORT_ALL = """
import gc, importlib, sys
from auvid_cli.child_processes import end_with_parent
end_with_parent()
gc.set_threshold(50_000)
for module in sys.argv[1:]:
    importlib.import_module(module)
"""


def _without_aliases(flags: Any) -> Any:
    """Have a function compiled for arrays that share nothing which it writes; numba has no option for it."""
    flags = CompilerFlags(flags)
    flags.noalias = True
    return flags


def compiled(
    signature: Any,
    *,
    reassociate: bool = False,
    inline: bool = False,
    internal: bool = False,
    apart: bool = False,
    pointer: bool = False,
) -> Callable[[Callable], Any]:
    """Decorate a function: compile for exactly this signature, now, or take the machine code from the cache.

    What only compiled functions call is read with the first of them, and optimised and kept inside each.

    Parameters
    ----------
    signature : numba signature
    reassociate : bool
        Whether sums may be reordered, which vectorises dot products. It would cancel the range reduction
        of a sine, so only linear algebra asks for it; fused multiply-add is always allowed.
    inline : bool
        Whether to insist on inlining: handing over a tuple of many arrays costs as much as a short function.
    internal : bool
        Whether only compiled functions call it, as they do those that are inlined: it then has no machine code of its
        own, nor a door for Python, which both take a while to compile.
    apart : bool
        Whether compiled functions call it where it is: they do not take it in, which takes a while for each of them.
    pointer : bool
        Whether it is handed to compiled functions.

    Notes
    -----
    What a function writes to one array it must not read or write through another: arguments may not overlap there. The
    compiler counts on it, so that nothing has to be looked up again after every store; who hands over the same numbers
    twice gets any result. Parts of one array that do not overlap are fine, and so is what is only read.

    Compiled functions release the interpreter lock, and division by zero yields infinity, as in NumPy. They make no
    arrays but slices of their arguments, which then carry no reference count: its atomic increments were an eighth of
    a filter's time, and what makes and assigns whole arrays takes long to compile.
    """
    is_part = inline or internal
    options = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": {"contract", "reassoc"} if reassociate else {"contract"},
        "forceinline": inline,
        "no_cpython_wrapper": is_part,
        "no_cfunc_wrapper": not pointer,
        # numba has no public name for it.
        "_nrt": False,
    }

    def decorate(function: Callable) -> Any:
        compiler = PartCompiler if is_part else ApartCompiler if apart else WholeCompiler
        dispatcher: Any = njit(**options, pipeline_class=compiler)(function)
        if dispatcher is function:
            # numba is told to compile nothing.
            return function
        dispatcher._compiler._customize_flags = _without_aliases
        if is_part:
            _compile_when_asked(dispatcher, signature)
            return dispatcher
        # Its own cache would run whatever stands in the files; this and the rest is what `njit` does itself.
        dispatcher._cache = CodeCache(function)
        _compile(dispatcher, signature)
        if apart:
            for result in dispatcher.overloads.values():
                stay_apart(result.library)
        return dispatcher

    return decorate


def _compile(dispatcher: Any, signature: Any) -> None:
    with register_dispatcher(dispatcher):
        dispatcher.compile(signature)
    dispatcher.disable_compile()


def _compile_when_asked(dispatcher: Any, signature: Any) -> None:
    """Compile a function as soon as one that calls it is compiled: out of the cache that has it inside."""
    of_call = dispatcher.get_call_template

    def compiled_first(*argument_types: Any) -> Any:
        dispatcher.get_call_template = of_call
        _compile(dispatcher, signature)
        return of_call(*argument_types)

    dispatcher.get_call_template = compiled_first


@intrinsic
def align_stack(typing_context: Any) -> tuple[Any, Callable]:
    """Have the compiled function that calls it begin its stack at a cache line.

    What a long loop cannot hold in registers it keeps there, as whole vectors; three times of four they would else
    straddle two lines, each of which is then read.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        attributes = builder.function.attributes
        # llvmlite writes down an alignment beside another attribute only; numba's functions never unwind.
        attributes.add("nounwind")
        attributes.alignstack = LINE
        return context.get_dummy_value()

    return types.void(), generate


def is_compiled(module: str) -> bool:
    """Say whether the cache has something of a module, and so of all that it needs, which is compiled before."""
    return any(cache_folder().glob(f"*/{module.rpartition('.')[2]}.*.nbc"))


class _OnStart(Listener):
    """Calls a function when something begins, such as compiling, whatever else then happens."""

    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell = tell

    def on_start(self, event: Event) -> None:
        self._tell()

    def on_end(self, event: Event) -> None:
        pass


@contextmanager
def on_compilation(tell: Callable[[], None], tell_of_damage: Callable[[], None]) -> Iterator[None]:
    """Call a function whenever something is compiled within a block, and another if its cache is damaged."""
    with install_listener("numba:compile", _OnStart(tell)), install_listener(DAMAGED, _OnStart(tell_of_damage)):
        yield


def compile_elsewhere(*modules: str) -> subprocess.Popen:
    """Begin to compile modules into the cache in another process.

    Where that fails this process finds nothing there, compiles for itself, and says what is wrong.
    """
    return start_python("-c", _IMPORT_ALL, *modules, environment={"NUMBA_CACHE_DIR": str(cache_folder().parent)})
