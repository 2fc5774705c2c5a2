"""Bodies that are fixed to the world: robots with a free base, which would only fall without contacts, and
motion-capture bodies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing import keyframes
from crosscheck.engines.mujoco.importing.meshes import without_missing
from mbref.scene import SceneError


def compiled(mujoco: Any, path: Path, hold: Sequence[str], keyframe: str) -> tuple[Any, list[str]]:
    """Return the model of an MJCF file in which some bodies have no joint to the world, and notes.

    These and motion-capture bodies stay at the pose of the keyframe, or of the reference. Raises SceneError
    for a body without joints to the world, ValueError if MuJoCo cannot read the file.
    """
    notes: list[str] = []
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        spec = mujoco.MjSpec.from_file(str(path))
        notes = without_missing(mujoco, spec)
        model = spec.compile()
    else:
        spec = mujoco.MjSpec.from_file(str(path)) if hold else None
    if hold:
        model = _held(mujoco, spec, hold, keyframe)
    return _with_placed_mocaps(mujoco, model, keyframe), notes


def _held(mujoco: Any, spec: Any, hold: Sequence[str], keyframe: str) -> Any:
    """Return the model of a specification without the joints of some bodies to the world."""
    placed = _placed(mujoco, spec.compile(), keyframe)
    world = [body for body in spec.bodies if body.parent == spec.worldbody and body.joints]
    known = {body.name: body for body in world}
    for name in hold:
        if name not in known:
            raise SceneError(
                [
                    f"--hold {name}: is not a body that a joint connects to the ground; "
                    f"known: {', '.join(known) or 'none'}"
                ]
            )
        for joint in known[name].joints:
            spec.delete(joint)
    model = spec.compile()
    for name in hold:  # after compilation, because a position in the file may count from a frame
        body = model.body(name).id
        model.body_pos[body], model.body_quat[body] = placed.body(name).xpos, placed.body(name).xquat
    return model


def _with_placed_mocaps(mujoco: Any, model: Any, keyframe: str) -> Any:
    """Return a model whose motion-capture bodies stand where a keyframe has them."""
    key = keyframes.number_of(mujoco, model, keyframe)
    for b in np.flatnonzero(model.body_mocapid >= 0) if key >= 0 else ():
        k = int(model.body_mocapid[b])
        model.body_pos[b] = model.key_mpos[key].reshape(-1, 3)[k]
        model.body_quat[b] = model.key_mquat[key].reshape(-1, 4)[k]
    return model


def _placed(mujoco: Any, model: Any, keyframe: str) -> Any:
    """Return the data of a model at a keyframe, or at the reference without keyframe."""
    data = mujoco.MjData(model)
    key = keyframes.number_of(mujoco, model, keyframe)
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_kinematics(model, data)
    return data
