"""Armature and damping of actuators, which act without a control value too, as their joints' own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.left_out import Part


def moved_to_joints(mujoco: Any, model: Any) -> Iterator[Part]:
    """Add armature and damping of actuators, times gear², to their hinges and slides in the model.

    An actuator of another transmission, or with damping that is not linear, gives a part to be left out.
    """
    transmissions, joints = mujoco.mjtTrn, mujoco.mjtJoint
    of_joints = {int(transmissions.mjTRN_JOINT), int(transmissions.mjTRN_JOINTINPARENT)}
    single = {int(joints.mjJNT_HINGE), int(joints.mjJNT_SLIDE)}
    for a in range(len(model.actuator_armature)):
        j, gear = int(model.actuator_trnid[a, 0]), float(model.actuator_gear[a, 0])
        is_plain = int(model.actuator_trntype[a]) in of_joints and int(model.jnt_type[j]) in single
        name = model.actuator(a).name or f"actuator {a}"
        for kind, numbers, of_joint in (
            ("armature", model.actuator_armature, model.dof_armature),
            ("damping", model.actuator_damping, model.dof_damping),
        ):
            if is_plain:
                of_joint[model.jnt_dofadr[j]] += gear**2 * numbers[a]
            elif numbers[a]:
                yield Part(kind, f"{kind} of {name!r}, which is no actuator of a hinge or slide")
        if np.any(model.actuator_dampingpoly[a]):
            yield Part("damping", f"polynomial damping of {name!r}")
    for numbers in (model.actuator_armature, model.actuator_damping, model.actuator_dampingpoly):
        numbers[...] = 0
