"""Parts of a MuJoCo model, but for its looks, that have no counterpart in a scene."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np


def left_out(mujoco: Any, model: Any) -> tuple[str, ...]:
    """One sentence for every kind of part; the softness of constraints is among them."""
    return tuple(
        sentence
        for counted in (_counts(mujoco, model), _joints(model), _options(mujoco, model))
        for sentence in counted
    )


def _counts(mujoco: Any, model: Any) -> Iterator[str]:
    touching = int(np.sum((model.geom_contype != 0) | (model.geom_conaffinity != 0)))
    counts = {
        "actuators": model.nu, "contact pairs": model.npair, "flexible bodies": model.nflex,
        "plugins": model.nplugin, "geoms that could touch others": touching if touching > 1 else 0,
        "motion-capture bodies": model.nmocap, "sensors": model.nsensor,
        "sites that hold nothing": model.nsite - len(_holding_sites(mujoco, model)),
        "tendons with limits, friction or armature": int(
            np.sum(model.tendon_limited != 0) + np.sum(model.tendon_frictionloss > 0)
            + np.sum(model.tendon_armature > 0)
        ),
    }  # fmt: skip
    yield from (f"{number} {what}" for what, number in counts.items() if number)


def _holding_sites(mujoco: Any, model: Any) -> set[int]:
    """The sites at the ends of equalities and tendons."""
    ends = model.eq_objtype == int(mujoco.mjtObj.mjOBJ_SITE)
    wrapped = model.wrap_type == int(mujoco.mjtWrap.mjWRAP_SITE)
    return {*model.eq_obj1id[ends], *model.eq_obj2id[ends], *model.wrap_objid[wrapped]}


def _joints(model: Any) -> Iterator[str]:
    for what, numbers in (("limits", model.jnt_limited), ("dry friction", model.dof_frictionloss),
                          ("armature", model.dof_armature), ("polynomial stiffness", model.jnt_stiffnesspoly),
                          ("polynomial damping", model.dof_dampingpoly)):  # fmt: skip
        if np.any(numbers):
            count = int(np.sum(np.any(np.reshape(numbers, (len(numbers), -1)), axis=1)))
            yield f"{what} of {count} joint coordinates"
    if np.any(model.body_gravcomp):
        yield "compensation of gravity"


def _options(mujoco: Any, model: Any) -> Iterator[str]:
    if model.opt.density or model.opt.viscosity:
        yield "the fluid around the bodies"
    if model.neq:
        yield "the softness of equalities (solref, solimp): a scene's joints are exact"
    if not np.array_equal(model.qpos0, model.qpos_spring) and not np.any(model.jnt_stiffness):
        yield "spring positions of joints without springs"
    if model.nkey:
        yield f"{model.nkey} keyframes: the scene is at the reference position"
