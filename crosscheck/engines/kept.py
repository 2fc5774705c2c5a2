"""Files made once and kept in the user's cache folder, such as compiled libraries.

A file's name is a hash of its origin and a hash of its bytes, so that a damaged one is made anew.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

MOST = 64e6  # bytes of a folder; the oldest files beyond them are removed


def hashed(*parts: str) -> str:
    """The hash of an origin's parts."""
    return _hash("\n".join(parts).encode())


def kept(name: str, origin: str, suffix: str) -> Path | None:
    """Return the file of an origin in a folder of the cache, named after its content."""
    for path in sorted(_folder(name).glob(f"{origin}-*{suffix}")):
        with contextlib.suppress(OSError):
            if path.stem.partition("-")[2] == _hash(path.read_bytes()):
                return path
    return None


def keep(name: str, origin: str, suffix: str, make: Callable[[Path], None]) -> Path:
    """Puts the file that ``make`` writes, whole, into the cache; into a temporary folder where that fails."""
    folder = _folder(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, place = tempfile.mkstemp(dir=folder)
        os.close(handle)
        made = Path(place)
    except OSError:
        folder = Path(tempfile.mkdtemp())
        made = folder / "made"
    try:
        make(made)
        path = folder / f"{origin}-{_hash(made.read_bytes())}{suffix}"
        os.replace(made, path)
    finally:
        made.unlink(missing_ok=True)
    _remove_oldest(folder, suffix)
    return path


def made_once(name: str, origin: str, suffix: str, make: Callable[[Path], None]) -> Path:
    """The file of an origin in a folder of the cache, which ``make`` writes where there is none."""
    return kept(name, origin, suffix) or keep(name, origin, suffix, make)


def _folder(name: str) -> Path:
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "mbref" / name


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def _remove_oldest(folder: Path, suffix: str) -> None:
    """Other processes may remove the same ones."""
    with contextlib.suppress(OSError):
        paths = sorted(folder.glob(f"*{suffix}"), key=lambda path: path.stat().st_mtime)
        left = sum(path.stat().st_size for path in paths)
        for path in paths[:-1]:
            if left > MOST:
                left -= path.stat().st_size
                path.unlink()
