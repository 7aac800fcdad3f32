"""What LLVM makes of compiled functions: each is optimised once, with all that it calls inside it.

numba would optimise a function by itself, then with what it calls, and make machine code of it, and then do all of that
again inside each function that calls it: a fifth of the time that compiling takes, for code that is no faster.
"""

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.runtime.nrt import rtsys


class _Whole(JITCodeLibrary):
    """Of a function with machine code of its own."""

    def add_linking_library(self, library: Any) -> None:
        """Take in what the function calls; there are no references to count."""
        if library is not rtsys.library:
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


class WholeCompiler(Compiler):
    """Compiles functions with machine code of their own."""

    library = _Whole

    def define_pipelines(self) -> list:
        """Return the stages of numba's own compiler, which work on our library."""
        state = self.state
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().define_pipelines()


class PartCompiler(WholeCompiler):
    """Compiles functions that only compiled ones call."""

    library = _Part
