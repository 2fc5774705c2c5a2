"""Faults of the mass, inertia, shape and density of a body, which depend on each other."""

from __future__ import annotations

from typing import Any

from mbref.scene.fields import field_of, is_some
from mbref.scene.function_faults import Faults


def mass_faults(path: str, body: Any) -> Faults:
    """Yield mass, inertia, shape and density of a body that are missing, or contradict each other."""
    mass, inertia, shape, density = (field_of(body, key) for key in ("mass", "inertia", "shape", "density"))
    if shape is None and density is not None:
        yield f"{path}.shape", "is missing; a density needs a shape"
    elif shape is not None and inertia is not None:
        yield f"{path}.inertia", "follows from the shape; give one of them"
    elif shape is not None and (mass is None) == (density is None):
        wrong = "is missing; a shape needs mass or density" if mass is None else "or density, not both"
        yield f"{path}.mass", wrong
    elif density is not None and field_of(shape, "type") == "rod":
        yield f"{path}.density", "needs a volume, which a thin rod has not; give its mass, or use a cylinder"
    elif shape is None and (mass is None) != (inertia is None):
        missing = "inertia" if inertia is None else "mass"
        yield f"{path}.{missing}", "is missing; give mass and inertia, or neither (kinematics)"
    elif mass == 0 and is_some(inertia):
        yield f"{path}.mass", "is 0, but the inertia is not; a massless link has neither"
