"""The model that MuJoCo compiles from an MJCF file or a URDF, its base and its extent."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing import holding, urdf
from mbref.files import content
from mbref.formats import ImportOptions
from mbref.scene import GROUND, SceneError

UNKNOWN = "Schema violation: unrecognized"  # words of MuJoCo about an element or attribute
SMALLEST = 1e-9  # m; extent of a model that is a rounding error


def compiled(mujoco: Any, path: Path, options: ImportOptions) -> tuple[Any, urdf.Text | None, list[str]]:
    """Return the compiled model, the text of a URDF, and notes."""
    try:
        if path.suffix != ".urdf":
            content(path)  # raises OSError for a missing file, which MuJoCo does not
            model, notes = holding.compiled(mujoco, path, options.hold, options.keyframe)
            return model, None, notes
        text = urdf.prepared(content(path), options.hold, str(path))
        model = mujoco.MjModel.from_xml_string(text.text)
    except ValueError as error:
        said = " ".join(str(error).split())
        older = f"; MuJoCo {mujoco.__version__} does not have it, older versions may"
        raise SceneError([f"{path}: MuJoCo cannot read it: {said}{older * (UNKNOWN in said)}"]) from None
    text.take_back(mujoco, model)
    return model, text, []


def root_link(text: urdf.Text | None) -> str:
    """Return the link of a URDF that no joint carries, which MuJoCo fixes to the world."""
    if text is None:
        return GROUND
    return urdf.urdf_faults.base(text.root) or GROUND


def extent_of(mujoco: Any, model: Any) -> float:
    """Return the largest distance along an axis between centres of mass and joints at the reference position
    (m); 1 m where all of them are at one place."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = float(np.ptp(np.vstack([data.xipos, data.xanchor]), axis=0).max())
    return found if found > SMALLEST else 1.0
