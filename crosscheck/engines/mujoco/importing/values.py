"""Numbers of a compiled model that no scene has: not finite, or so large that squares overflow."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.left_out import joint_name
from crosscheck.engines.shared.xml_files import DEEPEST
from mbref.scene import SceneError
from mbref.scene.fields import LARGEST

UNIT = 1e-6  # largest deviation of the length of an axis from 1
FIELDS = {
    "body": ("body_mass", "body_inertia", "body_pos", "body_ipos"),
    "joint": ("jnt_pos", "jnt_axis", "jnt_stiffness"),
    "dof": ("dof_damping", "dof_armature", "dof_frictionloss"),
    "site": ("site_pos",),
    "equality": ("eq_data",),
    "tendon": ("tendon_stiffness", "tendon_damping", "tendon_armature", "tendon_lengthspring"),
    "actuator": ("actuator_gear", "actuator_gainprm", "actuator_biasprm"),
    "key": ("key_qpos", "key_qvel", "key_ctrl", "key_act"),
}
OF_ALL = ("gravity", "density", "viscosity", "timestep")


def check(mujoco: Any, model: Any) -> None:
    """Raise SceneError with every part that has such a number, with joints whose axis has no length, and for
    bodies that carry each other too deep."""
    if (deepest := _depth(model)) > DEEPEST:
        raise SceneError([f"bodies carry each other {deepest} deep; at most {DEEPEST} are read"])
    if faults := [*_of_parts(model), *_of_options(model), *_of_axes(mujoco, model)]:
        raise SceneError(faults)


def _depth(model: Any) -> int:
    """Return the largest number of bodies that carry each other."""
    found = np.zeros(model.nbody, int)
    for b in range(1, model.nbody):  # parents have smaller numbers
        found[b] = found[model.body_parentid[b]] + 1
    return int(found.max())


def _of_parts(model: Any) -> Iterator[str]:
    for kind, fields in FIELDS.items():
        for field in fields:
            rows = np.atleast_2d(getattr(model, field).T).T
            for k in np.flatnonzero(~(np.abs(rows) <= LARGEST).all(axis=1)):
                worst = next(float(v) for v in rows[k] if not abs(v) <= LARGEST)
                yield f"{_label(model, kind, int(k))}: {field.partition('_')[2]} {_refusal(worst)}"


def _label(model: Any, kind: str, k: int) -> str:
    if kind in ("joint", "dof"):
        return f"joint {joint_name(model, k if kind == 'joint' else int(model.dof_jntid[k]))}"
    name = getattr(model, kind)(k).name
    return f"{kind.replace('key', 'keyframe')} {name!r}" if name else f"{kind.replace('key', 'keyframe')} {k}"


def _refusal(number: float) -> str:
    return f"must be a number of at most {LARGEST:g} in size, got {number:g}"


def _of_options(model: Any) -> Iterator[str]:
    for name in OF_ALL:
        for number in np.atleast_1d(getattr(model.opt, name)):
            if not abs(number) <= LARGEST:
                yield f"option {name}: {_refusal(float(number))}"


def _of_axes(mujoco: Any, model: Any) -> Iterator[str]:
    kinds = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    for j in range(model.njnt):
        if int(model.jnt_type[j]) in kinds and abs(np.linalg.norm(model.jnt_axis[j]) - 1.0) > UNIT:
            yield f"joint {joint_name(model, j)}: its axis has no length"
