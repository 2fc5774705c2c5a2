"""Rows, redundant rows and degrees of freedom / mbref's counts, and scenes worked out by hand."""

import pytest

import mbref
from crosscheck.judge.mobility import mobility
from mbref.scene import GROUND, Body, Distance, Revolute, Scene
from tests.helpers.coupled_mechanisms import coupled_loops, gear_pair, pendulum, screw


@pytest.mark.parametrize("make", [gear_pair, screw, pendulum, coupled_loops])
def test_coupling_is_a_constraint_row_and_an_armature_is_none(make):
    """The judge's rows, redundant rows and freedoms are mbref's, except for rows of rotors: in mbref each
    armature is a hidden body with six coordinates and as many rows."""
    scene = make()
    counts, found = mbref.counts(scene), mobility(scene)
    rotors = sum(bool(joint.armature) for joint in scene.joint if hasattr(joint, "armature"))
    assert found.degrees_of_freedom == counts.degrees_of_freedom and found.redundant == counts.redundant
    assert found.rows == counts.rows - 6 * rotors


def test_mobility_of_four_small_scenes_is_as_counted_by_hand():
    """(rows, redundant rows, freedoms): a free body; a pendulum, by five rows; a boom that a rope holds; a
    hinge and its copy, whose five rows are redundant."""
    body = Body(name="rod", mass=1.0, inertia=(0.1, 0.1, 0.1), position=(1.0, 0.0, 0.0))
    free = Scene(name="free", body=[body])
    hinge = Revolute(name="A", bodies=(GROUND, "rod"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    rope = Distance(name="rope", bodies=(GROUND, "rod"), anchors=((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    assert mobility(free) == (0, 0, 6)
    assert mobility(free.with_(joint=[hinge])) == (5, 0, 1)
    assert mobility(free.with_(joint=[hinge, rope])) == (6, 0, 0)
    assert mobility(free.with_(joint=[hinge, hinge.model_copy(update={"name": "B"})])) == (10, 5, 1)
