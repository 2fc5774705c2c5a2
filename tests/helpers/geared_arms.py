"""Two arms on parallel hinges, with or without gears between them."""

from mbref.scene import Scene
from tests.helpers.parts import hinge


def arms(size: float, coupled: bool = False) -> Scene:
    """Return two arms of the length ``size`` (m) on hinges about z, geared 2 : 1 if they are coupled."""
    places = {"a": 0.0, "b": size}
    arm = {"mass": 1.0, "inertia": [1.0, 1.0, 1.0]}
    bodies = [{"name": name, "position": [size, at, 0.0], **arm} for name, at in places.items()]
    hinges = [hinge(f"hinge of {name}", "ground", name, (0.0, at, 0.0)) for name, at in places.items()]
    gears = {"name": "gears", "joints": [each["name"] for each in hinges], "ratio": 2.0}
    return Scene(name="arms", body=bodies, joint=hinges, coupling=[gears] * coupled)
