"""Parts of a model that a scene cannot describe: parts that change the motion, by kind, and parts without
influence on the motion."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbref.formats import numbered
from mbref.scene import SceneError

KINDS = {  # kinds of parts that change the motion → their description
    "armature": "inertia of rotors, reflected to joint coordinates or tendons",
    "couplings": "joint coordinates or tendons that follow others",
    "damping": "dampers of joints and tendons that no load of a scene describes",
    "flexible-bodies": "bodies that deform",
    "fluid": "forces of a fluid around the bodies",
    "friction": "dry friction of joints and tendons",
    "gravity-compensation": "bodies whose weight is compensated",
    "kinematic-links": "links that no force moves",
    "limits": "limits of joints and tendons that act at the start",
    "motors": "actuators that exert a force and that no load of a scene describes",
    "sleep": "bodies that begin asleep, which MuJoCo does not move",
    "start": "positions and velocities at the start apart from the poses of links",
    "springs": "springs of joints and tendons that no load of a scene describes",
}
EVERYTHING = "everything"


@dataclass(frozen=True)
class Part:
    """A part that changes the motion and that a scene cannot describe: its kind and a sentence."""

    kind: str
    sentence: str


def checked(without: Collection[str]) -> frozenset[str]:
    """Return the kinds of parts to be left out; raises SceneError for an unknown kind."""
    for kind in without:
        if kind not in (*KINDS, EVERYTHING):
            raise SceneError([f"--without: {kind!r} is none of {', '.join((*KINDS, EVERYTHING))}"])
    return frozenset(KINDS) if EVERYTHING in without else frozenset(without)


def refuse_others(parts: Collection[Part], without: frozenset[str]) -> None:
    """Raise SceneError with every part whose kind is not to be left out."""
    faults = [
        f"{part.sentence}: it changes the motion; --without {part.kind} leaves it out"
        for part in parts
        if part.kind not in without
    ]
    if faults:
        raise SceneError(faults)


def of_model(model: Any, kept: Collection[int]) -> Iterator[Part]:
    """Return parts that change the motion: armature, friction, fluid, compensation, flexible bodies.

    Armature of the coordinates ``kept`` is in the scene.
    """
    armature = model.dof_armature.copy()
    armature[list(kept)] = 0.0
    for kind, numbers in (("armature", armature), ("friction", model.dof_frictionloss)):
        if found := _joint_names(model, numbers):
            yield Part(kind, f"{kind.replace('friction', 'dry friction')} of {_listed(found)}")
    for kind, numbers in (("armature", model.tendon_armature), ("friction", model.tendon_frictionloss)):
        if found := [model.tendon(int(k)).name or f"tendon {k}" for k in np.flatnonzero(numbers)]:
            yield Part(kind, f"{kind} of tendons {_listed(found)}")
    if model.opt.density or model.opt.viscosity:
        yield Part("fluid", "the fluid around the bodies")
    if found := [model.body(int(b)).name for b in np.flatnonzero(model.body_gravcomp)]:
        yield Part("gravity-compensation", f"compensation of the weight of {_listed(found)}")
    yield from flexible(model)


def asleep(mujoco: Any, model: Any, key: int) -> Iterator[Part]:
    """Return a part for the bodies that are asleep at the keyframe ``key``, or without one for -1, and let no
    body of the model sleep."""
    data, awake = mujoco.MjData(model), -1  # sleeping trees have numbers from 0
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    roots = model.tree_bodyadr[np.flatnonzero(data.tree_asleep > awake)]
    model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    if len(roots):
        yield Part("sleep", f"sleep of {_listed([model.body(int(b)).name or f'body {b}' for b in roots])}")


def flexible(model: Any) -> list[Part]:
    """Return one part for all flexible bodies of a model."""
    if not model.nflex:
        return []
    return [Part("flexible-bodies", numbered(model.nflex, "flexible body", "flexible bodies"))]


def _joint_names(model: Any, numbers: np.ndarray) -> list[str]:
    """Return the names of the joints whose coordinates (nv,) have a nonzero number."""
    joints = dict.fromkeys(int(j) for j in model.dof_jntid[np.flatnonzero(numbers)])
    return [joint_name(model, j) for j in joints]


def joint_name(model: Any, j: int) -> str:
    """Return the name of a joint, or its body and number if it has no name."""
    body = model.body(int(model.jnt_bodyid[j])).name or f"body {int(model.jnt_bodyid[j])}"
    return repr(model.joint(j).name) if model.joint(j).name else f"joint {j} (of body {body!r})"


def _listed(names: list[str], most: int = 6) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def notes(mujoco: Any, model: Any, keyframe: str, idle: int) -> Iterator[str]:
    """Return sentences about parts that a scene cannot describe and that do not change the motion, which
    begins at a keyframe if one is named; ``idle`` actuators exert no force."""
    touching = int(np.sum((model.geom_contype != 0) | (model.geom_conaffinity != 0)))
    light = (model.tendon_stiffness == 0) & (model.tendon_damping == 0) & (model.tendon_limited == 0)
    dead = int(np.sum(light)) - len(_used_tendons(mujoco, model))
    counts = (
        (model.npair, "contact pair", "contact pairs"),
        (model.nplugin, "plugin", "plugins"),
        (
            model.nmocap,
            "motion-capture body, fixed at its pose",
            "motion-capture bodies, fixed at their poses",
        ),
        (touching if touching > 1 else 0, "", "geoms that could touch others"),
        (model.nsensor, "sensor", "sensors"),
        (model.nsite - len(_holding_sites(mujoco, model)), "site without a joint", "sites without a joint"),
        (int(np.sum(model.tendon_limited != 0)), "limit of a tendon", "limits of tendons"),
        (int(np.sum(model.jnt_limited != 0)), "limit of a joint", "limits of joints"),
    )
    if idle:
        yield f"{numbered(idle, 'actuator', 'actuators')} without a control value: no force"
    if dead > 0:
        yield f"{numbered(dead, 'tendon', 'tendons')} without spring, damper and limit: no force"
    yield from (numbered(*count) for count in counts if count[0])
    if model.neq:
        yield "the softness of equalities (solref, solimp): a scene's joints are exact"
    if model.nkey and not keyframe:
        keyframes = numbered(model.nkey, "keyframe", "keyframes")
        yield f"{keyframes}: --keyframe NAME begins the motion at a keyframe"


def _used_tendons(mujoco: Any, model: Any) -> set[int]:
    """Return the tendons of actuators and equalities."""
    ends = model.eq_type == int(mujoco.mjtEq.mjEQ_TENDON)
    moved = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_TENDON)
    found = {*model.eq_obj1id[ends], *model.eq_obj2id[ends], *model.actuator_trnid[moved, 0]} - {-1}
    return {
        k
        for k in found
        if not (model.tendon_stiffness[k] or model.tendon_damping[k] or model.tendon_limited[k])
    }


def _holding_sites(mujoco: Any, model: Any) -> set[int]:
    """Return the sites at the ends of equalities and tendons."""
    ends = model.eq_objtype == int(mujoco.mjtObj.mjOBJ_SITE)
    wrapped = model.wrap_type == int(mujoco.mjtWrap.mjWRAP_SITE)
    return {*model.eq_obj1id[ends], *model.eq_obj2id[ends], *model.wrap_objid[wrapped]}


def actuators_and_tendons(mujoco: Any, model: Any) -> None:
    """Let actuators and tendons exert no force in the model; armatures and dampers of actuators stay."""
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    parts = ("stiffness", "damping", "stiffnesspoly", "dampingpoly", "frictionloss", "armature")
    for part in parts:
        getattr(model, f"tendon_{part}")[...] = 0


def stripped(model: Any, kept: Collection[int]) -> None:
    """Remove the parts of ``of_model`` from the model's matrices, in place."""
    armature = model.dof_armature.copy()
    for numbers in (
        model.dof_armature,
        model.tendon_armature,
        model.dof_frictionloss,
        model.tendon_frictionloss,
        model.body_gravcomp,
    ):
        numbers[...] = 0
    model.dof_armature[list(kept)] = armature[list(kept)]
    model.opt.density = model.opt.viscosity = 0.0
