"""Compilation of kernels: once per machine and source version, cached on disk, replaceable.

``kernel`` marks a helper that other kernels call, ``inlined`` a helper that is compiled into its callers,
``allocating`` the only type of kernel that may make arrays. ``exchangeable(signature)`` marks a kernel that
is passed to another kernel as an argument (a formulation, a chart, an integrator). An exchangeable kernel is
compiled at first use, and the kernels that receive it need not be compiled again.  With NUMBA_DISABLE_JIT=1
all of these decorators return the plain Python function.

The cache lives in a folder named after a hash of the sources that have kernels, because numba does not
notice an edit in a kernel that another file's kernel calls.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import sys
import types as types_of_python
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import cfunc, f8, i8, njit, types, u4
from numba.core.typing import Signature

from mbref.kernels.disk_cache import (
    begin,
    cached_in,
    files_of,
    is_writable,
    record_files,
    remove_damaged,
)
from mbref.kernels.file_lock import held, is_held
from mbref.kernels.helper_code import HelperCompiler
from mbref.kernels.interrupts import interrupts_kept
from mbref.kernels.less_overhead import compare_options_as_dictionaries, garbage_kept

# No fastmath: the same bits with and without the JIT.  Without numba's runtime (``_nrt``, undocumented there)
# no kernel can allocate, and none counts references to its arrays, which takes time.
OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "_nrt": False}
# Only kernels call helpers: wrappers for calls from Python and C would take a sixth of the compilation.
NO_WRAPPERS: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
CONFIG: Any = numba.config  # numba creates the names of this module when it is imported
PLAIN = bool(CONFIG.DISABLE_JIT)
Function = Callable[..., Any]
_method = ContextVar("method", default="")  # whose kernels are prepared

VECTOR = types.Array(f8, 1, "C")
MATRIX = types.Array(f8, 2, "C")
INDICES = types.Array(i8, 1, "C")
UNSIGNED = types.Array(u4, 1, "C")
INDEX_TABLE = types.Array(i8, 2, "C")
FLOAT = f8
INT = i8
BOOLEAN = types.boolean

WITH_KERNELS = (
    "kernels", "linear_algebra", "equations", "formulations", "stabilisation", "integrators", "stepping",
    "taylor",
)  # fmt: skip


def _source_hash() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for folder in WITH_KERNELS:
        for path in sorted((Path(__file__).parents[1] / folder).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_root() -> Path:
    default = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mbref"
    return Path(os.environ.get("NUMBA_CACHE_DIR") or default)


CACHE = _cache_root() / f"kernels-{_source_hash()}"


def kernel(function: Function) -> Function:
    """Return a compiled helper, callable from kernels and from Python."""
    return _compiled(function)


def inlined(function: Function) -> Function:
    """Return a kernel that is compiled into each of its callers, since calls would take half of the time of
    an evaluation.

    Each caller compiles the inlined kernel again, so that inlined kernels that call each other take long to
    compile.
    """
    return _compiled(function, forceinline=True)


def allocating(function: Function) -> Function:
    """Return a kernel that allocates memory, such as a call of numpy's decompositions."""
    return _compiled(function, _nrt=True)


def _compiled(function: Function, **options: Any) -> Function:
    return function if PLAIN else Helper(function, {**OPTIONS, "cache": False, **options})


class Helper:
    """A kernel that other kernels call; numba's dispatcher is made when a caller is compiled.

    A run from the cache needs few of several hundred helpers, and dispatchers of all would take 0.1 s.
    Helpers are not stored on disk: numba cannot read the index of a helper that was compiled for a type of
    another program if the program's module is missing.
    """

    def __init__(self, function: Function, options: dict[str, Any]):
        self.function, self._options = function, options
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: object) -> object:
        return self._callable(*arguments)

    @property
    def _numba_type_(self) -> types.Type:
        """Return the type by which numba compiles calls of this kernel."""
        return self._called._numba_type_

    @functools.cached_property
    def _called(self) -> Any:
        """Return the dispatcher for calls from kernels."""
        return njit(pipeline_class=HelperCompiler, **self._options, **NO_WRAPPERS)(self.function)

    @functools.cached_property
    def _callable(self) -> Any:
        """Return the dispatcher for calls from Python, as tests and benchmarks make them."""
        return njit(**self._options)(self.function)


class Exchangeable:
    """A kernel of fixed signature that other kernels receive as an argument; ``pointer`` compiles it."""

    def __init__(self, function: Function, signature: Signature):
        self.function, self.signature = function, signature

    @functools.cached_property
    def pointer(self) -> Function:
        """Return the function that kernels receive: the compiled function, or the plain Python function
        without the JIT."""
        if PLAIN:
            return self.function
        if not is_writable(CACHE):
            _begin_compiling(_method.get())
            return self._compile(cache=False)
        begin(CACHE)
        remove_damaged(CACHE, self.function)
        with contextlib.nullcontext() if self.is_kept else held(self._lock):
            if not self.is_kept:
                _begin_compiling(_method.get())
            compiled = self._compile()
            if not self._is_loaded(compiled):
                record_files(CACHE)
        return compiled

    def prepare(self) -> None:
        """Compile now, or load from the cache; wait if another process compiles the kernel."""
        self.pointer  # noqa: B018

    @property
    def is_compiled_elsewhere(self) -> bool:
        """Return whether another process compiles the kernel now, which this process does not have yet."""
        return "pointer" not in vars(self) and is_held(self._lock)

    @property
    def _lock(self) -> Path:
        """Return the file whose lock the process holds that compiles the kernel."""
        return CACHE / "locks" / f"{self.function.__module__}.{self.function.__qualname__}"

    @functools.cached_property
    def callable(self) -> Entry:
        """Return the kernel as a function that Python calls with arrays.

        The function is compiled from a renamed copy, because numba's cache distinguishes functions by name
        and signature only.
        """
        f = self.function
        copy = types_of_python.FunctionType(f.__code__, f.__globals__, f"{f.__name__}_entry")
        copy.__module__, copy.__qualname__ = f.__module__, f"{f.__qualname__}_entry"
        return Entry(copy, self.signature)

    def _compile(self, **options: Any) -> Function:
        """Return the compiled function, loaded if the cache has it."""
        with cached_in(CACHE), interrupts_kept():
            return self._decorator(**{**OPTIONS, **options})(self.function)

    def _decorator(self, **options: Any) -> Function:
        return cfunc(self.signature, **options)

    def _is_loaded(self, compiled: Any) -> bool:
        """Return whether the compiled function comes from the cache."""
        return bool(compiled.cache_hits)

    @property
    def is_kept(self) -> bool:
        """Return whether the cache of this machine has the compiled kernel, or no compilation is needed."""
        return PLAIN or any(path.suffix == ".nbc" for path in files_of(CACHE, self.function))


class Entry(Exchangeable):
    """A kernel that Python calls: explicit signature, compiled at first use."""

    def __call__(self, *arguments: object) -> Any:
        return self.pointer(*arguments)

    def _decorator(self, **options: Any) -> Function:
        wrapped: dict[str, Any] = {**options, "no_cfunc_wrapper": True}  # Python calls no C function
        return njit(self.signature, **wrapped)

    def _is_loaded(self, compiled: Any) -> bool:
        return bool(compiled.stats.cache_hits)


def exchangeable(signature: Signature) -> Callable[[Function], Exchangeable]:
    """Return a decorator for kernels that are passed to other kernels."""
    return lambda function: Exchangeable(function, signature)


def entry(signature: Signature) -> Callable[[Function], Entry]:
    """Return a decorator for kernels that Python calls. Plain Python has no warnings of overflow either."""
    return lambda function: Entry(np.errstate(all="ignore")(function) if PLAIN else function, signature)


def prepare_all(kernels: Sequence[Exchangeable], method: str = "") -> None:
    """Compile the kernels of a method, or load them from the cache.

    Kernels that another process compiles come last, so that processes with different orders share the work.
    """
    elsewhere, before = [], _method.set(method)
    try:
        with garbage_kept():
            for each in kernels:
                if each.is_compiled_elsewhere:
                    elsewhere.append(each)
                else:
                    each.prepare()
            for each in elsewhere:
                each.prepare()
    finally:
        _method.reset(before)


def pair_of(first: types.Type, second: types.Type) -> types.Type:
    """Return the type of a kernel's two results."""
    make: Any = types.Tuple  # numba declares no types of its arguments
    pair: types.Type = make((first, second))
    return pair


def pointer_to(signature: Signature) -> types.Type:
    """Return the argument type for an exchangeable kernel."""
    return types.FunctionType(signature)


@functools.cache
def _begin_compiling(method: str) -> None:
    """Report on stderr, once for each method, why its first run takes long; standard output belongs to
    results."""
    compare_options_as_dictionaries()
    what = f"the kernels of {method}" if method else "kernels"
    print(f"mbref: compiling {what} for this machine, once; up to a minute", file=sys.stderr, flush=True)
