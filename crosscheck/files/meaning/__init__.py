"""The machine that a file means by the specification of its format.

URDF and SDF are read here, from the XML alone. MJCF is defined by MuJoCo's XML reference together with its
compiler, so that MuJoCo's compiled model is the meaning of an MJCF file.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from crosscheck.engines.loaders.loader import MJCF, SDF, URDF
from crosscheck.engines.loaders.machine import Machine
from crosscheck.engines.loaders.mujoco import compiled
from crosscheck.engines.shared import xml_files
from crosscheck.files.meaning import sdf, urdf
from mbref.scene import SceneError
from mbref.scene.fields import LARGEST

FORMS = {"mujoco": MJCF, "mujocoinclude": MJCF, "robot": URDF, "sdf": SDF}
USD = (".usd", ".usda", ".usdc", ".usdz")
SOURCES = {
    URDF: "the specification of URDF (wiki.ros.org/urdf/XML)",
    SDF: "the specification of SDFormat (sdformat.org/spec)",
    MJCF: "MuJoCo's XML reference, as MuJoCo compiles it",
}


def form_of(path: Path) -> str:
    """Return the format of a file by its root element; raises SceneError, OSError."""
    if path.suffix.lower() in USD:
        raise SceneError([f"{path}: is USD, which crosscheck does not read; export it as MJCF, URDF or SDF"])
    root = xml_files.parsed(path)
    if root.tag not in FORMS:
        known = ", ".join(f"<{tag}> ({form})" for tag, form in FORMS.items() if tag != "mujocoinclude")
        raise SceneError([f"{path}: begins with <{root.tag}>, which is none of {known}"])
    return FORMS[root.tag]


def meant(path: Path, form: str) -> Machine:
    """Return the machine that a file means; raises SceneError for a faulty file, OSError."""
    machine = _meant(path, form)
    if faults := list(_too_large(machine)):
        raise SceneError([f"{path}: {fault}" for fault in faults])
    return machine


def _too_large(machine: Machine) -> Iterator[str]:
    """Yield numbers whose products exceed floating-point numbers; a limit of a joint multiplies nothing."""
    parts: tuple[Any, ...] = (machine.bodies, machine.joints, machine.loops or (), machine.couplings or ())
    for part in itertools.chain.from_iterable(parts):
        for name, value in vars(part).items():
            largest = max(_sizes(value), default=0.0)
            if largest > LARGEST and name not in ("lower", "upper"):
                yield f"{part.name}: {name} must be at most {LARGEST:g} in size, got {largest:g}"


def _sizes(value: Any) -> Iterator[float]:
    """Yield the sizes of the numbers in nested tuples."""
    if isinstance(value, tuple):
        for entry in value:
            yield from _sizes(entry)
    elif isinstance(value, float):
        yield abs(value)


def _meant(path: Path, form: str) -> Machine:
    if form == MJCF:
        try:
            return compiled(path)
        except ValueError as error:
            raise SceneError([f"{path}: MuJoCo cannot read it: {' '.join(str(error).split())}"]) from None
        except ImportError:
            raise SceneError(["MJCF needs MuJoCo: pip install 'mbref[engines]'"]) from None
    root = xml_files.parsed(path)
    return urdf.meant(root, str(path)) if form == URDF else sdf.meant(root, path)
