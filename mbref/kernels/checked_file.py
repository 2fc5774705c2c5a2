"""Files of a cache with a checksum, written completely or not at all; without a writable folder nothing is
stored.

No function here raises for a damaged, foreign, missing or unwritable file, since a cache may be deleted at
any time.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import sys
import tempfile
from pathlib import Path

from mbref.kernels.safe_folder import is_safe, make

DIGEST = hashlib.sha256().digest_size  # bytes before the data


def read(path: Path) -> bytes | None:
    """Return the data stored at this path; None if the file is missing or damaged, or if other users can
    write to its folder.

    A damaged file is reported in one line on stderr and removed if possible.
    """
    if not _is_safe(path.parent):
        return None
    try:
        found = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        _report(f"{path} cannot be read ({error.strerror}) and is not used")
        return None
    digest, data = found[:DIGEST], found[DIGEST:]
    if hashlib.sha256(data).digest() == digest:
        return data
    _report(f"{path} is damaged and will be written again")
    with contextlib.suppress(OSError):
        path.unlink()
    return None


def write(path: Path, data: bytes) -> None:
    """Store the data completely or not at all; a failure is reported in one line on stderr, once for each
    folder."""
    temporary = ""
    if not _is_safe(path.parent):
        return
    try:
        make(path.parent)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            temporary = file.name
            file.write(hashlib.sha256(data).digest() + data)
        os.replace(temporary, path)
    except OSError as error:
        _report_once(f"cannot write to {path.parent} ({error.strerror}); it is computed each time")
        if temporary:
            with contextlib.suppress(OSError):
                os.unlink(temporary)


def _is_safe(folder: Path) -> bool:
    """Return whether no other user can write to the folder and to the folders of the cache above it."""
    return is_safe(folder) and is_safe(folder.parent)


@functools.cache
def _report_once(sentence: str) -> None:
    _report(sentence)


def _report(sentence: str) -> None:
    print(f"mbref: {sentence}", file=sys.stderr, flush=True)
