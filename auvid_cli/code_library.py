"""How functions are compiled: in few stages, and each is optimised once, with all that it calls inside it.

numba would optimise a function by itself, then with what it calls, and make machine code of it, and then do all of that
again inside each function that calls it: a third of the time that compiling takes, for code that is no faster.
"""

from collections.abc import Mapping
from typing import Any, ClassVar
from weakref import WeakSet

from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, Flags
from numba.core.compiler_machinery import PassManager
from numba.core.runtime.nrt import rtsys
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NativeLowering, NoPythonBackend, NopythonTypeInference, PreLowerStripPhis
from numba.core.untyped_passes import (
    FixupArgs,
    GenericRewrites,
    IRProcessing,
    ReconstructSSA,
    TranslateByteCode,
)

# The others look for what the core does not use (closures, `with`, raising, inlining by numba itself) or describe what
# was done: a tenth of the time, and the machine code is the same.
_STAGES = (
    TranslateByteCode,
    FixupArgs,
    IRProcessing,
    GenericRewrites,
    ReconstructSSA,
    NopythonTypeInference,
    PreLowerStripPhis,
    NativeLowering,
    NoPythonBackend,
)


class CompilerFlags(Flags):
    """Settings of a function: numba compares them at every operation, here only those that are set."""

    def get_mangle_string(self) -> str:
        """Return their part of the name of machine code: none of the sets, whose order differs between processes."""
        return "auvid"

    def __hash__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, CompilerFlags) and self._values == other._values)


class _TypingContext:
    """numba's, which remembers what came of an operation on some types: else all of that name is tried each time."""

    _found: ClassVar[dict[Any, Any]] = {}

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, function: Any, arguments: tuple[Any, ...], keywords: Mapping[str, Any]) -> Any:
        """Return the signature that a function, an operator for example, has for some arguments."""
        if isinstance(function, types.Type) and not isinstance(function, types.BaseFunction):
            return self._context.resolve_function_type(function, arguments, keywords)
        # What numba has written in Python it compiles with the settings of who calls it.
        key = function, tuple(arguments), tuple(keywords.items()), ConfigStack.top_or_none()
        if key not in self._found:
            self._found[key] = self._context.resolve_function_type(function, arguments, keywords)
        return self._found[key]


class _Whole(JITCodeLibrary):
    """Of a function with machine code of its own."""

    def add_linking_library(self, library: Any) -> None:
        """Take in what the function calls, unless it stays apart; there are no references to count."""
        if library in _APART:
            library._ensure_finalized()
        elif library is not rtsys.library:
            super().add_linking_library(library)

    def _optimize_functions(self, ll_module: Any) -> None:
        # As numba does it, without its passes.
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


class _Part(_Whole):
    """Of a function that only compiled ones call: as it was written, for these to take in."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    @property
    def codegen(self) -> Any:
        """Return whom numba hands the environment of machine code that Python calls: none of it is needed."""
        return self

    def set_env(self, env_name: str, env: Any) -> None:
        """Leave it."""


_APART = WeakSet[JITCodeLibrary]()


def stay_apart(library: JITCodeLibrary) -> None:
    """Have what is compiled from now on call a function where it is, instead of taking it in."""
    _APART.add(library)


class WholeCompiler(CompilerBase):
    """Compiles functions with machine code of their own."""

    library = _Whole

    def define_pipelines(self) -> list[PassManager]:
        """Return the stages of compiling, which work on our library."""
        state = self.state
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.typingctx = _TypingContext(state.typingctx)
        manager = PassManager("compiled")
        for stage in _STAGES:
            manager.add_pass(stage, stage.__name__)
        manager.finalize()
        return [manager]


class PartCompiler(WholeCompiler):
    """Compiles functions that only compiled ones call."""

    library = _Part


class ApartCompiler(WholeCompiler):
    """Compiles functions that others call where they are, by a name which is the same in every process."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the stages of compiling."""
        self.state.func_id.unique_id = 0
        return super().define_pipelines()
