"""Properties of a scene on which the choice of a method depends."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from mbref.rotations import Vector3
from mbref.scene.fields import COINCIDENT
from mbref.scene.interval_faults import COMES_AND_GOES
from mbref.scene.loads import Spring
from mbref.scene.references import GROUND
from mbref.scene.validation import SceneError

if TYPE_CHECKING:
    from mbref.scene.scene import Scene

# mechanism that moves like a ball joint with a driven orientation
EQUIVALENT_HINGES = "three driven hinges with links of mass 0 between them move alike"
SAME_DIRECTION = 1e-12  # 1 - cosine of the angle of axes that count as parallel


def intermittent(scene: Scene) -> Iterator[str]:
    """Yield the path of each field by which a joint or coupling comes and goes, such as
    ``joint[latch].active``, and of each end stop."""
    for key, entries in (("joint", scene.joint), ("coupling", scene.coupling)):
        for each in entries:
            given = [field for field in COMES_AND_GOES if getattr(each, field) is not None]
            yield from (f"{key}[{each.name}].{field}" for field in given)
    yield from (f"joint[{joint.name}].stop" for joint in scene.joint if joint.end_stop)


def refuse_intervals(scene: Scene) -> None:
    """Raise SceneError for the first constraint with intervals, where only one set of constraints can be."""
    for path in intermittent(scene):
        why = "only motions have intervals, conditions and stops (mbref run, plot, animate)"
        raise SceneError([f"{path}: {why}; remove them here"])


def refuse_rolling(scene: Scene, what: str) -> None:
    """Raise SceneError if a wheel rolls without slip, for a feature, such as "equilibria", that needs
    constraints between positions."""
    if wheel := rolling_wheel(scene):
        why = (
            f"a wheel that rolls without slip constrains velocities, and {what} need constraints of positions"
        )
        raise SceneError([f"joint[{wheel}]: {why}"])


def rolling_wheel(scene: Scene) -> str:
    """Return the name of the first joint whose constraints are not integrable; empty if there is none."""
    return next((joint.name for joint in scene.joint if joint.facts.velocity_rows), "")


def refuse_turned(scene: Scene, what: str) -> None:
    """Raise SceneError if a driver prescribes the orientation of a ball joint, for a feature, such as
    "equilibria", that has no equations of it."""
    if path := turned_ball(scene):
        raise SceneError([f"{path}: {what} know no driven orientation; {EQUIVALENT_HINGES}"])


def turned_ball(scene: Scene) -> str:
    """Return the path of the turns of the first driven ball joint; empty if there is none."""
    return next((f"driver[{driver.joint}].turn" for driver in scene.driver if driver.turn), "")


def has_massless(scene: Scene) -> bool:
    """Return whether a body has mass or inertia of zero, so that M has no inverse."""
    return any(body.mass == 0.0 or not np.any(body.inertia) for body in scene.body if body.mass is not None)


def orientations(scene: Scene) -> int:
    """Return the number of different orientations of bodies: joints without rotation make two of them
    equal."""
    same = {body.name: body.name for body in scene.body} | {GROUND: GROUND}

    def first(name: str) -> str:
        while same[name] != name:
            name = same[name]
        return name

    for joint in scene.joint:
        if not joint.facts.free_rotations:
            one, other = map(first, joint.bodies)
            same[other] = one
    return len({first(body.name) for body in scene.body} - {first(GROUND)})


def has_parallel_axes(scene: Scene) -> bool:
    """Return whether all axes about which joints turn are parallel."""
    axes = [joint.directions[0] for joint in scene.joint if joint.facts.turns]
    if not axes:
        return False
    unit = np.array(axes) / np.linalg.norm(axes, axis=1)[:, None]
    return bool((np.abs(unit @ unit[0]) > 1.0 - SAME_DIRECTION).all())


def bushings(scene: Scene) -> list[int]:
    """Return the numbers of the damped springs whose ends coincide at the start.

    The direction of the damping force is not defined there, so that `taylor` has no series of it.
    """
    return [
        k
        for k, load in enumerate(scene.load)
        if isinstance(load, Spring) and load.damping > 0.0 and _coincide(*load.points)
    ]


def without_series(scene: Scene) -> str:
    """Return the path of the first entry of which `taylor` has no series, and why; empty if there is none."""
    if wheel := rolling_wheel(scene):
        return f"joint[{wheel}]: the velocities of a wheel that rolls without slip have no series"
    if path := turned_ball(scene):
        return f"{path}: a driven orientation has no series"
    for k in bushings(scene):
        return (
            f"the ends of the damped spring load[{k}] coincide at the start, so that its force has no series"
        )
    return ""


def _coincide(first: Vector3, second: Vector3) -> bool:
    """Return whether two points are equal up to rounding of their coordinates."""
    size = max(map(abs, (*first, *second)))
    return max(abs(a - b) for a, b in zip(first, second, strict=True)) <= COINCIDENT * size
