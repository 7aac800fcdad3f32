"""How functions are compiled: in few stages, and each is optimised once, with all that it calls inside it.

numba would optimise a function by itself, then with what it calls, and make machine code of it, and then do all of that
again inside each function that calls it: a third of the time that compiling takes, for code that is no faster.
"""

from typing import Any
from weakref import WeakSet

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, Flags
from numba.core.compiler_machinery import PassManager
from numba.core.runtime.nrt import rtsys
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
