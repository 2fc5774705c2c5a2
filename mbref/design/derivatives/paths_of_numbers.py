"""Paths of numbers of a scene: their values and units."""

from __future__ import annotations

import re
from typing import Any

from mbref.scene import Scene, SceneError
from mbref.scene.paths import located_at

UNITS = {  # by field
    **dict.fromkeys(("mass",), "kg"),
    **dict.fromkeys(("inertia",), "kg m²"),
    **dict.fromkeys(("anchor", "anchors", "position", "point", "points"), "m"),
    **dict.fromkeys(("natural_length", "natural_displacement", "displacement(0)"), "m"),
    **dict.fromkeys(("velocity", "displacement_rate(0)"), "m/s"),
    **dict.fromkeys(("angular_velocity", "rate(0)", "frequency"), "rad/s"),
    **dict.fromkeys(("natural_angle", "phase", "angle(0)"), "rad"),
    **dict.fromkeys(("moment", "torque"), "N m"),
    "force": "N",
    "gravity": "m/s²",
}
UNITS_OF_TURNS = {"stiffness": "N m/rad", "damping": "N m s/rad", "armature": "kg m²"}
OF_SLIDES = ("spring", "slide_spring", "point_damper", "translational")  # entries with UNITS_OF_SLIDES
UNITS_OF_SLIDES = {"stiffness": "N/m", "damping": "N s/m", "armature": "kg"}


def unit_of_number(scene: Scene, label: str) -> str:
    """Return the SI unit of a number; empty for ratios, and for coefficients of functions of time. Raises
    SceneError for a path without a field."""
    fields = re.findall(r"(?:^|\.)([a-z_]+(?:\(0\))?)", re.sub(r"\.[xyz]$", "", label))
    if not fields:
        raise SceneError([f"{label}: the scene has no number at this path"])
    field = fields[-1]
    if field not in UNITS_OF_TURNS:
        return UNITS.get(field, "")
    number_at(scene, label)
    slides = _at(scene, label.rpartition(".")[0]).type in OF_SLIDES
    return (UNITS_OF_SLIDES if slides else UNITS_OF_TURNS)[field]


def number_at(scene: Scene, path: str) -> float:
    """Return the number at a path; raises SceneError if there is none."""
    value = _at(scene, path)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SceneError([f"{path}: the scene has no number at this path"])
    return float(value)


def _at(scene: Scene, path: str) -> Any:
    """Return the entry or value of a scene at a path; raises SceneError if there is none."""
    return located_at(dict(scene), path)[0]
