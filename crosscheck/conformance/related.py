"""Metamorphic check: an engine's motion of a changed scene is the expected one."""

from __future__ import annotations

from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.changes.relations import RELATIONS, Relation
from crosscheck.conformance.trial import OWN_ACCURACY, Bench, Broken, Finding, completed, difference
from crosscheck.engine import Cannot
from crosscheck.judge.metrics import in_scene_order
from crosscheck.judge.push_difference import pushes_apart
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene, SceneError


def related(name: str, bench: Bench) -> Finding | Cannot | Outside:
    """Compare motion, accelerations and unique reactions of the changed scene with the expected ones."""
    relation = RELATIONS[name]
    scene = changed(relation, bench)
    if isinstance(scene, Outside):
        return scene
    if cannot := bench.refuses(scene):
        return cannot
    expected = in_scene_order(scene, relation.expect(bench.scene, bench.motion))
    found = bench.run(scene, expected.times)
    poses = Finding(difference(scene, expected, found), bench.own_accuracy, bench.floors)
    if poses.measured > poses.allowed:
        poses = poses._replace(allowed=max(poses.allowed, _accuracy_of(bench, scene, found)))
    apart, of = pushes_apart(scene, expected, found, bench.rank)
    pushes = Finding(apart, bench.own_pushes, f"of {of}")
    return max(poses, pushes, key=lambda finding: finding.measured / finding.allowed)


def _accuracy_of(bench: Bench, scene: Scene, run: Trajectory) -> float:
    """Return `Bench.own_accuracy` of a changed scene from its two finest settings; 0 for only one setting."""
    if len(bench.settings) < 2:
        return 0.0
    coarser = bench.observed(scene, run.times, bench.settings[-2]).value
    return OWN_ACCURACY * difference(scene, run, completed(scene, coarser, len(run.times)))


def changed(relation: Relation, bench: Bench) -> Scene | Outside:
    """Return the changed scene; raises Broken if its initial state is not valid."""
    try:
        return relation.change(bench.scene, bench.motion)
    except (SceneError, ValueError) as fault:
        raise Broken(f"its motion makes no valid scene: {fault}") from None
