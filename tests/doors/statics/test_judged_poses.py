"""Equilibria that the judge finds, and singular positions, which it leaves out."""

from crosscheck.judge.small_motions.equilibria import steady_poses
from tests.helpers.statics import G, parallelogram


def test_flat_parallelogram_at_a_singular_position_is_left_out_and_a_hanging_one_is_found():
    """All links of the flat one lie along gravity, so that it rests; but a singular position has no small
    motions to judge. The other's cranks start 13° from their equilibrium below the pivots."""
    flat = parallelogram(sine=0.0, cosine=1.0).with_(gravity=(G, 0.0, 0.0))
    assert not steady_poses(flat, starts=1)
    hanging = parallelogram(sine=-0.96, cosine=0.28)
    assert [each.stability for each in steady_poses(hanging, starts=1)] == ["stable"]
