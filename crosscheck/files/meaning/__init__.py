"""The machine that a file means by the specification of its format.

URDF and SDF are read here, from the XML alone. MJCF is defined by MuJoCo's XML reference together with its
compiler, so that MuJoCo's compiled model is the meaning of an MJCF file.
"""

from __future__ import annotations

from pathlib import Path

from crosscheck.engines.loaders.loader import MJCF, SDF, URDF
from crosscheck.engines.loaders.machine import Machine
from crosscheck.engines.loaders.mujoco import Mujoco
from crosscheck.engines.shared import xml_files
from crosscheck.files.meaning import sdf, urdf
from mbref.scene import SceneError

FORMS = {"mujoco": MJCF, "mujocoinclude": MJCF, "robot": URDF, "sdf": SDF}
SOURCES = {
    URDF: "the specification of URDF (wiki.ros.org/urdf/XML)",
    SDF: "the specification of SDFormat (sdformat.org/spec)",
    MJCF: "MuJoCo's XML reference, as MuJoCo compiles it",
}


def form_of(path: Path) -> str:
    """Return the format of a file by its root element; raises SceneError, OSError."""
    root = xml_files.parsed(path)
    if root.tag not in FORMS:
        known = ", ".join(f"<{tag}> ({form})" for tag, form in FORMS.items() if tag != "mujocoinclude")
        raise SceneError([f"{path}: begins with <{root.tag}>, which is none of {known}"])
    return FORMS[root.tag]


def meant(path: Path, form: str) -> Machine:
    """Return the machine that a file means; raises SceneError for a faulty file, OSError."""
    if form == MJCF:
        try:
            return Mujoco().load(path, form).machine()
        except ValueError as error:
            raise SceneError([f"{path}: MuJoCo cannot read it: {' '.join(str(error).split())}"]) from None
        except ImportError:
            raise SceneError(["MJCF needs MuJoCo: pip install 'mbref[engines]'"]) from None
    root = xml_files.parsed(path)
    return urdf.meant(root, str(path)) if form == URDF else sdf.meant(root, path)
