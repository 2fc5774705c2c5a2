"""numba's cache of compiled kernels, kept in our folder as checked files.

numba trusts the bytes of its own files: machine code that is damaged ends the process with a signal.  Its
caches are made of a locator, which says where files lie, and a file, which stores and loads; ours take their
place while one of our functions is decorated, and other users of numba keep theirs.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba.core import caching

from mbref.kernels import checked_file


@contextlib.contextmanager
def kept_in(folder: Path) -> Iterator[None]:
    """Functions decorated meanwhile are cached below this folder, which is touched when one is compiled."""
    implementation = caching.FunctionCache._impl_class
    before = implementation._locator_classes, caching.IndexDataCacheFile
    place = type("Place", (_Place,), {"folder": folder})
    implementation._locator_classes, caching.IndexDataCacheFile = [place], _Files
    try:
        yield
    finally:
        implementation._locator_classes, caching.IndexDataCacheFile = before


class _Place:
    """numba's locator, with the methods that it asks for."""

    folder: Path

    def __init__(self, source: str):
        self._source = source

    @classmethod
    def from_function(cls, _function: Callable, source: str) -> _Place:
        return cls(source)

    def get_cache_path(self) -> str:
        return str(self.folder / Path(self._source).parent.name)

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
        """What was saved under the key, or None."""
        data = checked_file.read(self._path(key))
        return None if data is None else pickle.loads(data)

    def save(self, key: Any, data: Any) -> None:
        """Keep the data, where that is possible."""
        checked_file.write(self._path(key), caching.dumps(data))

    def _path(self, key: Any) -> Path:
        digest = hashlib.sha256(repr((self._stamp, key)).encode()).hexdigest()[:16]
        return self._stem.with_name(f"{self._stem.name}.{digest}.nbc")
