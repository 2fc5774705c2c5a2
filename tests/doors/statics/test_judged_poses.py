"""Equilibria that the judge finds: indifferent ones, singular positions and slow motions, by closed forms."""

import numpy as np
import pytest

from crosscheck.judge.small_motions.equilibria import steady_poses
from mbref import Scene
from tests.helpers.statics import DOWN, G, parallelogram, pendulum, rod, slide


def test_weights_in_balance_at_every_height_are_one_indifferent_equilibrium():
    """Two weights of 1.5 kg hang on one rope over a pulley; three starts find one equilibrium."""
    places, rope = {"a": (0.0, 0.0, 0.0), "b": (0.8, -0.2, 0.0)}, {"joints": ["A", "B"], "ratio": -1.0}
    bodies = [rod(name, place, 1.5) for name, place in places.items()]
    joints = [slide(name.upper(), name, place, (0.0, 1.0, 0.0)) for name, place in places.items()]
    parts = {"body": bodies, "joint": joints, "coupling": [{"name": "rope", **rope}]}
    weights = Scene(name="weights", gravity=DOWN, **parts)
    assert [each.stability for each in steady_poses(weights, starts=3)] == ["indifferent"]


def test_flat_parallelogram_at_a_singular_position_is_left_out_and_a_hanging_one_is_found():
    """All links of the flat one lie along gravity, so that it rests; but a singular position has no small
    motions to judge. The other's cranks start 13° from their equilibrium below the pivots."""
    flat = parallelogram(sine=0.0, cosine=1.0).with_(gravity=(G, 0.0, 0.0))
    assert not steady_poses(flat, starts=1)
    hanging = parallelogram(sine=-0.96, cosine=0.28)
    assert [each.stability for each in steady_poses(hanging, starts=1)] == ["stable"]


def test_slow_fall_of_a_pendulum_is_found_beside_a_damper_millions_of_times_faster():
    """The pendulum falls with √(m g l / (J + m l²)) = 3.3 1/s, and a block of 0.1 g is damped with
    c / m = 8e6 1/s. The error of the slow eigenvalue is at most the judge's bound, which is below 1e-9 1/s,
    and the rounding of the closed form, 4e-16 of it."""
    beside = pendulum((0.0, 0.7, 0.0))
    damper = {"type": "slide_spring", "joint": "T", "stiffness": 50.0, "damping": 800.0}
    scene = beside.with_(
        body=(*beside.body, rod("block", (1.0, 0.0, 0.0), 1e-4)),
        joint=(*beside.joint, slide("T", "block", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
        load=[damper],
    )
    found = {each.stability: each for each in steady_poses(scene, starts=4)}
    assert set(found) == {"stable", "unstable"}
    rate = np.sqrt(2.0 * G * 0.7 / (0.3 + 2.0 * 0.49))
    near = int(np.argmin(np.abs(found["unstable"].eigenvalues - rate)))
    error = np.abs(found["unstable"].eigenvalues[near] - rate)
    assert error <= found["unstable"].bounds[near] + 4e-16 * rate
    assert found["unstable"].bounds[near] == pytest.approx(0.0, abs=1e-9)
