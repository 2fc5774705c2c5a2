"""Offsets of couplings: a scene moved to the poses at which its motion starts."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np

from mbref.equations.couplings import largest_factor
from mbref.equations.gaps import gaps
from mbref.equations.initial_state import solve_positions
from mbref.equations.joint_angles import angles_by_joint, angles_of_pose
from mbref.equations.model import Model
from mbref.equations.placed import placed_with_springs
from mbref.equations.structure import Structure
from mbref.scene import Scene, SceneError

# largest rotation (rad), or displacement over the mechanism's length, in one of the equal parts of a change,
# so that angles stay below half a turn and loops on their branch
LARGEST_PART = 0.2
MOST_PARTS = 1024  # limit of time: some seconds
MET_OFFSET = 1e-12  # gap (lengths of the mechanism, or rad) that rounding may leave


def assembled(scene: Scene) -> Scene:
    """Return the scene at the poses at which its motion starts: they obey the offsets of its couplings.

    The bodies move by Newton steps of least mass-weighted displacement until joints, drivers and
    couplings hold, and carry joints and points of loads. The result has no offsets, and its joint
    coordinates count from the new poses. Velocities, in world axes, are unchanged. A scene without
    offsets is returned as it is.

    Parameters
    ----------
    scene : Scene
        The mechanism.

    Returns
    -------
    Scene
        The mechanism at its start, in SI units.

    Raises
    ------
    SceneError
        If no pose obeys an offset; the message names the coupling.
    """
    return _at_offsets(scene)[0] if any(c.offset for c in scene.coupling) else scene


def angles_at_start(scene: Scene) -> dict[str, float]:
    """Return the angles of joints, rad, between the given poses and the poses of ``assembled``.

    Full turns are counted. The result has every joint that turns about one axis; without offsets all
    angles are zero.

    Parameters
    ----------
    scene : Scene
        The mechanism.

    Returns
    -------
    dict of str to float
        Angle, rad, by the name of the joint.

    Raises
    ------
    SceneError
        If no pose obeys an offset; the message names the coupling.
    """
    if not any(coupling.offset for coupling in scene.coupling):
        return {joint.name: 0.0 for joint in scene.joint if joint.facts.turns}
    return _at_offsets(scene)[1]


def counted_angles(scene: Scene, structure: Structure, angles: np.ndarray) -> dict[str, np.ndarray]:
    """Return the angles (k, a) of turning joints in a run, rad, as columns (k,) by joint.

    They count from the poses that the scene gives.
    """
    start = angles_at_start(scene)
    return {name: each + start[name] for name, each in angles_by_joint(scene, structure, angles).items()}


@functools.lru_cache(maxsize=64)
def _at_offsets(scene: Scene) -> tuple[Scene, dict[str, float]]:
    """Return the scene at poses that obey its offsets, and the angles of joints from the given poses."""
    offsets = {c.name: c.offset for c in scene.coupling}
    found = scene.with_(coupling=[c.model_copy(update={"offset": 0.0}) for c in scene.coupling])
    angles = {joint.name: 0.0 for joint in scene.joint if joint.facts.turns}
    value, parts = _values(found, offsets), 1
    while parts < MOST_PARTS and not _is_near(found, value / parts):
        parts *= 2
    for part in range(parts):
        model, value = Model(found), _values(found, offsets)
        q, residual = solve_positions(model, 0.0, model.start(), value / parts)
        gap = gaps(model.terms(0.0, q).less(value / parts), model.length)
        if not gap.max(initial=0.0) <= MET_OFFSET:
            raise SceneError([_unmet(scene, model, residual, part / parts)])
        steps = angles_by_joint(found, model.structure, angles_of_pose(model, q)[None])
        angles = {name: angle + float(steps[name][0]) for name, angle in angles.items()}
        found = placed_with_springs(model, q)
    return found, angles


def _values(scene: Scene, offsets: Mapping[str, float]) -> np.ndarray:
    """Return the value (m,) that offsets by name give to each row of a scene, which is divided by its largest
    factor."""
    sizes = {coupling.name: largest_factor(coupling) for coupling in scene.coupling}
    return np.array(
        [offsets[name] / sizes[name] if name in sizes else 0.0 for name in Model(scene).row_joint]
    )


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
