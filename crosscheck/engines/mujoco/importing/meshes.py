"""MJCF files without their meshes and pictures: shapes that do not act on a motion are left out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mbref.scene import SceneError

SHOWN = 3  # names of files in a note


def without_missing(mujoco: Any, spec: Any) -> list[str]:
    """Delete meshes, height fields, skins and pictures whose files are missing, and the geoms made of them.

    Returns a note that names the files. Raises SceneError if the inertia of a body follows from such a geom.
    """
    shapes = [a for a in (*spec.meshes, *spec.hfields) if _is_missing(spec, a.file, spec.meshdir)]
    others = [a for a in spec.skins if _is_missing(spec, a.file, spec.meshdir)]
    pictures = [a for a in spec.textures if _is_missing(spec, a.file, spec.texturedir)]
    files = [Path(a.file).name for a in (*shapes, *others, *pictures)]
    names = {a.name or Path(a.file).stem for a in shapes}
    for body in spec.bodies:
        for geom in [g for g in body.geoms if {g.meshname, g.hfieldname} & names]:
            if _has_inertia(mujoco, spec, body, geom):
                file = geom.meshname or geom.hfieldname
                raise SceneError(
                    [
                        f"body {body.name!r}: its inertia follows from the shape {file!r}, whose file is "
                        f"missing; put the file into {_folder(spec, spec.meshdir)}"
                    ]
                )
            spec.delete(geom)
    gone = {a.name for a in pictures}
    for material in [m for m in spec.materials if gone & set(m.textures)]:
        for geom in spec.geoms:
            if geom.material == material.name:
                geom.material = ""
        spec.delete(material)
    for asset in (*shapes, *others, *pictures):
        spec.delete(asset)
    return list(_notes(files))


def _notes(files: list[str]) -> Iterator[str]:
    if files:
        more = f" and {len(files) - SHOWN} more" if len(files) > SHOWN else ""
        yield f"files that are missing: {', '.join(files[:SHOWN])}{more}; these shapes have no effect"


def _is_missing(spec: Any, file: str, folder: str) -> bool:
    return bool(file) and not (_folder(spec, folder) / file).is_file()


def _folder(spec: Any, folder: str) -> Path:
    return Path(spec.modelfiledir) / folder


def _has_inertia(mujoco: Any, spec: Any, body: Any, geom: Any) -> bool:
    """Return whether the compiler computes the inertia of a body from a geom."""
    use, rule = spec.compiler.inertiafromgeom, mujoco.mjtInertiaFromGeom
    if use == rule.mjINERTIAFROMGEOM_FALSE or (use == rule.mjINERTIAFROMGEOM_AUTO and body.explicitinertial):
        return False
    low, high = spec.compiler.inertiagrouprange
    is_light = geom.mass == 0 or (np.isnan(geom.mass) and geom.density == 0)
    return low <= geom.group <= high and not is_light and body.name != "world"
