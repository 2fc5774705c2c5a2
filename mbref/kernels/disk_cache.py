"""numba's cache of compiled kernels, in a folder for each version of the sources, with checksums.

numba does not check the bytes of its files: damaged machine code ends the process with a signal.  A list in
the folder has the checksum of each file.  Files that differ from the list are removed before numba reads
them, and their kernels are compiled again.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numba

from mbref.kernels.safe_folder import is_safe, make

CHECKSUMS = "checksums.txt"  # one line for each file: SHA-256, blank, path in the folder
LEAST_FREE = 1 << 27  # bytes of free disk; kernels of all methods take 40 MB, and numba fails on a full disk
LINE = hashlib.sha256().digest_size * 2 + 1  # characters before the path


@contextlib.contextmanager
def cached_in(folder: Path) -> Iterator[None]:
    """Let numba cache functions that are decorated in the ``with`` block in the folder
    (``NUMBA_CACHE_DIR``)."""
    config: Any = numba.config  # numba creates the names of this module when it is imported
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        yield
    finally:
        config.CACHE_DIR = before


@functools.cache
def is_writable(folder: Path) -> bool:
    """Return whether files can be stored in the folder, and nobody else can; otherwise one line on stderr
    reports it."""
    if not is_safe(folder) or not all(is_safe(place) for place in _folders(folder) if place.is_dir()):
        return False
    try:
        make(folder)
        tempfile.TemporaryFile(dir=folder).close()
        if shutil.disk_usage(folder).free < LEAST_FREE:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    except OSError as error:
        _report(f"cannot write to {folder} ({error.strerror}); kernels are compiled each time")
        return False
    return True


def files_of(folder: Path, function: Callable[..., Any]) -> list[Path]:
    """Return the files of a function in the folder: an index, and the code of each of its signatures."""
    source = Path(function.__code__.co_filename)
    stem = f"{source.stem}.{function.__qualname__}-".replace("<", "").replace(">", "")
    return [
        place / name
        for place in _folders(folder)
        if place.name.startswith(source.parent.name)
        for name in _names_in(place)
        if name.startswith(stem) and name.endswith((".nbi", ".nbc"))
    ]


def remove_damaged(folder: Path, function: Callable[..., Any]) -> None:
    """Remove the files of a function unless the list has all their checksums; damaged files are reported on
    stderr.

    Files written since this process began to use the folder belong to a process that compiles now, and are
    not removed. Files with a time in the future do not.
    """
    new = _new_among(folder, files_of(folder, function))
    paths, is_whole = [path for path in files_of(folder, function) if path not in new], True
    for path in paths:
        known, found = _known(folder, path), _checksum(path)
        is_whole = is_whole and found in known
        if known and found not in known:
            _report(f"{path} is damaged and will be written again")
    for path in paths if not is_whole else ():
        with contextlib.suppress(OSError):
            path.unlink()


def record_files(folder: Path) -> None:
    """Add to the list the checksums of all files written since this process began to use the folder."""
    paths = [place / name for place in _folders(folder) for name in _names_in(place)]
    kept = [path for path in paths if path.suffix in (".nbi", ".nbc")]
    lines = [f"{_checksum(path)} {path.parent.name}/{path.name}\n" for path in _new_among(folder, kept)]
    with contextlib.suppress(OSError), (folder / CHECKSUMS).open("a") as file:
        file.write("".join(lines))


@functools.cache
def begin(folder: Path) -> float:
    """Begin to use the folder; return the time (s) by the clock of the folder's file system."""
    return _now(folder)


def _now(folder: Path) -> float:
    """Return the time (s) by the clock of the folder's file system."""
    with tempfile.NamedTemporaryFile(dir=folder) as file:
        return os.stat(file.name).st_mtime


def _new_among(folder: Path, paths: Sequence[Path]) -> list[Path]:
    """Return the files that were written since this process began to use the folder."""
    since = begin(folder)
    later = [(path, written) for path in paths if (written := _time_of(path)) >= since]
    now = _now(folder) if later else since
    return [path for path, written in later if written <= now]


def _known(folder: Path, path: Path) -> set[str]:
    """Return the checksums that the list has for a file; processes that compile at the same time write a file
    twice."""
    try:
        size = (folder / CHECKSUMS).stat().st_size
    except OSError:
        return set()
    return _checksums(folder, size).get(f"{path.parent.name}/{path.name}", set())


@functools.lru_cache(maxsize=2)
def _checksums(folder: Path, _size: int) -> dict[str, set[str]]:
    """Return the list of checksums of a folder, read again if the size of the list has changed."""
    found: dict[str, set[str]] = {}
    for line in (folder / CHECKSUMS).read_text(errors="replace").splitlines():
        found.setdefault(line[LINE:], set()).add(line[: LINE - 1])
    return found


def _checksum(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:  # another process removed it
        return ""


def _time_of(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:  # another process removed it
        return 0.0


def _folders(folder: Path) -> list[Path]:
    return [folder / name for name in _names_in(folder) if name != CHECKSUMS]


def _names_in(folder: Path) -> list[str]:
    """Return the names in a folder; no names if the path is no folder. The call takes a third of the time of
    ``glob``."""
    try:
        return os.listdir(folder)
    except OSError:
        return []


def _report(sentence: str) -> None:
    print(f"mbref: {sentence}", file=sys.stderr, flush=True)
