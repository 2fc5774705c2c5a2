"""Rows, redundant rows and degrees of freedom by the judge / scenes worked out by hand."""

from crosscheck.judge.mobility import mobility
from mbref.scene import GROUND, Body, Distance, Revolute, Scene


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
