"""numba's cache of compiled kernels, kept in our folder as checked files.

numba trusts the bytes of its own files: machine code that is damaged ends the process with a signal.  While
one of our functions is decorated, our cache takes the place of numba's, with a locator, which says where
files lie, a file, which stores and loads, and a library, which holds the machine code that was loaded; other
users of numba keep theirs.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from llvmlite import binding as llvm
from numba.core import caching, ccallback, dispatcher
from numba.core.codegen import JITCodeLibrary
from numba.core.runtime import rtsys

from mbref.kernels import checked_file


def folder_of(cache: Path, source: Path) -> Path:
    """Where the kernels of a source file are kept: in a folder named after that of the file."""
    return cache / source.parent.name


@contextlib.contextmanager
def kept_in(folder: Path) -> Iterator[None]:
    """Functions decorated meanwhile are cached below this folder, which is touched when one is compiled."""
    before, dispatcher.FunctionCache = dispatcher.FunctionCache, _cache_in(folder)
    ccallback.FunctionCache = dispatcher.FunctionCache
    try:
        yield
    finally:
        dispatcher.FunctionCache = ccallback.FunctionCache = before


class _Cache(caching.FunctionCache):
    """The cache of one function, which says how compiled code is found, loaded and kept."""

    def __init__(self, function: Callable):
        super().__init__(function)
        self._cache_file = _Files(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function of this signature, or None.

        numba first imports all operations that it can compile, SciPy's linear algebra among them.  Loading
        needs none of them; a compilation imports them itself.
        """
        return self._load_overload(sig, target_context)


@functools.cache
def _cache_in(folder: Path) -> type[_Cache]:
    """The cache of functions below this folder."""
    place = type("Place", (_Place,), {"folder": folder})
    rules = type("Rules", (_Rules,), {"_locator_classes": [place]})
    return type("Cache", (_Cache,), {"_impl_class": rules})


class _Rules(caching.CompileResultCacheImpl):
    """numba's rules of what is kept of a compiled function, and how the function is made of it again."""

    def reduce(self, compiled: Any) -> tuple[Any, ...]:
        """The parts that are kept of a compiled function: of the functions compiled into it, some fifty, only
        environments that hold constants.  Code never looks at the others, and to make them takes a third of
        the time to load a kernel.
        """
        *parts, environments = super().reduce(compiled)
        own = compiled.fndesc.env_name
        return (*parts, tuple(e for e in environments if e.consts or e.env_name == own))

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """The compiled function, whose library is of our class."""
        codegen, code = target_context.codegen(), payload[0][2][0]
        if b"NRT_" in code:
            rtsys.initialize(target_context)
        before, codegen._library_class = codegen._library_class, _Loaded
        try:
            return super().rebuild(target_context, payload)
        finally:
            codegen._library_class = before


class _Loaded(JITCodeLibrary):
    """Machine code from the cache.  Its bitcode is parsed only when another kernel is linked with it: of the
    time to load a kernel that takes half.
    """

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> _Loaded:
        name, _, (code, bitcode) = state
        self = cls(codegen, name)
        self._code, self._bitcode = code, bitcode
        self.enable_object_caching()
        self._set_compiled_object(code)
        self._finalize_final_module()
        return self

    def get_pointer_to_function(self, name: str) -> int:
        """The address of a function; 0 where the code does not name it."""
        named = name.encode() + b"\0" in self._code
        return self._codegen._engine.get_function_address(name) if named else 0

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self._bitcode)
        return self._shared_module


class _Place:
    """numba's locator, with the methods that it asks for."""

    folder: Path

    def __init__(self, source: str):
        self._source = source

    @classmethod
    def from_function(cls, _function: Callable, source: str) -> _Place:
        return cls(source)

    def get_cache_path(self) -> str:
        return str(folder_of(self.folder, Path(self._source)))

    def get_source_stamp(self) -> str:
        return _digest(self._source)

    def get_disambiguator(self) -> str:
        return "kernel"

    def ensure_cache_path(self) -> None:
        """Nothing before there is something to write."""


@functools.cache
def _digest(source: str) -> str:
    """Of the file's text: the cache serves every copy of the same sources."""
    return hashlib.sha256(Path(source).read_bytes()).hexdigest()


class _Files:
    """numba's store of a function's compiled signatures: a file each."""

    def __init__(self, cache_path: str, filename_base: str, source_stamp: Any):
        self._stem, self._stamp = Path(cache_path) / filename_base, source_stamp

    def load(self, key: Any) -> Any:
        """The data saved under the key, or None."""
        data = checked_file.read(self._path(key))
        return None if data is None else pickle.loads(data)

    def save(self, key: Any, data: Any) -> None:
        """Keep the data, where that is possible."""
        checked_file.write(self._path(key), caching.dumps(data))

    def _path(self, key: Any) -> Path:
        digest = hashlib.sha256(repr((self._stamp, key)).encode()).hexdigest()[:16]
        return self._stem.with_name(f"{self._stem.name}.{digest}.nbc")
