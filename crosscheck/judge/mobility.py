"""Constraint rows, redundant rows and degrees of freedom of a scene, by the judge's own equations."""

from __future__ import annotations

from typing import NamedTuple

from crosscheck.judge.gauss_principle import rank_of, singular_values
from crosscheck.judge.pieces import at_start
from mbref.scene import Scene


class Mobility(NamedTuple):
    """Numbers of rows of joints, drivers and couplings, of rows that depend on others, and of degrees of
    freedom, at t = 0."""

    rows: int
    redundant: int
    degrees_of_freedom: int


def mobility(scene: Scene) -> Mobility:
    """Return the mobility of a scene at its start, where anchors of joints coincide, and of the joints and
    couplings that hold there."""
    scene = at_start(scene)
    if not scene.joint:
        return Mobility(0, 0, 6 * len(scene.body))
    rows, rank = row_count(scene), rank_of(singular_values(scene))
    return Mobility(rows, rows - rank, 6 * len(scene.body) - rank)


def row_count(scene: Scene) -> int:
    """Return the number of rows of joints, drivers and couplings."""
    driven = sum(driver.rows for driver in scene.driver)
    return sum(joint.facts.rows for joint in scene.joint) + driven + len(scene.coupling)
