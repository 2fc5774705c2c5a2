"""Scenes that start at a sample of a motion: its state, its joints and loads, and later functions of time."""

from __future__ import annotations

import numpy as np

from mbref.equations.model import Model, poses
from mbref.equations.offsets import angles_at_start, assembled
from mbref.equations.placed import placed_with_springs
from mbref.input_error import InputError
from mbref.motions.joint_motion import joint_motion
from mbref.motions.trajectory import Trajectory
from mbref.scene import Load, Scene, TorsionSpring
from mbref.scene.functions import Factor
from mbref.scene.joints import ANGLE

SAME_TIME = 1e-9  # difference of times / largest sample time that is rounding of a user's number


def scene_at(scene: Scene, motion: Trajectory, t: float) -> Scene:
    """Return the scene that starts with the state of a motion at a sample time t (s); raises InputError if
    there is no such sample, or if the motion has lost count of the turns of a torsion spring."""
    k = sample_at(motion, t)
    start = assembled(scene)
    model = Model(start)
    order = [motion.bodies.index(body.name) for body in scene.body]
    q = poses(model, motion.position[k : k + 1, order], motion.orientation[k : k + 1, order])
    model.release()
    angles, turned = angles_at_start(scene), {}
    counted = [load.joint for load in scene.load if isinstance(load, TorsionSpring)]
    bent = (scene.coupled(coupling)[0] for coupling in scene.coupling if coupling.powers > 1)
    for name in counted + [joint.name for joint, coordinate in bent if coordinate == ANGLE]:
        angle = joint_motion(scene, motion, name).angle
        assert angle is not None  # such springs and couplings act on joints that turn
        turned[name] = float(angle[k]) - angles[name]
        if np.isnan(turned[name]):
            raise InputError(f"scene_at: the motion has lost count of the turns of joint {name!r}")
    placed, at = placed_with_springs(model, q[0], turned), float(motion.times[k])
    bodies = [
        body.model_copy(update={"velocity": tuple(v.tolist()), "angular_velocity": tuple(w.tolist())})
        for body, v, w in zip(
            placed.body,
            *(each[k, order] for each in (motion.velocity, motion.angular_velocity)),
            strict=True,
        )
    ]
    return placed.with_(
        body=bodies,
        driver=[driver.from_time(at) for driver in placed.driver],
        load=[_from_time(load, at) for load in placed.load],
        duration=scene.duration - at if scene.duration > at else scene.duration,
    )


def _from_time(load: Load, t: float) -> Load:
    """Return the load with a factor of the time since t (s): zero if it is switched off from then on, so that
    all loads keep their places."""
    if load.over_time is None:
        return load
    factor = load.over_time.from_time(t) or Factor(polynomial=(0.0,))
    return load.model_copy(update={"factor": factor})


def sample_at(motion: Trajectory, t: float) -> int:
    """Return the index of the sample at t (s); raises InputError that names the nearest one."""
    if not motion.times.size:
        raise InputError("scene_at: the motion has no sample; simulate it with sample times")
    k = int(np.abs(motion.times - t).argmin())
    if not abs(motion.times[k] - t) <= SAME_TIME * max(1e-300, float(motion.times[-1])):
        raise InputError(f"scene_at: no sample at {t:g} s; the nearest one is at {motion.times[k]:.9g} s")
    return k
