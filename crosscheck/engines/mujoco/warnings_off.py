"""MuJoCo's warnings: not printed, since they also go to MUJOCO_LOG.TXT in the working folder, but read."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from crosscheck.engines.shared.sampling import Failed
from mbref.motions.trajectory import Outcome

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


def check_state(mujoco: Any, data: Any, t0: float, t1: float) -> None:
    """Raise Failed if the state is not finite, or if MuJoCo met such a number, or a huge one, between two
    times (s) and reset the state to its start.

    MuJoCo does so by default (flag ``autoreset``), and counts a warning after the reset.
    """
    was_reset = any(data.warning[int(getattr(mujoco.mjtWarning, name))].number for name in BAD_STATES)
    if was_reset or not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
        message = f"the state became infinite or NaN between {t0:.6g} s and {t1:.6g} s"
        raise Failed(Outcome.NOT_FINITE, t0, message)
