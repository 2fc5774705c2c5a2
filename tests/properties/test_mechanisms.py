"""Random mechanisms: mbref's motion and reactions against the judge's equations, work and energy."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from crosscheck.conformance.changes.replays import started
from crosscheck.conformance.strategies import matrices, mechanisms
from crosscheck.conformance.trial import difference
from crosscheck.judge.constraints import initial_poses, jacobian, scene_length
from crosscheck.judge.energy import energy_series
from crosscheck.judge.gauss_motion import accelerations, gauss_motion
from crosscheck.judge.gauss_principle import goes_on, singular_values
from crosscheck.judge.reaction_balance import balance, idle
from crosscheck.judge.tolerances import RANK
from crosscheck.judge.violations import violation_series
from mbref import Limits, rotations, simulate
from mbref.design.diagnosis import diagnose
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

METHOD = "taylor"
NEAR = 1e-4  # least singular value below which a scene counts as at a singular position
EXACT = 1e-7  # relative error of equations at a state: 1000 rtol
MOVED = 1e-6  # of motions, relative to the length of the scene: 10 000 rtol, as motions may be sensitive


def is_regular(scene: Scene) -> bool:
    """Return whether a scene is not singular, and its velocities do not vanish at second order."""
    values = singular_values(scene)
    return bool(np.all((values < RANK * values[0]) | (values > NEAR * values[0]))) and goes_on(scene)


def run(scene: Scene, samples: int = 3) -> Trajectory:
    """Return mbref's motion; assert that it completed."""
    found = simulate(scene, METHOD, np.linspace(0.0, scene.duration, samples), Limits(rtol=1e-10))
    assert found.outcome is Outcome.COMPLETED, f"{found.outcome} {found.message}: {scene}"
    return found


def state(motion: Trajectory, k: int) -> tuple[np.ndarray, ...]:
    """Return positions, orientations and both velocities at a sample, without torsion springs."""
    names = ("position", "orientation", "velocity", "angular_velocity")
    return *(getattr(motion, name)[k] for name in names), np.zeros(0)


@given(mechanisms())
def test_samples_satisfy_constraints_gauss_s_principle_and_the_balance_of_reactions(scene):
    """The judge checks each sample by equations of its own: constraints on positions, velocities and
    accelerations, accelerations by Gauss's principle, Newton's and Euler's balances with reactions, and their
    virtual work, zero. Errors are below EXACT; accelerations, which are less exact near singular positions
    (down to NEAR), below EXACT / √NEAR."""
    assume(is_regular(scene))
    motion = run(scene)
    pace = max(1.0, float(np.abs(motion.angular_velocity).max()))
    for level in (0, 1, 2):
        off = float(violation_series(scene, motion, level).max())
        assert off < EXACT * pace**level, f"joints are off by {off:.1e} at level {level}: {scene}"
    assert balance(scene, motion, motion) < EXACT, f"reactions do not move the bodies: {scene}"
    assert idle(scene, motion, motion) < EXACT, f"a reaction acts along a freedom: {scene}"
    for k in range(len(motion.times)):
        found = np.hstack([motion.acceleration[k], motion.angular_acceleration[k]])
        least = accelerations(scene, float(motion.times[k]), state(motion, k))
        scale = max(1.0, np.abs(least).max())
        assert np.abs(found - least).max() < EXACT * scale / np.sqrt(NEAR), f"Gauss's principle: {scene}"


@settings(max_examples=8)
@given(mechanisms(most_bodies=3, most_loops=1))
def test_motion_follows_gauss_s_principle_keeps_its_energy_and_returns_with_reversed_velocities(scene):
    """The judge integrates Gauss's principle of least constraint with equations of its own; motions agree to
    MOVED. Without dampers the energy is constant, to 10 MOVED, and the motion from its last state with
    reversed velocities ends at its start."""
    assume(is_regular(scene))
    motion = run(scene, 9)
    exact = gauss_motion(scene, tuple(motion.times.tolist()))
    apart = difference(scene, motion, exact)
    assert apart < MOVED, f"mbref and Gauss's principle differ by {apart:.1e}: {scene}"
    drift = energy_series(scene, motion)
    assert drift is None or drift.max() < 10 * MOVED, f"energy drifts by {drift.max():.1e}: {scene}"
    back = run(started(scene, motion, len(motion.times) - 1, -1.0, scene.duration), 9)
    position, orientation = back.position[-1] - motion.position[0], back.orientation[-1]
    turned = rotations.angle_between(orientation, motion.orientation[0]).max()
    off = max(float(np.abs(position).max()) / scene_length(scene), float(turned))
    assert off < MOVED, f"it comes back off by {off:.1e}: {scene}"


@given(mechanisms(redundant=True))
def test_joint_that_is_there_twice_counts_as_redundant(scene):
    """R repeats another joint of a random mechanism, so that its rows depend on others and its reactions are
    not unique. The rank is the number of singular values that the judge finds."""
    values = singular_values(scene)
    assume(np.all((values < RANK * values[0]) | (values > NEAR * values[0])))
    found = diagnose(scene)
    rank = int(np.sum(values > RANK * values[0]))
    assert found.counts.rank == rank, f"rank {found.counts.rank}, by the judge {rank}: {scene}"
    assert found.counts.redundant > 0 and "R" in found.redundant_by_joint, f"{found}: {scene}"
    assert "R" not in found.unique_reactions, f"{found}: {scene}"


@given(mechanisms())
def test_random_scene_has_velocities_that_its_joints_allow(scene):
    """Φ_q v = 0 by the judge's Jacobian, to rounding: 1e-12 of the largest velocity or of 1 m/s."""
    pose = initial_poses(scene)
    rows, _ = jacobian(scene, 0.0, *pose)
    twists = np.array([[*body.velocity, *body.angular_velocity] for body in scene.body]).ravel()
    assert np.abs(rows @ twists).max(initial=0.0) < 1e-12 * max(1.0, np.abs(twists).max()), scene


@given(st.integers(0, 5), st.data())
def test_random_matrices_have_the_requested_rank_and_spectrum(rank, data):
    """NumPy finds the singular values of random matrices: as many as the rank, or 3 and 0.001, which are
    requested. Rounding is 1e-12 (absolute), and 1e-9 relative to 0.001."""
    matrix = data.draw(matrices(rank=rank))
    assert np.linalg.matrix_rank(matrix, rtol=1e-9) == rank, matrix.shape
    spectrum = (3.0, 1e-3)
    values = np.linalg.svd(data.draw(matrices(spectrum=spectrum)), compute_uv=False)
    assert values[:2] == pytest.approx(spectrum, rel=1e-9) and np.all(values[2:] < 1e-12), values
