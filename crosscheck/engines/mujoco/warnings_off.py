"""MuJoCo without its warnings, which go to the terminal and to MUJOCO_LOG.TXT in the working folder."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

_WITHIN: list[None] = []  # one entry for each block that is open, since blocks are inside each other


@contextlib.contextmanager
def without_warnings(mujoco: Any) -> Iterator[None]:
    """Discard MuJoCo's warnings in the ``with`` block; errors are raised as before."""
    _WITHIN.append(None)
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        _WITHIN.pop()
        if not _WITHIN:
            mujoco.set_mju_user_warning(None)
