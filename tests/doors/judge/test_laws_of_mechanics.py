"""Laws of mechanics that the judge's motions, loads, reactions and drivers obey at 0.43 of the duration."""

import functools
from collections.abc import Callable

import numpy as np
import pytest

from crosscheck import measure, truth_for
from crosscheck.judge import constraints
from crosscheck.judge.driver_forces import driver_forces
from crosscheck.judge.energy import energy_series, kinetic_energy
from crosscheck.judge.gauss_motion import accelerations, power
from crosscheck.judge.joint_loads import turning_loads
from crosscheck.judge.reaction_balance import idle, with_exact_reactions
from crosscheck.judge.time_functions import value
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene
from tests.helpers.newton_euler import unbalanced
from tests.helpers.short_motions import CROSSED, MOTIONS

LIMIT = 60.0  # CPU s of a reference; each takes about 0.2
STEP = 1e-4  # between five samples, of the duration: differences of fourth order are exact to about 1e-8
QUICK = (  # one for each kind of joint, load, driver and coupling
    "arm with planar", "arm with distance, bodies exchanged", "arm with translational", "loop with inline",
    "loop with cylindrical", "pendulum with spring with damping", "pendulum with torsion spring",
    "pendulum with slide spring", "pendulum with moment", "pendulum with force over time",
    "pendulum with joint torque", "driven slide", "driven angle of the second joint", "driven gears",
    "planet with armatures", "coupled displacements", "screw with armature", "free bodies and a spring",
    "doubled hinge", "point_pendulum",
)  # fmt: skip


@functools.cache
def scene_of(name: str) -> Scene:
    """Return the scene of a short motion, made once."""
    return MOTIONS[name]()


def each(condition: Callable[[Scene], bool] = lambda _: True) -> pytest.MarkDecorator:
    """Return the parametrisation by short motions without singular position that meet a condition."""
    names = [name for name in MOTIONS if name not in CROSSED and condition(scene_of(name))]
    cases = [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in names]
    return pytest.mark.parametrize("name", cases)


@functools.cache
def at_one_moment(name: str) -> tuple[Scene, Trajectory]:
    """Return a short motion by the judge at five neighbouring times."""
    scene = MOTIONS[name]()
    truth = truth_for(scene, reference_time=LIMIT)
    assert truth is not None
    return scene, truth.poses(scene.duration * (0.43 + STEP * np.arange(-2, 3)))


def slope(run: Trajectory, values: np.ndarray) -> np.ndarray:
    """Return the rate of values (5, …) at the middle sample by a difference of fourth order."""
    return np.tensordot(np.array([1, -8, 0, 8, -1]) / (12 * (run.times[1] - run.times[0])), values, 1)


@each()
def test_positions_velocities_and_accelerations_obey_the_joints_to_rounding(name):
    """Violations are relative to the mechanism's length. Rates grow with the angular velocity ω (rad/s),
    accelerations with ω². 1e-13 is 500 roundings; accelerations lose another digit to the factorisation."""
    scene, run = at_one_moment(name)
    found = measure(scene, run)
    spin = max(1.0, np.abs(run.angular_velocity).max())
    assert found["violation_position"] <= 1e-13
    assert found["violation_velocity"] <= 1e-13 * spin
    assert found["violation_acceleration"] <= 1e-12 * spin**2


@each()
def test_velocities_and_accelerations_are_differences_of_neighbouring_poses_and_velocities(name):
    """Differences of fourth order over 4e-4 of the duration are exact to 1e-8; the margin is ten."""
    _, run = at_one_moment(name)
    relative = rotations.multiply(run.orientation, rotations.conjugate(run.orientation[2]))
    turned = 2 * relative[..., 1:] * np.sign(relative[..., :1])  # rad, of small rotations
    pairs = (
        (run.position, run.velocity),
        (turned, run.angular_velocity),
        (run.velocity, run.acceleration),
        (run.angular_velocity, run.angular_acceleration),
    )
    for values, rates in pairs:
        scale = np.abs(rates).max() + np.abs(run.angular_velocity).max() * np.abs(values).max() + 1e-3
        assert np.abs(slope(run, values) - rates[2]).max() <= 1e-7 * scale


def state_of(scene: Scene, run: Trajectory, k: int) -> tuple[np.ndarray, ...]:
    """Return position, orientation, velocities and the angles of turning loads at a sample."""
    state = run.position, run.orientation, run.angular_velocity
    angles = constraints.joint_coordinates(scene, run.times, *state)
    turned = np.array([angles[load.joint][k, 0] for load in turning_loads(scene)])
    return run.position[k], run.orientation[k], run.velocity[k], run.angular_velocity[k], turned


@each()
def test_accelerations_of_the_motion_obey_gauss_principle(name):
    """Gauss's principle of least constraint is solved at the pose and velocities of the sample. It shares no
    code with the reference's equations, whose interpolation error is 1e-10 of the largest acceleration."""
    scene, run = at_one_moment(name)
    found = accelerations(scene, float(run.times[2]), state_of(scene, run, 2))
    wanted = np.hstack([run.acceleration[2], run.angular_acceleration[2]])
    assert np.abs(found - wanted).max() <= 1e-9 * np.abs(wanted).max()


@each()
def test_power_of_weight_loads_and_drivers_is_the_rate_of_the_kinetic_energy(name):
    """dT/dt = P, with dT/dt as a difference of fourth order. Its relative error is 1e-8, and T may change by
    all of itself in a hundredth of the duration: 1e-6 of T over the duration."""
    scene, run = at_one_moment(name)
    kinetic = kinetic_energy(scene, run.position, run.orientation, run.velocity, run.angular_velocity)
    supplied = power(scene, float(run.times[2]), state_of(scene, run, 2))
    for joint, forces in (driver_forces(scene, run) if scene.driver else {}).items():
        [driver] = (each for each in scene.driver if each.joint == joint)
        supplied += forces[2] * value(driver, run.times[2], 1)
    scale = np.abs(kinetic).max() / scene.duration
    assert slope(run, kinetic) == pytest.approx(supplied, abs=1e-6 * scale)


def is_bare(scene: Scene) -> bool:
    """Return whether joints and gravity alone act on the bodies."""
    return not (scene.load or scene.coupling or any(joint.reflected_inertia for joint in scene.joint))


@each(is_bare)
def test_reactions_by_the_judge_obey_newtons_and_eulers_equations_of_every_body(name):
    """m a = m g + Σ F and J ω' + ω × J ω = Σ M, for mechanisms without loads, couplings and armatures. What
    remains is relative to the largest force or moment; accelerations are exact to about 1e-10."""
    scene, run = at_one_moment(name)
    assert max(unbalanced(scene, with_exact_reactions(scene, run))) <= 1e-9


@each(lambda scene: bool(scene.joint))
def test_reactions_by_the_judge_have_no_part_along_a_motion_that_their_joint_allows(name):
    """Forces of loads, drivers and rotors along a coordinate are no reactions; forces of couplings are. The
    part along a motion is relative to the largest force; 6e-15 is measured, by Bricard's linkage."""
    scene, run = at_one_moment(name)
    found = with_exact_reactions(scene, run)
    assert idle(scene, found, run) <= 1e-13


def keeps_energy(scene: Scene) -> bool:
    """Return whether gravity and elastic springs alone do work."""
    kinds = {load.type for load in scene.load}
    undamped = all(getattr(load, "damping", 0.0) == 0.0 for load in scene.load)
    return not scene.driver and kinds <= {"spring", "torsion_spring", "slide_spring"} and undamped


@each(keeps_energy)
def test_energy_of_an_undamped_mechanism_is_its_energy_at_the_start(name):
    """The largest change of the energy since the start is at most 5000 roundings of the largest energy."""
    scene, run = at_one_moment(name)
    drift = energy_series(scene, run)
    assert drift is not None
    assert drift.max() <= 1e-12
