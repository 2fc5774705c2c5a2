"""Two arms on parallel hinges, with or without gears between them."""

from mbref.scene import Scene
from tests.helpers.parts import hinge


def arms(size: float, coupled: bool = False) -> Scene:
    """Return two arms of the length ``size`` (m) on hinges about z, geared 2 : 1 if they are coupled."""
    return Scene(
        name="arms",
        body=[
            {"name": name, "mass": 1.0, "inertia": [1.0, 1.0, 1.0], "position": [size, at, 0.0]}
            for name, at in (("a", 0.0), ("b", size))
        ],
        joint=[
            hinge(f"hinge of {name}", "ground", name, (0.0, at, 0.0))
            for name, at in (("a", 0.0), ("b", size))
        ],
        coupling=[{"name": "gears", "joints": ["hinge of a", "hinge of b"], "ratio": 2.0}] if coupled else [],
    )
