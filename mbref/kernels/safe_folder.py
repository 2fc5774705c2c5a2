"""Folders of caches from which code may be loaded: only this user, or root, can write there."""

from __future__ import annotations

import functools
import os
import stat
import sys
from pathlib import Path


@functools.cache
def is_safe(folder: Path) -> bool:
    """Return whether no other user can change files of the folder; otherwise one line on stderr reports it.

    The folder may be missing. The folder above may be one like /tmp, where users keep their own files
    (sticky). Without users of POSIX every folder is safe.
    """
    if not hasattr(os, "geteuid"):
        return True
    why = _danger(folder, False) or _danger(folder.parent, True)
    if why:
        print(
            f"mbref: {why}; the cache is not used, and code is compiled each time",
            file=sys.stderr,
            flush=True,
        )
    return not why


def make(folder: Path) -> None:
    """Make a folder and the missing folders above it, closed to other users; raises OSError."""
    for missing in reversed([place for place in (folder, *folder.parents) if not place.exists()]):
        missing.mkdir(mode=0o700, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)


def _danger(folder: Path, may_be_sticky: bool) -> str:
    """Return how other users can write to a folder, or an empty text."""
    try:
        found = folder.stat()
    except OSError:
        return ""
    if found.st_uid not in (os.geteuid(), 0):
        return f"{folder} belongs to another user"
    by_others = found.st_mode & stat.S_IWOTH or (found.st_mode & stat.S_IWGRP and _is_shared(found.st_gid))
    is_sticky = may_be_sticky and bool(found.st_mode & stat.S_ISVTX)
    if by_others and not is_sticky and not _is_closed(folder.parent):
        return f"{folder} can be written by other users (chmod go-w {folder} ends this)"
    return ""


def _is_closed(folder: Path) -> bool:
    """Return whether no other user can reach what is in a folder of this user."""
    try:
        found = folder.stat()
    except OSError:
        return False
    return found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IRWXG | stat.S_IRWXO)


def _is_shared(group: int) -> bool:
    """Return whether a group has members besides this user: it is not the user's own group of one member."""
    import grp
    import pwd

    try:
        own, found = pwd.getpwuid(os.geteuid()).pw_name, grp.getgrgid(group)
    except KeyError:
        return True
    return found.gr_name != own or any(name != own for name in found.gr_mem)
