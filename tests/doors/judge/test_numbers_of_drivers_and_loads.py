"""Columns of drivers, loads and energies in references, by closed forms and by the balance of power."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import crosscheck
from crosscheck.cli import main
from crosscheck.conformance.changes.units import in_other_units
from mbref.scene import Body, Coupling, Driver, Force, Moment, Scene, SlideSpring, TorsionSpring
from tests.helpers.parts import hinge, slide, spring
from tests.helpers.statics import parallelogram, rod

INERTIA, ARMATURE, RATE = 0.3, 1.1, 2.4  # kg m², kg m², rad/s²


def driven(armature: float = 0.0, ratio: float | None = None) -> Scene:
    """Return a disc that a driver accelerates evenly, with a second disc at a gear if there is a ratio."""
    bodies = [rod(name, (k, 0, 0), 1.0, INERTIA) for k, name in enumerate(("first", "second"))]
    motor = hinge("A", "ground", "first", (0, 0, 0), armature=armature)
    hinges = [motor, hinge("B", "ground", "second", (1, 0, 0))]
    count = 1 if ratio is None else 2
    gears = [Coupling(name="gear", joints=("A", "B"), ratio=ratio)] if ratio else []
    parts = {"body": bodies[:count], "joint": hinges[:count], "coupling": gears}
    driver = [Driver(joint="A", polynomial=(0.0, 0.0, RATE / 2))]
    return Scene(name="driven_discs", gravity=(0.0, -9.81, 0.0), duration=1.0, driver=driver, **parts)


def machine(seed: int) -> Scene:
    """Return a driven crank with armature, a slide with spring, and a spring between points, of random sizes
    under a gravity of random direction."""
    size = np.random.default_rng(seed).uniform(0.3, 1.0, 12)
    inertia, gravity = 0.1 + size[1], tuple(9.81 * (size[2:5] - 0.6))
    crank = rod("crank", (0.3, 0, 0), size[0] + 0.5, inertia)
    block = rod("block", (1.0, 0, 0), size[5], inertia)
    turn = hinge("A", "ground", "crank", (0, 0, 0), armature=size[6])
    guide = slide("B", "crank", "block", (1, 0, 0), armature=size[7])
    loads = [
        SlideSpring(joint="B", stiffness=20 * size[8], damping=size[9], natural_displacement=0.2),
        spring("ground", (0.2, 1.5, 0.1), "block", (1.1, 0.1, 0.0), 10 * size[10], 0.5, 0.5),
    ]
    driver = Driver(joint="A", polynomial=(0.0, 0.5, 1.0), sine={"amplitude": 0.3, "frequency": 4.0})
    parts = {"body": [crank, block], "joint": [turn, guide], "load": loads, "driver": [driver]}
    return Scene(name="machine", gravity=gravity, duration=1.0, **parts)


@pytest.mark.parametrize(
    ("scene", "torque"),
    [
        (driven(), INERTIA * RATE),
        (driven(armature=ARMATURE), (INERTIA + ARMATURE) * RATE),
        (driven(ratio=-2.0), INERTIA * (1 + 4) * RATE),
        (driven(armature=ARMATURE, ratio=3.0), (INERTIA * (1 + 9) + ARMATURE) * RATE),
    ],
    ids=["disc", "armature", "gear", "both"],
)
def test_torque_of_a_driver_is_the_reduced_inertia_times_the_acceleration(scene, torque):
    """M = (J + I + n² J) φ'', as the second disc makes n turns in one of the first. The power is M φ', and
    the work M φ is the kinetic energy. The judge's table is exact to rounding."""
    times = np.linspace(0.0, 1.0, 6)
    table = crosscheck.reference_table(scene, times)
    assert table["driver(A).torque"] == pytest.approx(torque, rel=1e-12)
    assert table["driver(A).power"] == pytest.approx(torque * RATE * times, rel=1e-12, abs=1e-12)
    assert table["kinetic_energy"] == pytest.approx(torque * RATE * times**2 / 2, rel=1e-12, abs=1e-12)


@pytest.mark.slow  # 1.5 CPU s; power of all loads and drivers in test_laws_of_mechanics.py
@pytest.mark.parametrize("seed", range(20))
def test_change_of_the_energy_is_the_drivers_work_less_the_dampers_losses(seed: int) -> None:
    """E(t) - E(0) = ∫ (P - Σ c v²) dt. The spline through 801 samples of the power is exact to 1e-10 of the
    largest energy; the limit has a margin of ten. The spring's force is k (l - 0.5 m) + c l'."""
    scene, times = machine(seed), np.linspace(0.0, 1.0, 801)
    table = crosscheck.reference_table(scene, times)
    guide, bar = scene.load
    lost = guide.damping * table["B.displacement_rate"] ** 2 + bar.damping * table["load(1).length_rate"] ** 2
    work = CubicSpline(times, table["driver(A).power"] - lost).antiderivative()(times)
    assert np.abs(table["energy"] - table["energy"][0] - work).max() <= 1e-9 * np.abs(table["energy"]).max()
    pull = bar.stiffness * (table["load(1).length"] - 0.5) + bar.damping * table["load(1).length_rate"]
    assert table["load(1).force"] == pytest.approx(pull, rel=1e-12)


def test_torque_that_lacks_the_armature_is_off_and_the_armature_is_named() -> None:
    """The torque is J φ'' instead of (J + I) φ''. It is constant, so that a factor J / (J + I) and an offset
    -I φ'' explain it as well: the explanation joins the three by "or"."""
    scene, times = driven(armature=ARMATURE), np.linspace(0.0, 1.0, 11)
    table = crosscheck.reference_table(scene, times)
    wrong = {"time": times, "driver(A).torque": 0 * times + INERTIA * RATE, "A.angle": table["A.angle"]}
    found = crosscheck.judge_motion(scene, wrong)
    assert [c.name for c in found.columns if not c.is_right] == ["driver(A).torque"]
    (explanation,) = found.explanations
    factor, offset = INERTIA / (INERTIA + ARMATURE), -ARMATURE * RATE
    assert explanation.sentence.split("; or ") == [
        f"driver(A).torque: a factor of {factor:.9g}",
        f"driver(A).torque: an offset of {offset:.6g}",
        "without the armature of joint 'A'",
    ]


def test_torque_that_the_mechanism_does_not_determine_is_named_and_not_right(tmp_path, capsys):
    """Two drivers move one freedom: only a sum of their torques is determined. The table has one of them."""
    scene = driven(ratio=-1.0)
    scene = scene.with_(driver=[*scene.driver, Driver(joint="B", polynomial=(0.0, 0.0, -RATE / 2))])
    scene.save(tmp_path / "scene.toml")
    (tmp_path / "run.csv").write_text("time,driver(A).torque\n0.5,0.7\n1,0.7\n", encoding="utf-8")
    assert main(["judge", str(tmp_path / "scene.toml"), str(tmp_path / "run.csv")]) == 1
    assert "not determined by the mechanism: driver(A).torque" in capsys.readouterr().out


def wound_disc() -> Scene:
    """Return a disc of 1 kg m² on a torsion spring of 1 N m/rad, which turns by 10 sin t."""
    disc = rod("disc", (0, 0, 0), 1.0, 1.0) | {"angular_velocity": (0, 0, 10.0)}
    pivot = hinge("A", "ground", "disc", (0, 0, 0))
    parts = {"joint": [pivot], "load": [TorsionSpring(joint="A", stiffness=1.0)]}
    return Scene(name="wound_disc", gravity=(0.0, 0.0, 0.0), duration=10.0, body=[disc], **parts)


@pytest.mark.parametrize("times", [(1.0, 2.0, 5.0, 8.0), (8.0,), tuple(np.linspace(0.0, 8.0, 30))], ids=len)
def test_angles_of_a_reference_count_full_turns_whatever_samples_are_asked_for(times) -> None:
    """The angle is 10 sin t rad, the torque its negative, to 1e-10; the energy 10² / 2 J, to 1e-9."""
    table, angle = crosscheck.reference_table(wound_disc(), times), 10 * np.sin(times)
    assert table["A.angle"] == pytest.approx(angle, abs=1e-10)
    assert table["load(0).torque"] == pytest.approx(-angle, abs=1e-10)
    assert table["energy"] == pytest.approx(50.0, abs=1e-9)
    assert table["load(0).energy"] == pytest.approx(angle**2 / 2, abs=1e-9)


@pytest.mark.parametrize("length", [1e-6, 1.0])
def test_torque_of_one_of_two_drivers_of_one_freedom_is_not_a_number(length):
    """Drivers at A and D move one freedom, of links of 1 µm or 1 m: only the sum of torques is determined."""
    drivers = [Driver(joint=name, polynomial=(0.0, 1.0, 2.0)) for name in "AD"]
    scene = in_other_units(parallelogram(sine=0.6, cosine=0.8).with_(driver=drivers), length, 1.0)
    assert np.isnan(crosscheck.reference_table(scene, [0.01])["driver(A).torque"][0])


@pytest.mark.parametrize("start", [0.3, np.nextafter(0.3, 0.0)], ids=["as written", "rounded down"])
def test_samples_at_which_a_force_is_switched_may_have_its_value_on_either_side(start: float) -> None:
    """A force of 4 N acts on 2 kg from 0.3 s to 0.7 s, so that x = (t - 0.3)² m between, and the acceleration
    leaps to 2 m/s² and back at samples. It is 2 m/s² or 0 there, as is the force's power, but not 1."""
    times = np.linspace(0.0, 1.0, 11)
    times[3] = start
    gone = np.clip(times - 0.3, 0.0, 0.4)
    block = Body(name="b", mass=2.0, inertia=(1, 1, 1), position=(0, 0, 0), angular_velocity=(0, 0, 2))
    load = Force(body="b", point=(0, 0, 0), force=(4.0, 0.0, 0.0), factor={"start": 0.3, "stop": 0.7})
    scene = Scene(name="s", duration=1.0, body=[block], load=[load, Moment(body="b", moment=(0, 0, 3))])
    path = {"time": times, "b.position.x": gone**2 + 0.8 * np.clip(times - 0.7, 0.0, None)}
    for at, is_right in (((2.0, 0.0), True), ((0.0, 2.0), True), ((0.0, 0.0), True), ((1.0, 0.0), False)):
        pushed = np.where((times > 0.35) & (times < 0.65), 2.0, 0.0)
        pushed[[3, 7]] = at
        powers = {"load(0).power": 4 * pushed * gone, "load(1).power": 6.0 + 9.0 * times}
        motion = {**path, **powers, "b.velocity.x": 2 * gone, "b.acceleration.x": pushed}
        found = crosscheck.judge_motion(scene, motion)
        assert (found.is_right, found.ignored) == (is_right, ()), at
