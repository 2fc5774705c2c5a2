"""Several scenes in one, so that an engine compiles its code once for all."""

from collections.abc import Mapping
from typing import Any

from mbref.scene import Scene


def side_by_side(scenes: Mapping[str, Scene], gravity: tuple[float, float, float]) -> Scene:
    """All scenes in one over 0.1 s; parts have the scene's key before their own name."""
    parts: dict[str, list] = {"body": [], "joint": [], "coupling": [], "driver": [], "load": []}
    for name, scene in scenes.items():

        def renamed(value: Any, name: str = name) -> Any:
            return value if value == "ground" else f"{name} {value}"

        for kind, found in parts.items():
            for part in getattr(scene, kind):
                fields = part.model_dump(exclude_none=True)
                for field in {"name", "body", "joint"} & set(fields):
                    fields[field] = renamed(fields[field])
                for field in {"bodies", "joints"} & set(fields):
                    fields[field] = [renamed(value) for value in fields[field]]
                found.append(fields)
    return Scene(name="side_by_side", gravity=gravity, duration=0.1, **parts)
