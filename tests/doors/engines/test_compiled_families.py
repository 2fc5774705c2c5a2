"""The compiled DOP853 against closed forms, and families of settings, in which it integrates an engine's
accelerations ("compiled"), against truths."""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from crosscheck.engine import Engine, Setting, engine
from crosscheck.engines.shared.compiled import dop853
from crosscheck.engines.shared.compiled.calls import RATES
from crosscheck.engines.shared.compiled.run import MOST_STEPS
from crosscheck.engines.shared.planar_scene import planar_scene
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.joint_reactions import compare
from crosscheck.judge.metrics import measure, violation_series
from crosscheck.judge.reaction_balance import with_exact_reactions
from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Driver, PointDamper, RotationalDamper, Scene, Sine, Spherical
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, relative_error
from tests.helpers.parts import hinge, rod
from tests.helpers.tree_scenes import body, every_joint

FAMILY, PROJECTED, NEWTON = "forward, compiled", "projected, compiled", "newton, compiled"
CLOSED = 1e-12  # of the scene's length, or rad: violations after a projection; 1e-13 is measured
GAUSS = 3.2e-10  # largest measured number of `off_gauss` by MuJoCo's compiled families: of angular velocities


def integrate(
    rates: Callable[[float, np.ndarray], np.ndarray],
    y: list[float],
    times: list[float],
    rtol: float,
    quaternions: tuple[int, ...] = (),
    shortest: float = 1e-12,
    most: int = MOST_STEPS,
) -> tuple[int, int, np.ndarray, dop853.Memory]:
    """Integrate y' = rates(t, y), where ``rates`` raises ArithmeticError to refuse a state. Return status,
    number of samples reached, samples and memory."""
    n = len(y)

    def function(_: int, t: float, state: int, out: int) -> int:
        pointers = (ctypes.cast(array, ctypes.POINTER(ctypes.c_double)) for array in (state, out))
        numbers, slopes = (np.ctypeslib.as_array(pointer, (n,)) for pointer in pointers)
        try:
            slopes[:] = rates(t, numbers)
        except ArithmeticError:
            return 1
        return 0

    called = RATES(function)
    address = int(ctypes.cast(called, ctypes.c_void_p).value or 0)
    places = np.array(quaternions, dtype=np.int64)
    system = dop853.System(address, 0, places, rtol, rtol, shortest, np.inf, most, 0)
    memory, samples = dop853.memory(np.array(y)), np.zeros((len(times), n))
    status, reached = dop853.integrate(system, np.array(times), samples, memory)
    return status, reached, samples, memory


def oscillator(t: float, y: np.ndarray) -> np.ndarray:
    return np.array([y[1], -y[0]])


def test_error_of_equally_many_steps_falls_with_the_ninth_power_of_their_length() -> None:
    """A method of order 8 has a local error of order h⁹: half the length gives 1/512 of the error. The
    exponent is found within 0.2. A huge tolerance fixes the number of steps."""
    errors, counts = [], []
    for h in (0.8, 0.4):
        memory = integrate(oscillator, [1.0, 0.0], [h], 1e9)[3]
        counts.append(memory.counts[dop853.STEPS])
        errors.append(np.linalg.norm(memory.y - [np.cos(h), -np.sin(h)]))
    assert counts[0] == counts[1] and np.log2(errors[0] / errors[1]) == pytest.approx(9, abs=0.2), errors


def test_dop853_turns_a_quaternion_and_keeps_its_norm() -> None:
    """A body turns at 2 rad/s about z for 50 s: q = (cos t, 0, 0, sin t), whose norm is 1 to rounding. At a
    tolerance of 1e-9 the error after 100 rad is at most ten times the measured 2.4e-9."""

    def rates(_: float, q: np.ndarray) -> np.ndarray:
        w, x, y, z = q
        return np.array([-z, y, -x, w])  # ω = 2 rad/s

    samples = integrate(rates, [1.0, 0.0, 0.0, 0.0], [50.0], 1e-9, (0,))[2]
    assert abs(np.linalg.norm(samples[0]) - 1) < 4 * np.finfo(float).eps
    assert abs(samples[0] - [np.cos(50.0), 0, 0, np.sin(50.0)]).max() < MARGIN * 2.4e-9


def test_an_integration_ends_when_its_largest_number_of_steps_is_reached() -> None:
    """500 steps of an oscillator reach the sample at 1 s, and not the one at 1e6 s."""
    status, reached, _, memory = integrate(oscillator, [1.0, 0.0], [1.0, 1e6], 1e-8, most=500)
    assert (status, reached) == (dop853.TOO_MANY, 1)
    assert memory.counts[dop853.STEPS] == 500 and 1.0 < memory.clock[0] < 1e6


@pytest.mark.parametrize("shortest", [1e-12, 1e-3])
def test_an_integration_ends_where_its_solution_becomes_infinite(shortest: float) -> None:
    """y' = y² from y = 1 is 1 / (1 - t): 2 at 0.5 s, infinite at 1 s. The last step may pass this time by the
    shortest step, or by 1e-6 s, 100 tolerances in seconds; 6e-10 s and 3e-4 s are measured."""
    with np.errstate(over="ignore"):
        found = integrate(lambda _, y: y**2, [1.0], [0.5, 2.0], 1e-8, shortest=shortest)
        status, reached, samples, memory = found
    assert reached == 1 and status in (dop853.NOT_FINITE, dop853.TOO_SMALL)
    assert abs(samples[0, 0] - 2.0) < 100 * 1e-8, "a hundred tolerances"
    assert memory.clock[0] < 1.0 + max(shortest, 1e-6), "s"


def test_an_integration_ends_where_its_function_refuses() -> None:
    """The function refuses states after t = 0.7 s; steps of at least 1e-12 s end within 1e-9 s of it."""

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        if t > 0.7:
            raise ArithmeticError
        return oscillator(t, y)

    status, reached, _, memory = integrate(rates, [1.0, 0.0], [0.5, 1.0], 1e-8)
    assert status != dop853.REACHED and reached == 1
    assert memory.clock[0] == pytest.approx(0.7, abs=1e-9), "s"


def test_a_shortest_step_lets_the_integration_pass_noise() -> None:
    """y' = 1 has noise of amplitude 1 for 0.04 s, which changes y by at most 0.04. With a shortest step of 1
    ms the noise takes 40 of at most 100 steps; without one 500 do not suffice."""
    times = np.linspace(0.0, 1.0, 21).tolist()

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([1.0 + (np.sin(1e7 * t) if abs(t - 0.5) < 0.02 else 0.0)])

    status, _, samples, memory = integrate(rates, [0.0], times, 1e-10, shortest=1e-3)
    assert status == dop853.REACHED and memory.counts[dop853.STEPS] < 100
    assert abs(samples[:, 0] - times).max() < 0.04
    assert integrate(rates, [0.0], times, 1e-10, most=500)[0] == dop853.TOO_MANY


def simulate(name: str, scene: Scene, samples: int, family: str, **options: float) -> Trajectory:
    return engine(name).run(scene, np.linspace(0, scene.duration, samples), Setting(family, options))


def off_gauss(scene: Scene, run: Trajectory) -> dict[str, float]:
    """Return the largest differences from the motion and reactions by Gauss's principle: of orientations
    (rad); of positions and velocities (m, m/s, rad/s), over their sizes where above 1; of unique reactions,
    relative to the largest."""
    assert run.outcome is Outcome.COMPLETED, run.message
    exact = with_exact_reactions(scene, gauss_motion(scene, tuple(run.times)))
    names = ("position", "velocity", "angular_velocity")
    fields = {name: (getattr(run, name), getattr(exact, name)) for name in names}
    off = {name: float((abs(a - b) / np.maximum(1.0, abs(b))).max()) for name, (a, b) in fields.items()}
    off["orientation"] = float(rotations.angle_between(run.orientation, exact.orientation).max())
    reactions = compare(scene, exact, run)
    unique = max(reaction.unique for reaction in reactions.joints.values())
    return {**off, "reactions": unique, "resultants": reactions.resultant}


@pytest.mark.parametrize(("family", "beta"), [(FAMILY, 30.0), (PROJECTED, 0.0)], ids=[FAMILY, PROJECTED])
def test_mujocos_compiled_families_move_and_react_by_gauss_s_principle(family: str, beta: float) -> None:
    """A scene of seven types of joints, with springs, dampers, a force and a moment, and a body that flies.
    Off by at most ten times GAUSS; the projected family keeps joints closed to 1e-12 of the length."""
    twist = {"velocity": (0.3, -0.2, 1.0), "angular_velocity": (3.0, 1.0, -2.0)}
    flying = body("flying", (2.0, 1.0, 1.5), (0.1, 0.2, 0.3), **twist)
    drag = PointDamper(bodies=("ground", "flying"), point=(2.1, 1.0, 1.5), damping=0.7)
    loads = *every_joint().load, drag, RotationalDamper(bodies=("hand", "arm"), damping=0.1)
    scene = every_joint().with_(body=(*every_joint().body, flying), duration=0.2, load=loads)
    run = simulate("mujoco", scene, 6, family, rtol=1e-9, min_step=1e-9, beta=beta, hard=1e-7)
    off = off_gauss(scene, run)
    assert all(value < MARGIN * GAUSS for value in off.values()), off
    assert family == FAMILY or violation_series(scene, run).max() < CLOSED


def test_mujocos_compiled_family_follows_a_driver_of_a_polynomial_and_a_sine() -> None:
    """The crank turns by 3 t - 20 t² + 0.4 sin(30 t) rad, from which the judge's truth follows. A wrong
    second derivative opens the closures. Errors are at most ten times the measured ones."""
    driver = Driver(joint="A", polynomial=(0.0, 3.0, -20.0), sine=Sine(amplitude=0.4, frequency=30.0))
    scene = SCENES["spatial_slider_crank"]().with_(driver=(driver,), load=(), duration=0.2)
    run = simulate("mujoco", scene, 11, FAMILY, rtol=1e-10, min_step=1e-9, beta=50.0, hard=1e-9)
    assert relative_error(run, scene) < MARGIN * 1.1e-12
    assert measure(scene, run, truth_for(scene))["velocity_error"] < MARGIN * 2.1e-12


def test_a_failed_run_of_mujocos_compiled_family_has_the_samples_before_its_end() -> None:
    """With steps of at least 1 ms a slider-crank with equal links fails at its singular position, at one of
    three tolerances or more. Failed runs have finite samples, fewer than asked, and end within the motion."""
    scene = SCENES["planar_slider_crank_equal"]()
    given = {"min_step": 1e-3, "beta": 30.0, "hard": 1e-9}
    runs = [simulate("mujoco", scene, 21, FAMILY, rtol=rtol, **given) for rtol in (1e-4, 1e-6, 1e-9)]
    failed = [run for run in runs if run.outcome is not Outcome.COMPLETED]
    assert failed and all(run.message for run in failed)
    assert all(0 < len(run.times) < 21 and 0 < run.t_end < scene.duration for run in failed)
    assert all(np.isfinite(run.position).all() for run in failed)


@pytest.mark.parametrize(
    ("name", "tolerance", "measured"),  # tolerance (m, rad), measured error (of the length, or rad)
    [
        ("spatial_slider_crank_driven", 1e-13, 1.8e-14),
        ("four_bar", 1e-10, 2.2e-14),
        ("five_bar", 1e-10, 1e-14),
    ],
)
def test_newton_on_mujocos_closures_gives_the_true_driven_motion(name, tolerance, measured) -> None:
    """The error of poses from the judge's truth is at most ten times the measured one. Velocities and
    accelerations have a relative error of 1e-11 measured; 1e-9 is allowed."""
    scene = SCENES[name]()
    run = simulate("mujoco", scene, 11, NEWTON, tolerance=tolerance, turn=0.6)
    assert relative_error(run, scene) < MARGIN * measured
    exact = truth_for(scene).poses(run.times)
    for field in ("velocity", "acceleration"):
        found, wanted = getattr(run, field), getattr(exact, field)
        assert abs(found - wanted).max() < 1e-9 * abs(wanted).max(), field


def test_newton_ends_where_closures_cannot_be_met() -> None:
    """Coupler and rocker are too short for a whole turn of the driven crank. The run ends before 2 s with the
    samples so far, and its message names the closures."""
    pins = ((0.0, 0.0, 0.0), (0.0, 0.3, 0.0), (0.2, 0.3, 0.0), (0.4, 0.0, 0.0))
    names = ("ground", "crank", "coupler", "rocker", "ground")
    bodies = [rod(names[k + 1], pins[k], pins[k + 1]) for k in range(3)]
    joints = [hinge("ABCD"[k], names[k], names[k + 1], pins[k]) for k in range(4)]
    driver = Driver(joint="A", polynomial=(0.0, 3.0))
    scene = Scene(name="short", body=bodies, joint=joints, driver=(driver,), duration=2.0)
    run = simulate("mujoco", scene, 5, NEWTON, tolerance=1e-10, turn=0.1)
    assert run.outcome is Outcome.NOT_CONVERGED and "closures" in run.message
    assert 0 < len(run.times) < 5 and 0 < run.t_end < scene.duration


def test_newton_refuses_a_scene_whose_motion_is_not_prescribed() -> None:
    """The family NEWTON solves joints and drivers, and needs a driver for each freedom."""
    with pytest.raises(ValueError, match="do not prescribe the whole motion"):
        simulate("mujoco", SCENES["planar_slider_crank"](), 5, NEWTON, tolerance=1e-10, turn=0.1)


def test_planar_scene_replaces_joints_only_if_the_mechanism_cannot_leave_its_plane() -> None:
    """The four-bar cannot leave its plane, and gets hinges in place of universal joints. A double pendulum on
    a hinge and a ball joint can, at rest and with a spin about y."""
    scene = SCENES["four_bar_gravity"]()
    assert "universal" in {joint.type for joint in scene.joint}
    assert "universal" not in {joint.type for joint in planar_scene(scene).joint}
    first, second = scene.joint[:2]
    ball = Spherical(name=second.name, bodies=second.bodies, anchor=second.anchor)
    spun = scene.body[1].model_copy(update={"angular_velocity": (0.0, 1.0, 0.0)})
    for second_body in (scene.body[1], spun):
        pendulum = scene.with_(body=(scene.body[0], second_body), joint=(first, ball))
        assert planar_scene(pendulum) is pendulum


@pytest.fixture(scope="module")
def pinocchio() -> Engine:
    """Pinocchio's adapter where its compiled families can be run."""
    pytest.importorskip("pinocchio")
    from crosscheck.engines.pinocchio.library import why_not

    if reason := why_not():
        pytest.skip(reason)
    return engine("pinocchio")


@pytest.mark.parametrize("family", ["dop853, compiled", "tuned, compiled"])
def test_pinocchios_compiled_families_move_and_react_by_gauss_s_principle(pinocchio, family):
    """The scene has seven types of joints and torsion springs, the only loads of these families. Differences
    are at most ten times the errors of MuJoCo's (GAUSS), whose steps have ten times the tolerance."""
    joints = every_joint()
    springs = [load for load in joints.load if load.type == "torsion_spring"]
    assert springs
    scene = joints.with_(duration=0.2, load=springs)
    off = off_gauss(scene, simulate("pinocchio", scene, 6, family, rtol=1e-10, min_step=1e-9))
    assert all(value < MARGIN * GAUSS for value in off.values()), off
