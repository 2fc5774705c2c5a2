"""Changed copies of scenes, bodies, joints, drivers and loads, and the reason if a change does not apply."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from crosscheck.judge.tolerances import ROUNDING
from mbref.scene import Scene
from mbref.scene.fields import SceneEntry, as_list

Item = TypeVar("Item", bound=SceneEntry)


@dataclass(frozen=True)
class Outside:
    """A scene to which a change or a check does not apply, with the reason."""

    reason: str


def mapped(item: Item, fields: Mapping[str, Callable[[Any], Any]]) -> Item:
    """Return a validated copy of a body, joint, driver or load. Each named field that it has is replaced by
    the value of a function."""
    given = dict(item)
    changed = {n: as_list(f(given[n])) for n, f in fields.items() if given.get(n) is not None}
    return type(item)(**{**given, **changed})


def replaced(item: Item, **fields: Any) -> Item:
    """Return a validated copy with some fields replaced."""
    return type(item)(**{**dict(item), **{name: as_list(value) for name, value in fields.items()}})


def nudged(scene: Scene, rounding: float = ROUNDING) -> Scene:
    """Return the scene with masses, gravity and positions changed by two units in the last place."""
    factor = 1.0 + 2.0 * rounding

    def grown(values: Sequence[float] | None) -> tuple[float, ...] | None:
        return None if values is None else tuple(factor * x for x in values)

    bodies = [
        body.model_copy(
            update={
                "mass": body.mass and factor * body.mass,
                "position": grown(body.position),
                "velocity": grown(body.velocity),
            }
        )
        for body in scene.body
    ]
    return scene.with_(body=tuple(bodies), gravity=grown(scene.gravity))


def weighed(scene: Scene) -> Scene:
    """Return another scene with the name of the first one: masses are twice as large, and gravity differs."""
    bodies = [body.model_copy(update={"mass": body.mass and 2 * body.mass}) for body in scene.body]
    x, y, z = scene.gravity
    return scene.with_(body=tuple(bodies), gravity=(x + 1.0, y - 2.0, z + 3.0))
