"""Torque and force of a driver, by closed forms: what its motor delivers for bodies, armature and couplings.
Driver A turns by φ(t) = 0.4 t + 1.5 t² + 0.3 sin 4t rad, or slides by as many m. ANGLE, RATE and SECOND are
φ, φ' and φ''. A torque is the inertia that the motor sees times φ'', and the power torque times φ'."""

import numpy as np
import pytest

from crosscheck.engine import engine, installed
from mbref import Motion, Scene, find_scene, simulate
from mbref.cli.commands import main
from tests.helpers.parts import Entry, Point, Z, hinge, joint
from tests.helpers.statics import rod

TIMES = np.linspace(0.0, 0.8, 9)
G = 9.81
TURN = {"polynomial": [0.0, 0.4, 1.5], "sine": {"amplitude": 0.3, "frequency": 4.0}}
ANGLE = 0.4 * TIMES + 1.5 * TIMES**2 + 0.3 * np.sin(4 * TIMES)
RATE = 0.4 + 3.0 * TIMES + 1.2 * np.cos(4 * TIMES)
SECOND = 3.0 - 4.8 * np.sin(4 * TIMES)
CLOSE = 1e-11  # relative to the largest torque or power


def moved(bodies: list[Entry], joints: list[Entry], method: str | None = None, **parts) -> Motion:
    parts = {"driver": [{"joint": "A", **TURN}], **parts}
    scene = Scene(**{"name": "driven", "body": bodies, "joint": joints, **parts})
    motion = simulate(scene, method, TIMES)
    assert motion.outcome.name == "COMPLETED", motion.message
    return motion


def assert_equal(found: np.ndarray | None, exact: np.ndarray, limit: float = CLOSE) -> None:
    """Assert that a force, torque or power is exact to a limit, relative to its largest value."""
    assert found is not None and np.abs(found - exact).max() <= limit * np.abs(exact).max()


def wheels(*armatures: float, bodies=("ground", "w{}"), axis: Point = Z) -> tuple[list[Entry], list[Entry]]:
    """Return wheels of 0.1, 0.2, … kg m² on the ground, on joints A, B, … with armatures (kg m²)."""
    made = [rod(f"w{k}", (0.5 * k, 0.0, 0.0), 1.0 + k, 0.1 * (k + 1)) for k in range(len(armatures))]
    names = "ABC"[: len(armatures)]
    return made, [
        hinge(name, *(b.format(k) for b in bodies), (0.5 * k, 0.0, 0.0), axis, armature=armature)
        for k, (name, armature) in enumerate(zip(names, armatures, strict=True))
    ]


def test_motor_lifts_a_nut_by_its_screw():
    """The thread moves the nut by p φ against gravity: (J + I + p² m) φ'' + m g p."""
    mass, inertia, armature, pitch = 1.4, 0.05, 0.3, 0.2
    screw = joint("A", "cylindrical", "ground", "nut", axis=list(Z), armature=armature)
    thread = [{"name": "thread", "joints": ["A", "A"], "ratio": pitch}]
    nut = [rod("nut", (0.0, 0.0, 0.1), mass, inertia)]
    found = moved(nut, [screw], coupling=thread, gravity=[0.0, 0.0, -G]).driver("A")
    assert_equal(found.torque, (inertia + armature + pitch**2 * mass) * SECOND + mass * G * pitch)
    assert_equal(found.power, found.torque * RATE)


def test_driver_delivers_what_spring_and_torque_of_its_joint_leave_over():
    """The torque M of the driver follows from (J + I) φ'' = M - 5 (φ - 40) - 0.6 φ' + 1.5."""
    loads = [
        {"type": "torsion_spring", "joint": "A", "stiffness": 5.0, "damping": 0.6, "natural_angle": 40.0},
        {"type": "joint_torque", "joint": "A", "torque": 1.5},
    ]
    motion = moved(*wheels(0.5), load=loads)
    spring = -5.0 * (ANGLE - 40.0) - 0.6 * RATE
    assert_equal(motion.load_at(0).torque, spring)
    assert_equal(motion.driver("A").torque, (0.1 + 0.5) * SECOND - spring - 1.5)


def both_driven() -> Scene:
    """Return two wheels that mesh, B with -2 turns a turn of A, and are both driven so: A turns by t²."""
    bodies, joints = wheels(0.4, 0.7)
    mesh = [{"name": "mesh", "joints": ["A", "B"], "ratio": -2.0}]
    motors = [{"joint": "A", "polynomial": [0.0, 0.0, 1.0]}, {"joint": "B", "polynomial": [0.0, 0.0, -2.0]}]
    return Scene(name="shared", body=bodies, joint=joints, coupling=mesh, driver=motors)


@pytest.mark.parametrize("method", ["taylor", "alf-dual+projection"])
def test_powers_of_two_drivers_of_one_freedom_add_up_to_the_power_of_the_motion(method):
    """The power is J φ'' φ' with J = J₁ + I₁ + n² (J₂ + I₂), φ'' = 2 rad/s², φ' = 2 t rad/s. ``open`` is the
    number of components that equilibrium does not determine: 1 of each, and 0 if A is driven alone."""
    motion = simulate(both_driven(), method, TIMES)
    first, second = motion.driver("A"), motion.driver("B")
    seen = 0.1 + 0.4 + 2.0**2 * (0.2 + 0.7)
    assert_equal(first.power + second.power, seen * 2.0 * 2.0 * TIMES)
    assert first.open.tolist() == second.open.tolist() == [1] * TIMES.size
    alone = simulate(both_driven().with_(driver=both_driven().driver[:1]), method, TIMES)
    assert alone.driver("A").open.tolist() == [0] * TIMES.size


def test_run_states_that_the_torque_of_a_driver_that_it_prints_is_not_determined(tmp_path, capsys):
    """Two drivers share the torque of one freedom. The statement is on the printed driver alone."""
    path = str(tmp_path / "shared.toml")
    both_driven().save(path)
    asked = ["run", path, "--samples", "3", "--estimate", "no", "--columns"]
    assert main([*asked, "driver(B).torque"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "driver(B): equilibrium does not determine its force or torque at 3 of 3 samples" in shown
    assert "driver(A): equilibrium" not in shown
    assert main([*asked, "energy"]) == 0
    assert "does not determine" not in capsys.readouterr().out


@pytest.mark.parametrize("name", [n for n in ("mujoco", "pinocchio") if installed(n)])
def test_motion_of_an_engine_has_the_torque_of_its_motor(name):
    """The torque is (J + I) φ'', J = 0.1, I = 0.4 kg m², to 1e-6 of the largest, above the engine's error."""
    bodies, joints = wheels(0.4)
    scene = Scene(name="driven", body=bodies, joint=joints, driver=[{"joint": "A", **TURN}])
    simulator = engine(name)
    run = simulator.run(scene, TIMES, simulator.best_settings(scene)[-1])
    found = Motion.of(scene, run).driver("A").torque
    assert_equal(found, (0.1 + 0.4) * SECOND, 1e-6)


def test_driver_of_a_body_without_mass_has_no_torque_and_no_power():
    """None, not 0 or the armature's torque: forces are not known in a scene without masses."""
    bodies, joints = wheels(0.4)
    bare = [{key: body[key] for key in ("name", "position")} for body in bodies]
    found = moved(bare, joints).driver("A")
    assert found.torque is None and found.power is None
    assert moved(bodies, joints).driver("A").torque is not None, "known with the masses"


@pytest.mark.parametrize("offsets", [[-1e-3, -1e-5, -1e-6, -1e-7, 1e-7, 1e-6, 0.1], [-1e-6], [-1e-7]])
def test_torque_is_exact_while_a_weight_bends_a_crank_that_its_rod_covers(offsets):
    """Crank and rod are L long; the crank turns by 1 rad/s and is upright at π/2 s, where the rod lies on it
    and the slider on the crank's hinge. The rod then holds a slider that gravity pulls along its guide by
    forces that grow without limit, but the torque is finite: with the masses m of crank and rod and M of the
    slider it is L² (2 m + 4 M) sin t cos t + g_x L (2 m + 2 M) sin t - g_y L m cos t. The rod turns evenly,
    also where a run ends before π/2 s."""
    scene = find_scene("planar_slider_crank_equal").with_(gravity=(-3.0, -G, 0.0), load=())
    scene = scene.with_(driver=[{"joint": "A", "polynomial": [0.0, 1.0]}])
    times = np.pi / 2 + np.array(offsets)
    motion = simulate(scene, times=times)
    length, m, slider = 0.308, scene.body[0].mass, scene.body[2].mass
    sine, cosine = np.sin(times), np.cos(times)
    exact = length**2 * (2 * m + 4 * slider) * sine * cosine
    exact += -3.0 * length * (2 * m + 2 * slider) * sine + G * length * m * cosine
    assert motion.outcome.name == "COMPLETED", motion.message
    assert_equal(motion.driver("A").torque, exact, 1e-7)  # measured: 5e-10, 1e-3 s before π/2 s
    assert np.abs(motion["rod"].angular_acceleration).max() < 1e-10  # rad/s²; measured: 1e-13
    assert not motion.driver("A").open.any()


def test_equilibrium_determines_no_torque_of_a_driver_at_a_singular_position():
    """The slider-crank's rod is as long as its crank and lies on it at 0.25 s alone: ``open`` is 1, not 0."""
    scene = find_scene("planar_slider_crank_equal").with_(gravity=(-3.0, -G, 0.0), load=())
    scene = scene.with_(driver=[{"joint": "A", "polynomial": [0.0, 2 * np.pi]}])
    driver = simulate(scene, times=[0.0, 0.24, 0.25, 0.26]).driver("A")
    assert driver.open.tolist() == [0, 0, 1, 0]


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_parallelogram_that_stops_next_to_its_second_flat_position_turns_evenly(side):
    """Crank and rocker turn from π/4 by ω = -124.8 rad/s, and are flat at 5π/4 rad for the second time. The
    coupler moves without turning, so that no body has an angular acceleration, and the torque is zero. It is
    relative to m L² ω², the accelerations to ω²; 3e-7 is measured, 1e-6 allowed. Rounding of the lengths
    decides how the steps come near: of 80 times, several are hard on each processor."""
    rate = 124.8
    for offset in side * np.logspace(-8.7, -6.0, 80):
        motion = simulate("four_bar_quarter", times=[1.25 * np.pi / rate + offset])
        assert motion.outcome.name == "COMPLETED", motion.message
        assert np.abs(motion.angular_acceleration).max() <= 1e-6 * rate**2, offset
        size = motion.mechanism.body[0].mass * 0.5**2 * rate**2
        assert np.abs(motion.driver("A").torque).max() <= 1e-6 * size, offset


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_row_of_a_table_next_to_a_flat_position_leaves_accelerations_right_or_undecided(side):
    """The parallelogram turns evenly by a table; each row ends a step. At the row and around it accelerations
    are off by 5.1e-4 ω² measured, where a row is 1e-5 s before the flat position; 2e-3 ω² is allowed. Nearer
    ones are undecided: the run ends with the right sample of the row, and advises to move it."""
    rate, at = 124.8, 0.25 * np.pi / 124.8
    outcomes = []
    for before in side * np.logspace(-9.0, -4.0, 40):
        row = at - before
        driver = {"joint": "A", "table": [[t, -rate * t] for t in (0.0, row, 0.012, 0.02)]}
        around = at + abs(before) * np.linspace(-3.0, 3.0, 20)
        scene = find_scene("four_bar_quarter").with_(driver=[driver], duration=0.02)
        motion = simulate(scene, times=np.unique([0.0, row, *around, 0.02]))
        assert np.abs(motion.angular_acceleration).max() <= 2e-3 * rate**2, before
        outcomes.append(motion.outcome.name)
        if motion.outcome.name != "COMPLETED":
            assert "move the row of a table that is at this time" in motion.message
            assert motion.outcome.name == "UNDECIDED" and abs(before) < 2e-5 and row in motion.times
    assert {"COMPLETED", "UNDECIDED"} == set(outcomes)


@pytest.mark.parametrize("times", [[0.0], [0.0, 0.01], [0.0, 1e-10, 0.01]], ids=str)
def test_torque_is_undetermined_at_a_singular_start_whatever_the_samples_are(times):
    """A driven rhombus starts flat, where its folded branch begins: equilibrium does not determine the torque
    at the start (``open`` is 1), but does at 0.01 s. The run reaches all its samples."""
    driver = simulate("four_bar_straight", times=times).driver("A")
    assert driver.open[0] == 1 and len(driver.open) == len(times)
    assert driver.open[-1] == (times[-1] == 0.0)
