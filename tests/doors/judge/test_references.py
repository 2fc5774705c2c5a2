"""References of short motions: stored states, closed forms, and invariance under units, frames and order."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck import truth_for
from crosscheck.cli import main
from crosscheck.judge import constraints
from crosscheck.judge.joint_reactions import shared_wrenches
from crosscheck.judge.reference.isostatic import isostatic, replaced
from crosscheck.judge.reference.reference import Reference, reference
from crosscheck.judge.truth import closed_form
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Driver, Revolute, Scene
from tests.helpers.changed_scenes import in_another_frame, in_another_order, in_other_units
from tests.helpers.errors import pose_error, rate_error, turned_between
from tests.helpers.exact_motions import stored
from tests.helpers.short_motions import CROSSED, MOTIONS, times_of

ROUNDING = 2.2e-16
LIMIT = 60.0  # CPU s of a reference; each takes about 0.2
TURN = rotations.from_vector(np.array([0.7, -0.4, 1.1]))
SHIFT = np.array([0.3, -0.5, 0.2])  # m


EXPENSIVE = {  # more than 0.8 CPU s each
    "spatial_slider_crank",
    "planar_slider_crank",
    "planar_slider_crank_equal",
    "five_bar_gravity",
    "five hinges",
    "two loops on one crank",
}


def a_few(names: list[str], step: int, first: int = 0) -> list[object]:
    """Return the names as cases: each one of ``step`` for the gate, the rest for the slow suite."""
    return [
        name
        if k % step == first % step and name not in EXPENSIVE
        else pytest.param(name, marks=pytest.mark.slow)
        for k, name in enumerate(names)
    ]


SMOOTH = [name for name in MOTIONS if name not in CROSSED]


@pytest.fixture(autouse=True)
def _no_motion_is_known(tmp_path, monkeypatch):
    """References are computed anew, and none is read from the user's cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def motion_of(scene: Scene, times: np.ndarray | None = None) -> Trajectory:
    """Return the judge's motion of a scene at the times of a short motion, or at others."""
    truth = truth_for(scene, reference_time=LIMIT)
    assert truth is not None
    return truth.poses(times_of(scene) if times is None else times)


def referred(scene: Scene, times: np.ndarray) -> Reference:
    """Return the reference of a scene at times, also where a closed form is known."""
    found = reference(scene, times, LIMIT)
    assert isinstance(found, Reference), found
    return found


@pytest.mark.parametrize("name", a_few(list(MOTIONS), 5))
def test_judge_computes_the_stored_states_again_within_their_bound(name):
    """Both formulations of a reference, natural coordinates and the tree of joints, agree at each sample."""
    scene, exact = MOTIONS[name](), stored()[name]
    found = motion_of(scene)
    bound = max(exact["bound"], 20 * ROUNDING)
    assert pose_error(found, exact) <= bound
    assert rate_error(found, exact) <= 10 * bound
    if exact["by"] == "reference":
        assert referred(scene, times_of(scene)).both.all()


CLOSED = [name for name in MOTIONS if closed_form(MOTIONS[name]()) is not None]


@pytest.mark.parametrize("name", a_few(CLOSED, 3))
def test_reference_agrees_with_the_closed_form_within_its_bound(name):
    scene = MOTIONS[name]()
    found, exact = referred(scene, times_of(scene)), closed_form(scene).poses(times_of(scene))
    assert found.both.all()
    allowed = found.bound.max() + closed_form(scene).accuracy
    length = constraints.scene_length(scene)
    assert np.linalg.norm(found.position - exact.position, axis=-1).max() <= allowed * length
    assert turned_between(found.orientation, exact.orientation).max() <= allowed


# --- invariance -------------------------------------------------------------------------------------------
def apart(found: Trajectory, wanted: Trajectory) -> float:
    """Return the largest difference of a position (over the largest one), of an orientation (rad), or of a
    velocity, over ten times the largest one: velocities are less exact."""
    order = [found.bodies.index(name) for name in wanted.bodies]
    states = {
        name: getattr(wanted, name) for name in ("position", "orientation", "velocity", "angular_velocity")
    }
    arrays = {name: getattr(found, name)[:, order] for name in states}
    length = np.abs(wanted.position).max()
    spin, speed = np.abs(wanted.angular_velocity).max(), np.abs(wanted.velocity).max()
    fastest = max(spin, speed / length)
    return max(
        np.abs(arrays["position"] - wanted.position).max() / length,
        turned_between(arrays["orientation"], wanted.orientation).max(),
        np.abs(arrays["angular_velocity"] - wanted.angular_velocity).max() / (10 * fastest),
        np.abs(arrays["velocity"] - wanted.velocity).max() / (10 * fastest * length),
    )


def exact_motion(name: str) -> Trajectory:
    """Return the stored states of a short motion as a trajectory."""
    scene, exact = MOTIONS[name](), stored()[name]
    states = {
        field: np.array(exact[field]) for field in ("position", "orientation", "velocity", "angular_velocity")
    }
    names = tuple(body.name for body in scene.body)
    return Trajectory(scene.name, "truth", "", exact["by"], {}, times_of(scene), names, **states)


def bound_of(name: str) -> float:
    """Return the bound on both motions; a singular position magnifies the rounding of the scene's numbers."""
    return (100.0 if name in CROSSED else 2.0) * max(stored()[name]["bound"], 20 * ROUNDING)


@pytest.mark.parametrize("name", a_few(list(MOTIONS), 15, 2))
def test_motion_does_not_depend_on_the_units_of_mass_length_and_time(name):
    """In grams, millimetres and tenths of seconds."""
    scene = in_other_units(MOTIONS[name](), 1e3, 1e3, 10.0)
    exact = exact_motion(name)
    wanted = Trajectory(
        **{
            **vars(exact),
            "times": 10 * exact.times,
            "position": 1e3 * exact.position,
            "velocity": 1e2 * exact.velocity,
            "angular_velocity": exact.angular_velocity / 10,
        }
    )
    assert apart(motion_of(scene), wanted) <= bound_of(name)


@pytest.mark.parametrize("name", a_few(list(MOTIONS), 15, 5))
def test_motion_turns_and_shifts_with_the_frame(name):
    exact = exact_motion(name)
    wanted = Trajectory(
        **{
            **vars(exact),
            "position": rotations.rotate(TURN, exact.position) + SHIFT,
            "orientation": rotations.multiply(TURN, exact.orientation),
            "velocity": rotations.rotate(TURN, exact.velocity),
            "angular_velocity": rotations.rotate(TURN, exact.angular_velocity),
        }
    )
    found = motion_of(in_another_frame(MOTIONS[name](), TURN, SHIFT))
    assert apart(found, wanted) <= 10 * bound_of(name)


@pytest.mark.parametrize("name", a_few(list(MOTIONS), 15, 8))
def test_motion_does_not_depend_on_the_order_of_bodies_joints_and_loads(name):
    scene = in_another_order(MOTIONS[name]())
    assert apart(motion_of(scene), exact_motion(name)) <= bound_of(name)


@pytest.mark.parametrize("name", a_few(SMOOTH, 25, 3))
def test_states_of_a_reference_do_not_depend_on_other_samples(name):
    """The states at the stored times, where three times as many are asked for."""
    scene = MOTIONS[name]()
    times = np.union1d(times_of(scene), scene.duration * np.array([0.05, 0.11, 0.5, 0.52, 0.9, 0.99]))
    found = motion_of(scene, times)
    chosen = np.isin(times, times_of(scene))
    exact = stored()[name]
    assert np.abs(found.position[chosen] - exact["position"]).max() <= 2 * bound_of(name)
    assert turned_between(found.orientation[chosen], np.array(exact["orientation"])).max() <= bound_of(name)


@pytest.mark.parametrize("name", a_few(SMOOTH, 6, 1))
def test_jacobian_times_velocities_is_the_difference_of_joint_residuals(name):
    """The difference is of order 4: residuals at ±h and ±2h, h = 1e-4 s, of poses that move from the start at
    random velocities. Rows of drivers also change by the drivers' rates."""
    scene = MOTIONS[name]()
    place, turn = constraints.initial_poses(scene)
    rows, rates = constraints.jacobian(scene, 0.0, place, turn)
    h, size = 1e-4, len(scene.body)
    names = [joint.name for joint in scene.joint]
    twist = np.random.default_rng(len(name)).normal(size=(size, 6))

    def residuals(sign: float) -> np.ndarray:
        step = sign * h * twist
        moved = rotations.multiply(rotations.from_vector(step[:, 3:]), turn)
        found = constraints.closure(scene, sign * h, place + step[:, :3], moved)
        return np.concatenate([np.zeros(0), *(found[joint] for joint in names)])

    slope = (8 * (residuals(1.0) - residuals(-1.0)) - residuals(2.0) + residuals(-2.0)) / (12 * h)
    count = len(slope)  # rows of couplings follow
    wanted = (rows @ twist.ravel() - rates)[:count]
    assert slope == pytest.approx(wanted, abs=1e-8)


@pytest.mark.parametrize("name", MOTIONS)
def test_length_of_a_mechanism_is_in_its_units_and_independent_of_frame_and_order(name):
    scene = MOTIONS[name]()
    length = constraints.scene_length(scene)
    assert constraints.scene_length(in_other_units(scene, 3.0, 7.0, 0.5)) == pytest.approx(7 * length)
    assert constraints.scene_length(in_another_frame(scene, TURN, SHIFT)) == pytest.approx(length)
    assert constraints.scene_length(in_another_order(scene)) == pytest.approx(length)


@pytest.mark.parametrize("size", [1e-4, 1e4])
@pytest.mark.parametrize("name", ["four hinges", "doubled hinge", "slider-crank of hinges"])
def test_open_reactions_and_joints_without_redundant_rows_do_not_depend_on_the_size(name, size):
    """A redundant joint leaves components of reactions undetermined (open). Weaker joints replace it until no
    row is redundant, as in the mechanism of another size."""
    plain = MOTIONS[name]()
    scene = in_other_units(plain, 1.0, size, 1.0)
    shared, wanted = (shared_wrenches(s, 0.0, *constraints.initial_poses(s)) for s in (scene, plain))
    assert {n: b.shape[1] for n, b in shared.items()} == {n: b.shape[1] for n, b in wanted.items()}
    assert sum(basis.shape[1] for basis in wanted.values()) > 0
    weaker = replaced(plain, isostatic(plain))
    assert weaker and replaced(scene, isostatic(scene)) == weaker


@pytest.mark.parametrize(
    ("amplitude", "known"), [(0.6, True), pytest.param(30.0, False, marks=pytest.mark.slow)]
)
def test_turns_of_a_fast_oscillation_are_counted_between_few_samples_or_said_to_be_unknown(
    amplitude, known, tmp_path, capsys
):
    """A wheel oscillates 400 times up to the only later sample, with equal rates at even times."""
    wheel = Body(name="wheel", mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.0, 0.0, 0.0))
    hinge = Revolute(name="A", bodies=("ground", "wheel"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    motion = Driver(joint="A", polynomial=(0.0,), sine={"amplitude": amplitude, "frequency": 2 * np.pi})
    Scene(name="wheel", duration=400.0, body=[wheel], joint=[hinge], driver=[motion]).save(
        path := tmp_path / "wheel.toml"
    )
    table = tmp_path / "exact.csv"
    assert main(["reference", str(path), "--samples", "2", "--out", str(table)]) == (0 if known else 1)
    assert ("unknown: A.angle" in capsys.readouterr().out) is not known
    angle = np.genfromtxt(table, delimiter=",", names=True)["Aangle_rad"]
    assert angle == pytest.approx([0.0, 0.0 if known else np.nan], abs=1e-9, nan_ok=True)
