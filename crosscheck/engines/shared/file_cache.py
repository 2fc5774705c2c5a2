"""Files made once and stored in the user's cache folder, such as compiled libraries.

A file's name contains a hash of its origin and a hash of its bytes, so that a damaged file is made again.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

MOST = 64e6  # bytes; the oldest files of a larger folder are removed


def hashed(*parts: str) -> str:
    """Return the hash of an origin's parts."""
    return _hash("\n".join(parts).encode())


def stored(name: str, origin: str, suffix: str) -> Path | None:
    """Return the file of an origin in a folder of the cache; its name contains the hash of its content."""
    for path in sorted(cache(name).glob(f"{origin}-*{suffix}")):
        with contextlib.suppress(OSError):
            if path.stem.partition("-")[2] == _hash(path.read_bytes()):
                return path
    return None


def store(name: str, origin: str, suffix: str, make: Callable[[Path], None]) -> Path:
    """Store the file that ``make`` writes in the cache, or in a temporary folder if storing fails; no reader
    sees a part of the file."""
    folder = cache(name)
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
    remove_oldest(folder, suffix)
    return path


def made_once(name: str, origin: str, suffix: str, make: Callable[[Path], None]) -> Path:
    """Return the file of an origin in a folder of the cache; ``make`` writes it if it is missing."""
    return stored(name, origin, suffix) or store(name, origin, suffix, make)


def cache(name: str) -> Path:
    """Return the folder of that name in the user's cache folder; it need not exist."""
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "mbref" / name


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def remove_oldest(folder: Path, suffix: str = "") -> None:
    """Remove the oldest files of a folder larger than MOST; other processes may remove files meanwhile."""
    with contextlib.suppress(OSError):
        paths = sorted(folder.glob(f"*{suffix}"), key=lambda path: path.stat().st_mtime)
        left = sum(path.stat().st_size for path in paths)
        for path in paths[:-1]:
            if left > MOST:
                left -= path.stat().st_size
                path.unlink()
