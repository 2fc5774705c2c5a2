"""Code of helpers: optimised and translated to machine code only as a part of the kernels that call them.

numba optimises each function together with its callees, and makes machine code of it. A helper deep in a
kernel would be optimised again for each of its callers, and its own machine code would never run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class HelperCode(JITCodeLibrary):
    """LLVM code of a helper, to which callers link."""

    @property
    def codegen(self) -> HelperCode:
        """The object by which numba sets environments of functions."""
        return self

    def set_env(self, name: str, environment: object) -> None:
        """Set no environment: only functions that handle Python objects need one."""

    def _optimize_final_module(self) -> None:
        """Leave the optimisation to the callers."""

    def _finalize_final_module(self) -> None:
        """Make no machine code."""
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True


class HelperCompiler(Compiler):
    """numba's compiler, for helpers."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Return the compiled helper."""
        codegen: Any = self.state.targetctx.codegen()
        self.state.library = HelperCode(codegen, func.__qualname__)  # type: ignore[no-untyped-call]
        return super().compile_extra(func)  # type: ignore[no-untyped-call]
