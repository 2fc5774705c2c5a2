"""Limits of joints and tendons that act when the motion begins."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.actuators import Actuators
from crosscheck.engines.mujoco.importing.left_out import Part, joint_name

AT_LIMIT = 1e-9  # rad or m; a coordinate or length this near to its limit is at the limit
PUSHES = 1e-9  # fraction of the largest velocity or acceleration; smaller ones along a limit are rounding


def acting(mujoco: Any, model: Any, data: Any, actuators: Actuators) -> Iterator[Part]:
    """Return a part for each limit that acts at the pose of the data, within its margin or beyond its end, or
    against which the mechanism moves or accelerates; the model's own switch may turn all limits off."""
    bits = mujoco.mjtDisableBit
    if model.opt.disableflags & (bits.mjDSBL_CONSTRAINT | bits.mjDSBL_LIMIT):
        return
    near = copy.copy(model)
    near.opt.disableflags |= bits.mjDSBL_CONTACT | bits.mjDSBL_FRICTIONLOSS
    near.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    for margin in (near.jnt_margin, near.tendon_margin):
        margin[:] = np.maximum(margin, AT_LIMIT)
    at = _forward(mujoco, near, data, actuators)
    kinds = mujoco.mjtConstraint
    rows = [
        int(k)
        for k in np.flatnonzero(
            np.isin(at.efc_type[: at.nefc], [int(kinds.mjCNSTR_LIMIT_JOINT), int(kinds.mjCNSTR_LIMIT_TENDON)])
        )
    ]
    if not rows:
        return
    near.opt.disableflags |= bits.mjDSBL_LIMIT
    free = _forward(mujoco, near, data, actuators)
    jacobian = at.efc_J[: at.nefc * model.nv].reshape(at.nefc, model.nv)
    seen = set()
    for row in rows:
        motion = [jacobian[row] @ rates for rates in (data.qvel, free.qacc)]  # < 0: towards the limit
        least = [PUSHES * float(np.abs(jacobian[row]) @ np.abs(rates)) for rates in (data.qvel, free.qacc)]
        speed, push = (0.0 if abs(m) <= size else m for m, size in zip(motion, least, strict=True))
        gap = at.efc_pos[row] - at.efc_margin[row] + AT_LIMIT
        if gap < -AT_LIMIT or speed < 0 or (speed == 0 and push < 0):
            is_joint = at.efc_type[row] == kinds.mjCNSTR_LIMIT_JOINT
            seen.add((is_joint, int(at.efc_id[row])))
    for is_joint, k in sorted(seen, reverse=True):
        name = f"joint {joint_name(model, k)}" if is_joint else f"tendon {model.tendon(k).name or k!r}"
        yield Part("limits", f"limit of {name}, which acts at the start")


def _forward(mujoco: Any, model: Any, data: Any, actuators: Actuators) -> Any:
    """Return MuJoCo's data with the accelerations at the state of other data."""
    found = mujoco.MjData(model)
    found.qpos[:], found.qvel[:] = data.qpos, data.qvel
    actuators.prepare(found)
    mujoco.mj_forward(model, found)
    return found
