"""numba's cache of compiled kernels, kept in our folder as checked files.

numba trusts the bytes of its own files: machine code that is damaged ends the process with a signal.  While
one of our functions is decorated, our cache takes the place of numba's, with a locator, which says where
files lie, and a file, which stores and loads; other users of numba keep theirs.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba.core import caching, ccallback, dispatcher
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
        needs its runtime alone; a compilation imports them itself.
        """
        rtsys.initialize(target_context)
        return self._load_overload(sig, target_context)


@functools.cache
def _cache_in(folder: Path) -> type[_Cache]:
    """The cache of functions below this folder."""
    place = type("Place", (_Place,), {"folder": folder})
    rules = type("Rules", (caching.CompileResultCacheImpl,), {"_locator_classes": [place]})
    return type("Cache", (_Cache,), {"_impl_class": rules})


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
