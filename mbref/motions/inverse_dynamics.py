"""Inverse dynamics of undriven joints: forces and torques of motors that replace the drivers of a motion.

Drivers exert forces f along their coordinates, whose rates have the rows D in the velocities of the bodies.
The columns of N are the velocities that all other constraints allow. Without drivers, motors at joints whose
rates have the rows B cause the same motion if their forces τ do the same work on each of these velocities:

    (B N)ᵀ τ = (D N)ᵀ f.

Forces are multiplied by the length of the mechanism, so that they compare with torques.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mbref import rotations
from mbref.equations.joint_reactions import OPEN, SHARE
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.equations.units import unit_rows
from mbref.input_error import InputError
from mbref.motions.constraints import angles_from_start, coordinates, in_frames, without_armatures
from mbref.motions.driving_forces import driving_forces
from mbref.motions.joint_motion import along, joint_motion, position_of, turned_since_start
from mbref.motions.motion import Motion
from mbref.motions.motor_motion import MotorMotion
from mbref.motions.trajectory import Trajectory
from mbref.scene import Joint, Scene, intermittent
from mbref.scene.driver_faults import DRIVABLE
from mbref.scene.fields import meant
from mbref.scene.joints import ANGLE
from mbref.scene.structure import EQUIVALENT_HINGES, turned_ball

# work that motors cannot do / largest work of the drivers, and / work of each driver's force alone along the
# same velocity, below either of which it is rounding
LEFT, LEFT_ALONG = 1e-9, 1e-6
# singular value / largest one, below which rounding of the drivers' forces is magnified
UNCERTAIN = 10 * OPEN
MOVES = 1e-3  # velocity of a body / largest one, in lengths and rad, below which the body stands still


@dataclass(frozen=True)
class _Sample:
    """Motors at one sample: degrees of freedom, rank of B N, whether both are certain, the scaled τ (m,),
    whether others can replace a motor (m,), the work (n,) by velocity that the motors cannot do, the largest
    work of the drivers, and the sum of the sizes of their works along the direction of ``left``."""

    freedoms: int
    rank: int
    is_certain: bool
    forces: np.ndarray
    is_open: np.ndarray
    left: np.ndarray
    work: float
    along: float


def inverse_dynamics(motion: Motion, motors: Sequence[str]) -> Motion:
    """Return the motion with forces or torques of motors that cause the same motion without drivers.

    Drivers prescribe the motion, such as a path of a tool. A motor is at a joint that a driver
    could prescribe. Where the motors outnumber the degrees of freedom, the sum of the squares of the torques,
    and of the forces times the length of the mechanism, is least, and ``open`` is 1. Near singular positions,
    where constraints or motors lose their independence, force, torque and power are NaN.

    Parameters
    ----------
    motion : Motion
        A motion of a scene with drivers and masses, from any engine that gives reactions.
    motors : sequence of str
        Names of the joints with motors. They replace all drivers of the scene.

    Returns
    -------
    Motion
        With ``motors``, whose numbers are among its columns: ``motor(A).torque``, N m.

    Raises
    ------
    InputError
        If the motors cannot cause the motion; the message names the bodies that move while the motors are at
        rest. If a name is no joint that can be driven. If the scene has no drivers or no masses, or
        constraints that do not always hold.
    """
    scene = motion.mechanism
    check_motors(scene, motors)
    forces = driving_forces(scene, motion)
    if not forces:
        raise InputError(
            f"inverse dynamics of {scene.name} needs masses of all bodies, reactions and accelerations"
        )
    samples, length, at_start = _samples(scene, motion, motors, forces)
    certain = [each for each in samples if each.is_certain]
    freedoms = min((each.freedoms for each in certain), default=0)
    freedoms = min(freedoms, at_start)  # all samples may be near singular positions
    rank = max((each.rank for each in certain if each.freedoms == freedoms), default=0)
    regular = np.array(
        [s.is_certain and (s.freedoms, s.rank) == (freedoms, rank) for s in samples], dtype=bool
    )
    _refuse_missing(scene, motion, motors, [s if r else None for s, r in zip(samples, regular, strict=True)])
    found = {}
    for k, joint in enumerate(map(scene.joint_named, motors)):
        turns = joint.facts.driven == ANGLE
        scaled = np.array([each.forces[k] for each in samples], dtype=float)
        size = np.where(regular, scaled if turns else scaled / length, np.nan)
        rate = along(joint_motion(scene, motion, joint.name), joint.facts.driven or ANGLE)[1]
        marks = np.array([each.is_open[k] for each in samples], dtype=int)
        found[joint.name] = MotorMotion(
            joint.name, None if turns else size, size if turns else None, size * rate, marks
        )
    return replace(motion, motors=found)


def check_motors(scene: Scene, motors: Sequence[str]) -> None:
    """Raise InputError for joints that cannot have a motor, and for scenes without inverse dynamics."""
    if isinstance(motors, str):
        raise InputError(f"motors: needs a list of names, such as [{motors!r}], not a text")
    names = [joint.name for joint in scene.joint]
    for name in motors:
        if name not in names:
            raise InputError(
                f"motors: no joint {name!r}{meant(name, names) or '; joints: ' + ', '.join(names)}"
            )
        if not (joint := scene.joint_named(name)).facts.driven:
            able = ", ".join(DRIVABLE)
            raise InputError(f"motors: {name!r} is {joint.type}; only {able} joints can have a motor")
    if not motors or len({*motors}) < len(motors):
        raise InputError("motors: needs at least one joint, and each joint once")
    if not scene.driver:
        raise InputError(f"{scene.name} has no driver whose motion motors could cause")
    if path := turned_ball(scene):
        raise InputError(
            f"{path}: inverse dynamics by motors knows no driven orientation; {EQUIVALENT_HINGES}"
        )
    if path := next(intermittent(scene), ""):
        raise InputError(f"{path}: inverse dynamics needs constraints that always hold")


def _samples(
    scene: Scene, motion: Trajectory, motors: Sequence[str], forces: dict[str, np.ndarray]
) -> tuple[list[_Sample], float, int]:
    """Return the motors at each sample, the length (m) of the mechanism, and the degrees of freedom of its
    first pose."""
    model = Model(without_armatures(assembled(scene)).with_(driver=()))
    q, _, _ = coordinates(model, motion)
    q = q.reshape(len(q), model.nb, 7)
    blocks = model.terms(motion.times, q, angles=angles_from_start(model, scene, motion)).blocks
    own, others = (
        [_row(model, motion, q, model.scene.joint_named(name)) for name in each] for each in (motors, forces)
    )
    scaled = [
        size * (1.0 if scene.joint_named(name).facts.driven == ANGLE else model.length)
        for name, size in forces.items()
    ]
    found = [
        _at(
            unit_rows(model.structure.dense(blocks[k]) * model.units),
            np.array([row[k] for row in own]),
            np.array([size[k] for size in scaled])[:, None] * np.array([row[k] for row in others]),
        )
        for k in range(len(q))
    ]
    first = model.start().reshape(1, model.nb, 7)
    rows = model.terms(np.zeros(1), first).blocks[0]
    length, (basis, _) = model.length, _free(unit_rows(model.structure.dense(rows) * model.units))
    model.release()
    return found, length, basis.shape[1]


def _row(model: Model, motion: Trajectory, q: np.ndarray, joint: Joint) -> np.ndarray:
    """Return the row (k, n) of the rate of a joint's coordinate, in lengths of the mechanism or rad, for
    velocities in lengths and rad.

    An angle has the rate (ω₂ - ω₁)·a. A displacement a·d, with d from the first to the second anchor and the
    axis a on the first body, has the rate (v₂ + ω₂ × s₂)·a - (v₁ + ω₁ × (s₁ + d))·a.
    """
    first = turned_since_start(model.scene, motion, joint.bodies[0])
    axis = rotations.rotate(first, rotations.unit(joint.directions[0])[None])
    anchor = position_of(model.scene, motion, joint.bodies[1], joint.anchor_pair[1])
    linear, angular = np.zeros((2, len(q), len(model.scene.body), 3))
    for name, sign in zip(joint.bodies, (-1.0, 1.0), strict=True):
        if (b := model.scene.body_index(name)) >= 0 and joint.facts.driven == ANGLE:
            angular[:, b] += sign * axis
        elif b >= 0:
            linear[:, b] += sign * axis / model.length
            angular[:, b] += sign * rotations.cross(anchor - motion.position[:, b], axis) / model.length
    own = q[:, : len(model.scene.body), 3:]
    return np.asarray(in_frames(model, own, linear, angular) * model.units)


def _at(rows: np.ndarray, own: np.ndarray, demanded: np.ndarray) -> _Sample:
    """Return the motors with rows B (m, n), for constraint rows (c, n) and the work of each driver (d, n)."""
    basis, is_near = _free(rows)
    u, s, wt = np.linalg.svd(own @ basis)
    longest = np.linalg.norm(own, axis=1).max()
    rank = int((s > OPEN * longest).sum())
    work = basis.T @ demanded.sum(axis=0)
    part = wt[:rank] @ work
    is_open = np.linalg.norm(u[:, rank:], axis=1) > SHARE
    left = basis @ (work - wt[:rank].T @ part)
    direction = np.abs(left) / max(float(np.linalg.norm(left)), 1e-300)
    return _Sample(
        freedoms=basis.shape[1],
        rank=rank,
        is_certain=not (is_near or _is_near(s, longest)),
        forces=u[:, :rank] @ (part / s[:rank]),
        is_open=is_open,
        left=left,
        work=np.abs(work).max(initial=0.0),
        along=float((np.abs(demanded) @ direction).sum()),
    )


def _free(rows: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return a basis (n, f) of velocities that constraint rows (c, n) allow, and whether f is uncertain."""
    _, values, vt = np.linalg.svd(rows)
    largest = values.max(initial=0.0)
    return vt[int((values > OPEN * largest).sum()) :].T, _is_near(values, largest)


def _is_near(values: np.ndarray, largest: float) -> bool:
    """Return whether a singular value is so small that its rank is uncertain, and not rounding."""
    return bool(((values > OPEN * largest) & (values <= UNCERTAIN * largest)).any())


def _refuse_missing(
    scene: Scene, motion: Trajectory, motors: Sequence[str], samples: Sequence[_Sample | None]
) -> None:
    """Raise InputError if the motors cannot do the work of the drivers at a sample; None is undecided."""
    largest = max((each.work for each in samples if each), default=0.0)
    for t, each in zip(motion.times, samples, strict=True):
        if each is None or np.linalg.norm(each.left) <= max(LEFT * largest, LEFT_ALONG * each.along):
            continue
        speeds = np.linalg.norm(each.left.reshape(-1, 6), axis=1)[: len(scene.body)]
        moved = [b.name for b, v in zip(scene.body, speeds, strict=True) if v > MOVES * speeds.max()]
        raise InputError(
            f"motors {', '.join(motors)}: cannot cause the motion at t = {t:.6g} s; with all of them at "
            f"rest {', '.join(moved)} can still move: the motors hold {each.rank} of {each.freedoms} degrees "
            "of freedom"
        )
