"""Exudyn's extrapolated runs through singular positions against truths, and their projection onto joints."""

import numpy as np

from crosscheck.engine import Setting
from crosscheck.engines.exudyn.adapter import ENGINE
from crosscheck.engines.exudyn.singular_crossing import UPRIGHT, extrapolated_states, projected
from crosscheck.judge.constraints import closure, closure_rates, initial_poses
from crosscheck.judge.metrics import error_series
from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.scene import Scene
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, ROUNDING

ROUGH = 1e-4  # m, and of quaternions and rates; error that is added to exact states
SINGULAR = 0.061192068340  # s, where the equal slider-crank's crank has turned to π/2


def test_exudyns_samples_at_and_next_to_a_singular_position_are_true():
    """The slider-crank with equal links has a closed form. At its singular position, 50 µs before it and 50
    µs after it the error is at most ten times the measured 2.8e-12 (of the length, or rad)."""
    scene = SCENES["planar_slider_crank_equal"]()
    times = np.array([0.03, SINGULAR - 5e-5, SINGULAR, SINGULAR + 5e-5, 0.08])
    run = ENGINE.run(scene, times, Setting("tuned", {"step": 1e-4}))
    assert np.array_equal(run.times, times), (run.times, run.message)
    errors = error_series(scene, run, truth_for(scene).poses(times))
    assert errors.max() < MARGIN * 2.8e-12, f"errors {errors} around the singular position"


def true_nodes(scene: Scene, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return exact samples (times, coordinates and rates, no force) as Exudyn's sensors would give them."""
    start, orientation = initial_poses(scene)
    exact = truth_for(scene).poses(times)
    turn = rotations.multiply(exact.orientation, rotations.conjugate(orientation))
    turn *= np.where(turn[..., :1] < 0, -1.0, 1.0)
    spin = np.concatenate([0 * exact.angular_velocity[..., :1], exact.angular_velocity], axis=-1)
    coordinates = np.concatenate([exact.position - start, turn - UPRIGHT], axis=-1)
    rates = np.concatenate([exact.velocity, rotations.multiply(spin, turn) / 2], axis=-1)
    return times, np.array([coordinates, rates, 0 * rates]), np.zeros((len(times), 0))


def test_exact_states_before_a_singular_position_are_extrapolated_to_and_beyond_it():
    """Twelve exact samples, 0.6 ms apart, end 0.2 ms before the singular position. At its time and 0.2 ms
    later errors are at most ten times the measured 1.4e-14 m and 1.6e-11 m/s."""
    scene = SCENES["planar_slider_crank_equal"]()
    nodes = true_nodes(scene, SINGULAR - 2e-4 - 6e-4 * np.arange(12)[::-1])
    landing = np.array([SINGULAR, SINGULAR + 2e-4])
    found, exact = extrapolated_states(scene, nodes, landing)[1], true_nodes(scene, landing)[1]
    apart = np.abs(found[0] - exact[0]).max(), np.abs(found[1] - exact[1]).max()
    assert apart[0] < MARGIN * 1.4e-14 and apart[1] < MARGIN * 1.6e-11


def test_projection_of_rough_states_closes_the_joints():
    """The exact state of the five-bar at 4 ms gets random errors of 1e-4 (ROUGH) and is projected. By the
    judge's equations its joints are then closed to rounding, and their rates are at most ten times the
    measured 4.4e-14 m/s. The result is within 10 ROUGH of the exact state."""
    scene, t = SCENES["five_bar"](), 0.004
    rng = np.random.default_rng(1)
    coordinates, rates = true_nodes(scene, np.array([t]))[1][:2, 0]
    rough = coordinates + ROUGH * rng.normal(size=coordinates.shape)
    q, v = projected(scene, t, rough, rates + ROUGH * rng.normal(size=rates.shape))
    start, orientation = initial_poses(scene)
    turn = q[:, 3:] + UPRIGHT
    pose = (start + q[:, :3], rotations.multiply(turn, orientation))
    spin = 2 * rotations.multiply(v[:, 3:], rotations.conjugate(turn))[:, 1:]
    gap = max(np.abs(rows).max() for rows in closure(scene, t, *pose).values())
    drift = max(np.abs(rows).max() for rows in closure_rates(scene, t, *pose, v[:, :3], spin).values())
    assert gap < ROUNDING and drift < MARGIN * 4.4e-14, f"residuals {gap:.1e} m, {drift:.1e} m/s"
    assert np.abs(q - coordinates).max() < 10 * ROUGH, f"moved by {np.abs(q - coordinates).max():.1e}"


def test_projection_moves_a_light_rod_and_not_a_heavy_flywheel():
    """The rod is 1e-4 m (ROUGH) off its joint with the flywheel. The projection is the least motion that
    closes the joint, weighted with the masses: it moves the rod by more than a tenth of the gap and the
    flywheel by less than a thousandth."""
    scene = SCENES["planar_slider_crank_heavy"]()
    coordinates, rates = true_nodes(scene, np.array([0.5]))[1][:2, 0]
    rough = coordinates.copy()
    rough[1, :2] += ROUGH
    found = projected(scene, 0.5, rough, rates)[0]
    flywheel, rod = (np.abs(found[k] - rough[k]).max() for k in (0, 1))
    assert flywheel < 1e-3 * ROUGH and rod > 0.1 * ROUGH, (flywheel, rod)
