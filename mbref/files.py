"""Files: written beside and renamed, so that a failure leaves no part of a file; read up to a size; names."""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mbref.input_error import InputError

LONGEST_NAME = 80  # bytes of a file name that is made from a name; file systems allow 255
LARGEST_FILE = 1 << 30  # bytes that are read; a device such as /dev/zero has no end
SPECIAL = ("/dev/", "/proc/")  # beginnings of paths that lead to devices and open files


def write(path: str | Path, content: str | bytes) -> None:
    """Write a file completely or not at all; a text is encoded as UTF-8.

    Raises OSError that names the file. The earlier content is then unchanged.
    """
    with replaced(path) as fresh:
        fresh.write_bytes(content.encode() if isinstance(content, str) else content)


def content(path: str | Path) -> bytes:
    """Return the bytes of a file; raises OSError, also for a file or device of more than 1 GiB."""
    with open(path, "rb") as file:
        found = file.read(LARGEST_FILE + 1)
    if len(found) > LARGEST_FILE:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(path))
    return found


@contextmanager
def replaced(path: str | Path) -> Iterator[Path]:
    """Yield the path of a new file beside ``path``, which takes its place when the block ends without error.

    A device or a pipe is written in place. Raises OSError that names the file.
    """
    target = Path(path)
    fresh = None if _is_special(target) else _beside(target := Path(os.path.realpath(target)))
    try:
        yield fresh or target
        if fresh is not None:
            if target.exists():
                shutil.copymode(target, fresh)
            fresh.replace(target)
    except OSError as error:
        error.filename = str(path)
        raise
    finally:
        if fresh is not None:
            fresh.unlink(missing_ok=True)


def free(path: str | Path, is_forced: bool) -> Path:
    """Return the path of a file that may be written; raises InputError if the file exists and nothing forces
    its replacement."""
    if not is_forced and Path(path).is_file() and not _is_special(Path(path)):
        raise InputError(f"{path}: exists already and was not changed; name another file, or add --force")
    return Path(path)


def writable(path: str | Path) -> bool:
    """Return whether the operating system allows to write a file, of which the folder exists."""
    place = Path(path)
    return os.access(place if _is_special(place) else Path(os.path.realpath(place)).parent, os.W_OK)


def file_name(name: str) -> str:
    """Return a file name for a name of anything, without suffix: letters, digits, ``_`` and ``-``.

    A number, computed from the name, is added if characters are lost, so that different names remain
    different: ``../up`` becomes ``up-fe5ba0e1``.
    """
    plain = re.sub(r"[^\w-]+", "-", name).strip("-").encode()[:LONGEST_NAME].decode(errors="ignore")
    if plain and plain == name:
        return plain
    return f"{plain}-{zlib.crc32(name.encode(errors='surrogatepass')):08x}".lstrip("-")


def _beside(path: Path) -> Path:
    return path.with_name(f".{secrets.token_hex(6)}{path.suffix}")


def _is_special(path: Path) -> bool:
    """Return whether a path leads to a device, a pipe or an open file, which cannot be replaced."""
    return (path.exists() and not path.is_file()) or str(path.absolute()).startswith(SPECIAL)
