"""MuJoCo's warnings: not printed, since they also go to MUJOCO_LOG.TXT in the working folder, but read."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

BAD_STATES = ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC")
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


def was_reset(mujoco: Any, data: Any) -> bool:
    """Return whether MuJoCo met an infinite, undefined or huge number and reset the state to its start.

    MuJoCo does so by default (flag ``autoreset``), and counts a warning after the reset.
    """
    return any(data.warning[int(getattr(mujoco.mjtWarning, name))].number for name in BAD_STATES)
