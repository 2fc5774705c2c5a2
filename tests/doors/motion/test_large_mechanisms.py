"""Many bodies: their largest distance, long chains in another order and frame, a long row of gears."""

import numpy as np
import pytest

from mbref import Outcome, Scene, simulate
from mbref.equations.largest_distance import largest_distances
from mbref.rotations import to_matrix
from mbref.scenes.four_bar_chain import four_bar_chain
from tests.helpers.changed_scenes import in_another_frame, in_another_order
from tests.helpers.statics import hinge, rod

N = 300
LINE, TURN = np.arange(float(N)), np.linspace(0.0, 2 * np.pi, N)
SHAPES = {
    "line": np.stack([LINE, 0 * LINE, 0 * LINE], axis=1),
    "two_rows": np.stack([LINE // 2, LINE % 2, 0 * LINE], axis=1),
    "circle": np.stack([np.cos(TURN), np.sin(TURN), 0 * TURN], axis=1),
    "ball": np.random.default_rng(2).normal(size=(N, 3)),
    "far_away": 1e6 + 1e-6 * np.random.default_rng(3).integers(0, 9, (N, 3)),
    "one_place": np.ones((N, 3)),
    "few": np.random.default_rng(4).normal(size=(7, 3)),
}
TURN_OF_FRAME, SHIFT = np.array([0.5, 0.1, -0.7, 0.5]), np.array([3.0, -2.0, 5.0])


@pytest.mark.parametrize("shape", SHAPES)
def test_largest_distance_is_the_largest_of_all_pairs(shape):
    """Here all pairs of points are compared; the function compares boxes of neighbouring points first. The
    second set has the same points in random order. One rounding, 4e-16, remains."""
    points = SHAPES[shape]
    shuffled = np.random.default_rng(5).permutation(points)
    exact = np.sqrt(((points[:, None] - points) ** 2).sum(axis=2).max())
    assert largest_distances(np.stack([points, shuffled])) == pytest.approx([exact, exact], rel=4e-16, abs=0)


STEPS = 41 * 1e-9  # m: the tolerance of the run for each of 41 bodies


def test_long_chain_moves_alike_in_another_order_and_in_a_turned_and_shifted_frame():
    """Bodies, joints and loads of 20 four-bars, 41 bodies, are listed in another order, or turned and moved.
    Positions of the latter, moved back, are those in the chain's own frame."""
    scene = four_bar_chain(20)
    scenes = scene, in_another_order(scene), in_another_frame(scene, TURN_OF_FRAME, SHIFT)
    own, ordered, moved = (simulate(each, times=[0.02]) for each in scenes)
    assert own.outcome is ordered.outcome is moved.outcome is Outcome.COMPLETED
    places = [ordered.bodies.index(name) for name in own.bodies]
    assert np.abs(ordered.position[0, places] - own.position[0]).max() <= STEPS
    moved_back = (moved.position[0] - SHIFT) @ to_matrix(TURN_OF_FRAME)
    assert np.abs(moved_back - own.position[0]).max() <= STEPS


def test_wheels_of_a_long_row_of_gears_turn_by_the_drivers_angle_with_alternating_signs():
    """A row of 80 wheels, each geared to its neighbour by -1: wheel k turns by (-1)ᵏ 0.5 t rad, t = 1 s."""
    count = 80
    body = [rod(f"wheel{k}", (float(k), 0.0, 0.0)) for k in range(count)]
    joint = [hinge(f"J{k}", ("ground", f"wheel{k}"), (float(k), 0.0, 0.0)) for k in range(count)]
    gears = [{"name": f"G{k}", "joints": (f"J{k - 1}", f"J{k}"), "ratio": -1.0} for k in range(1, count)]
    driver = [{"joint": "J0", "polynomial": (0.0, 0.5)}]
    scene = Scene(name="row", body=body, joint=joint, coupling=gears, driver=driver)
    motion = simulate(scene, "alf-dual+projection/dop853", times=[1.0])
    angles = [motion.joint(f"J{k}").angle[0] for k in range(count)]
    assert angles == pytest.approx([0.5 * (-1) ** k for k in range(count)], abs=1e-9)  # rad
