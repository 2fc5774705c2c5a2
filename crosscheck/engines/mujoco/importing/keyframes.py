"""Keyframes of a model, by their names or numbers."""

from __future__ import annotations

from typing import Any

from mbref.scene import SceneError
from mbref.scene.fields import meant

SHOWN = 8  # names in a message


def number_of(mujoco: Any, model: Any, keyframe: str) -> int:
    """Return the number of a keyframe, -1 for an empty text; raises SceneError for an unknown keyframe.

    A keyframe is found by its name, otherwise by its number from 0.
    """
    if not keyframe:
        return -1
    kind = mujoco.mjtObj.mjOBJ_KEY
    found = int(mujoco.mj_name2id(model, kind, keyframe))
    if found >= 0:
        return found
    if keyframe.isascii() and keyframe.isdigit() and len(keyframe) < SHOWN and int(keyframe) < model.nkey:
        return int(keyframe)
    known = [model.key(k).name or str(k) for k in range(min(model.nkey, SHOWN))]
    more = f" and {model.nkey - SHOWN} more" if model.nkey > SHOWN else ""
    listed = (", ".join(known) or "none") + more
    raise SceneError([f"--keyframe: no keyframe {keyframe!r}; known: {listed}{meant(keyframe, known)}"])
