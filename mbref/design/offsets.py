"""Offsets of couplings: a scene moved to the poses at which its motion starts."""

from __future__ import annotations

import functools

import numpy as np

from mbref.design.placed import placed_with_springs
from mbref.equations.gaps import gaps
from mbref.equations.initial_state import solve_positions
from mbref.equations.joint_angles import angles_by_joint, angles_of_pose
from mbref.equations.model import Model
from mbref.scene import Scene, SceneError

# largest rotation (rad), or displacement over the mechanism's length, in one of the equal parts of a change,
# so that angles stay below half a turn and loops on their branch
LARGEST_PART = 0.2
MOST_PARTS = 1024  # limit of time: some seconds
MET_OFFSET = 1e-12  # gap (lengths of the mechanism, or rad) that rounding may leave


def assembled(scene: Scene) -> Scene:
    """Return a scene with offsets of couplings at poses that obey them (see ``Scene.assembled``)."""
    return _at_offsets(scene)[0]


def angles_at_start(scene: Scene) -> dict[str, float]:
    """Return the angle, rad, by joint that turns about one axis, from the poses that the scene gives to the
    poses that obey its offsets; full turns count."""
    if not any(coupling.offset for coupling in scene.coupling):
        return {joint.name: 0.0 for joint in scene.joint if joint.facts.turns}
    return _at_offsets(scene)[1]


@functools.lru_cache(maxsize=64)
def _at_offsets(scene: Scene) -> tuple[Scene, dict[str, float]]:
    """Return the scene at poses that obey its offsets, and the angles of joints from the given poses."""
    offsets = {c.name: c.offset / max(1.0, abs(c.ratio)) for c in scene.coupling}
    found = scene.with_(coupling=[c.model_copy(update={"offset": 0.0}) for c in scene.coupling])
    angles = {joint.name: 0.0 for joint in scene.joint if joint.facts.turns}
    value = np.array([offsets.get(name, 0.0) for name in Model(found).row_joint])
    parts = 1
    while parts < MOST_PARTS and not _is_near(found, value / parts):
        parts *= 2
    for part in range(parts):
        model = Model(found)
        q, residual = solve_positions(model, 0.0, model.start(), value / parts)
        gap = gaps(model.terms(0.0, q).less(value / parts), model.length)
        if not gap.max(initial=0.0) <= MET_OFFSET:
            raise SceneError([_unmet(scene, model, residual, part / parts)])
        steps = angles_by_joint(found, model.structure, angles_of_pose(model, q)[None])
        angles = {name: angle + float(steps[name][0]) for name, angle in angles.items()}
        found = placed_with_springs(model, q)
    return found, angles


def _is_near(scene: Scene, value: np.ndarray) -> bool:
    """Return whether Φ = value (m,) is obeyed by poses near the scene's, up to LARGEST_PART."""
    model = Model(scene)
    q, _ = solve_positions(model, 0.0, model.start(), value)
    moved = np.abs((q - model.start()).reshape(-1, 7))
    return bool(moved[:, :3].max() <= LARGEST_PART * model.length and moved[:, 3:].max() <= LARGEST_PART / 2)


def _unmet(scene: Scene, model: Model, residual: np.ndarray, share: float) -> str:
    worst = model.row_joint[int(np.argmax(np.abs(residual)))]
    names = ", ".join(f"{c.name} ({c.offset:g})" for c in scene.coupling if c.offset)
    return (
        f"coupling: no pose obeys the offsets of {names}; after {100 * share:.0f} % of them "
        f"{np.abs(residual).max():.3g} m or rad remain open at {worst!r}"
    )
