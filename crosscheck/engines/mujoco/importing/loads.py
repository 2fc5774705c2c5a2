"""Springs, dampers and actuators of joints and tendons as loads of a scene, and parts that no load can
describe."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.actuators import Actuators
from crosscheck.engines.mujoco.importing.chains import kind_of
from crosscheck.engines.mujoco.importing.groups import Groups
from crosscheck.engines.mujoco.importing.left_out import Part, joint_name
from crosscheck.engines.shared.entries import entry
from mbref.scene import (
    GROUND,
    Joint,
    JointForce,
    JointTorque,
    Load,
    PointDamper,
    RotationalDamper,
    SlideSpring,
    Spring,
    TorsionSpring,
)
from mbref.scene.joints import ANGLE, DISPLACEMENT, Coordinate

COORDINATES: dict[str, Coordinate] = {"hinge": ANGLE, "slide": DISPLACEMENT}


def of_joints(
    mujoco: Any, model: Any, data: Any, groups: Groups, joint_of: Mapping[int, Joint]
) -> Iterator[Load | Part]:
    """Return a spring for every hinge and slide with stiffness or damping, and dampers for ball and free
    joints; all other springs are parts to be left out.

    ``joint_of`` maps a MuJoCo joint to the scene's joint that consists of this MuJoCo joint alone.
    """
    yield from _plastic(model)
    for j in range(model.njnt):
        stiffness, damping = _springs(mujoco, model, j)
        if not stiffness and not damping:
            continue
        q, joint = int(model.jnt_qposadr[j]), joint_of.get(j)
        kind = kind_of(mujoco, model, j)
        coordinate = COORDINATES.get(kind)
        if joint is None or coordinate not in joint.facts.loaded:
            dampers = list(_dampers(model, data, groups, j, kind, joint, damping))
            yield from dampers
            yield from _unknown(model, j, bool(stiffness), bool(damping and not dampers))
            model.jnt_stiffness[j] = 0
            model.dof_damping[_dofs(model, j)] *= bool(dampers)
            continue
        rest = float(model.qpos_spring[q] - data.qpos[q]) if stiffness else 0.0
        yield _spring(joint.name, coordinate, stiffness, damping, rest)
    yield from _polynomials(model)


def of_actuators(
    mujoco: Any, model: Any, data: Any, actuators: Actuators, joint_of: Mapping[int, Joint]
) -> Iterator[Load | Part]:
    """Return the loads of the actuators of each hinge and slide; actuators of another joint are a part to be
    left out."""
    for j in dict.fromkeys(law.joint for law in actuators.laws):
        joint, coordinate = joint_of.get(j), COORDINATES.get(kind_of(mujoco, model, j))
        if joint is None or coordinate not in joint.facts.loaded:
            yield actuators.leave_out(j, joint_name(model, j))
            continue
        laws = [law for law in actuators.laws if law.joint == j]
        stiffness, damping = sum(law.stiffness for law in laws), sum(law.damping for law in laws)
        force = sum(law.constant for law in laws)
        if stiffness or damping:
            start = float(data.qpos[model.jnt_qposadr[j]])
            rest = force / stiffness - start if stiffness else 0.0
            yield _spring(joint.name, coordinate, stiffness, damping, rest)
        if force and not stiffness:
            where = f"actuators of joint {joint_name(model, j)}"
            if coordinate == ANGLE:
                yield entry(where, JointTorque, joint=joint.name, torque=force)
            else:
                yield entry(where, JointForce, joint=joint.name, force=force)


def _spring(joint: str, coordinate: Coordinate, stiffness: float, damping: float, rest: float) -> Load:
    """Return a spring and damper along a coordinate, whose force vanishes ``rest`` from the start."""
    numbers: dict[str, Any] = {"joint": joint, "stiffness": stiffness, "damping": damping}
    where = f"springs of joint {joint!r}"
    if coordinate == ANGLE:
        return entry(where, TorsionSpring, **numbers, natural_angle=rest)
    return entry(where, SlideSpring, **numbers, natural_displacement=rest)


def _springs(mujoco: Any, model: Any, j: int) -> tuple[float, float]:
    """Return stiffness and damping of a joint, zero if the file disables them."""
    flags, disabled = mujoco.mjtDisableBit, model.opt.disableflags
    stiffness = 0.0 if disabled & flags.mjDSBL_SPRING else float(model.jnt_stiffness[j])
    damping = 0.0 if disabled & flags.mjDSBL_DAMPER else float(model.dof_damping[model.jnt_dofadr[j]])
    return stiffness, damping


def _dampers(
    model: Any, data: Any, groups: Groups, j: int, kind: str, joint: Joint | None, damping: float
) -> Iterator[Load]:
    """Return the dampers of a ball or free joint. A free joint damps the rotation of its body and the
    velocity of the origin of the body's frame."""
    if not damping or not (kind == "free" or (kind == "ball" and joint is not None)):
        return
    body = int(model.jnt_bodyid[j])
    where, pair = f"damping of joint {joint_name(model, j)}", (GROUND, groups.name_of(body))
    if kind == "free":
        yield entry(where, PointDamper, bodies=pair, point=data.xpos[body].tolist(), damping=damping)
    yield entry(where, RotationalDamper, bodies=joint.bodies if joint else pair, damping=damping)


def _unknown(model: Any, j: int, stiff: bool, damped: bool) -> Iterator[Part]:
    if stiff:
        yield Part("springs", f"stiffness of joint {joint_name(model, j)}")
    if damped:
        yield Part("damping", f"damping of joint {joint_name(model, j)}")


def _plastic(model: Any) -> Iterator[Part]:
    """Return the springs that yield, without their stiffness in the model."""
    joints, tendons = (getattr(model, f"{part}_springyield", ()) for part in ("jnt", "tendon"))  # since 4.0
    for k in np.flatnonzero(joints):
        yield Part("springs", f"plastic spring of joint {joint_name(model, int(k))}")
        model.jnt_stiffness[k] = 0
    for k in np.flatnonzero(tendons):
        yield Part("springs", f"plastic spring of tendon {model.tendon(int(k)).name!r}")
        model.tendon_stiffness[k] = 0


def _dofs(model: Any, j: int) -> slice:
    first = int(model.jnt_dofadr[j])
    return slice(first, first + int(np.sum(model.dof_jntid == j)))


def _polynomials(model: Any) -> Iterator[Part]:
    """Return sentences on stiffness and damping that are not constant."""

    def joint(k: int) -> str:
        return f"joint {joint_name(model, k)}"

    for kind, numbers, owner in (
        ("springs", model.jnt_stiffnesspoly, joint),
        ("damping", model.dof_dampingpoly, lambda k: joint(int(model.dof_jntid[k]))),
        ("springs", model.tendon_stiffnesspoly, lambda k: f"tendon {model.tendon(k).name!r}"),
        ("damping", model.tendon_dampingpoly, lambda k: f"tendon {model.tendon(k).name!r}"),
    ):
        found = [k for k, row in enumerate(numbers) if np.any(row)]
        for name in dict.fromkeys(owner(k) for k in found):
            yield Part(kind, f"polynomial {kind} of {name}")
        numbers[...] = 0


def of_tendons(mujoco: Any, model: Any, data: Any, groups: Groups) -> Iterator[Load | Part | str]:
    """Return a spring for every tendon between two sites that has stiffness or damping; a note for one that
    has both sites on one body."""
    flags, disabled = mujoco.mjtDisableBit, model.opt.disableflags
    for numbers, flag in (
        (model.tendon_stiffness, flags.mjDSBL_SPRING),
        (model.tendon_damping, flags.mjDSBL_DAMPER),
    ):
        numbers[...] *= not disabled & flag
    for k in range(model.ntendon):
        stiffness, damping = float(model.tendon_stiffness[k]), float(model.tendon_damping[k])
        if not stiffness and not damping:
            continue
        wraps = range(int(model.tendon_adr[k]), int(model.tendon_adr[k] + model.tendon_num[k]))
        low, high = model.tendon_lengthspring[k]
        plain = all(model.wrap_type[w] == mujoco.mjtWrap.mjWRAP_SITE for w in wraps)
        name = model.tendon(k).name or f"tendon {k}"
        if len(wraps) != 2 or not plain or (low != high and stiffness):
            kind = "springs" if stiffness else "damping"
            is_straight = len(wraps) == 2 and plain
            what = (
                "whose spring is slack over a range"
                if is_straight
                else "which is not a spring between two sites"
            )
            yield Part(kind, f"tendon {name!r}, {what}")
            model.tendon_stiffness[k] = model.tendon_damping[k] = 0
            continue
        sites = [int(model.wrap_objid[w]) for w in wraps]
        bodies: Any = tuple(groups.name_of(int(model.site_bodyid[s])) for s in sites)
        if bodies[0] == bodies[1]:
            yield f"tendon {name!r}: both sites are on {bodies[0]!r}, which its spring does not move"
            continue
        yield entry(
            f"tendon {name!r}",
            Spring,
            bodies=bodies,
            points=tuple(data.site_xpos[s].tolist() for s in sites),
            natural_length=float(low),
            stiffness=stiffness,
            damping=damping,
        )
