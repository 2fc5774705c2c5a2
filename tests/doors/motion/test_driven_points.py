"""Points of bodies that drivers move along directions of the world: motions, forces, dead positions, files.

A rod of 1 m and 2 kg hangs on a hinge O; the x coordinate of its tip, 0.6 m at first, follows a function.
"""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import mbref
from mbref.cli.commands import main
from mbref.scene import Driver, Free, Scene, SceneError
from tests.helpers.parts import hinge, rod
from tests.helpers.statics import DOWN, G

MASS, TIMES = 2.0, np.linspace(0.0, 1.2, 7)
ROWS = ((0.0, 0.0), (0.3, 0.2), (0.7, -0.3), (1.0, 0.1), (1.2, 0.0))
SPLINE = CubicSpline(*np.array(ROWS).T)
LAWS = {  # the driver's fields; its value and two derivatives (3, k)
    "sine": (
        {"polynomial": [0.0, -0.1], "sine": {"amplitude": 0.25, "frequency": 3.0}},
        lambda t: np.array([np.sin(3 * t) / 4 - t / 10, 0.75 * np.cos(3 * t) - 0.1, -2.25 * np.sin(3 * t)]),
    ),
    "table": ({"table": ROWS}, lambda t: np.array([SPLINE(t, n) for n in range(3)])),
}
CLOSE = 1e-10  # m, or of the largest force


def hanging(*drivers: dict) -> Scene:
    """Return the rod with drivers."""
    body = rod("rod", (0.0, 0.0, 0.0), (0.6, -0.8, 0.0), MASS)
    joints = [hinge("O", "ground", "rod", (0.0, 0.0, 0.0))]
    return Scene(name="rod", gravity=DOWN, duration=1.2, body=[body], joint=joints, driver=drivers)


def tip(along=(1.0, 0.0, 0.0), **law) -> dict:
    """Return the fields of a driver of the rod's tip."""
    return {"name": "tip", "body": "rod", "point": [0.6, -0.8, 0.0], "along": along, **law}


@pytest.mark.parametrize(
    "method", ["taylor", "lm1+projection", "alf-dual+projection", "mpi-svd+partitioning"]
)
@pytest.mark.parametrize("law", LAWS)
def test_tip_of_a_rod_follows_its_driver_by_the_force_of_lagranges_equation(law, method):
    """The tip is at (cos φ, sin φ): φ' = -x'/y, and about the hinge I φ'' = -F y - m g x / 2."""
    fields, values = LAWS[law]
    motion = mbref.simulate(hanging(tip(**fields)), method, TIMES, rtol=1e-12)
    assert motion.outcome.name == "COMPLETED", motion.message
    moved, rate, second = values(TIMES)
    x = 0.6 + moved
    y = -np.sqrt(1.0 - x**2)
    turn = -rate / y
    angular = -second / y + rate * x * turn / y**2  # y' = x φ'
    inertia = MASS / 3
    force = -(inertia * angular + MASS * G * x / 2) / y
    drive = motion.driver("tip")
    assert np.abs(motion.position[:, 0, :2] - np.array([x, y]).T / 2).max() < CLOSE
    assert np.abs(motion.joint("tip").displacement - moved).max() < CLOSE
    assert np.abs(drive.force - force).max() < CLOSE * np.abs(force).max()
    assert np.abs(drive.power - force * rate).max() < CLOSE * np.abs(force * rate).max()


def test_driven_point_out_of_reach_is_a_dead_position_at_its_time():
    """x = 0.6 + 0.5 t reaches the rod's length at 0.8 s."""
    run = mbref.simulate(hanging(tip(polynomial=[0.0, 0.5])))
    assert "the drivers come to a dead position at t = 0.8 s" in run.message


def test_driver_of_a_point_that_contradicts_another_driver_is_named(capsys, tmp_path):
    """The driver of hinge O holds the rod, whose tip the other driver moves."""
    path = str(tmp_path / "rod.toml")
    hanging({"joint": "O"}, tip(polynomial=[0.0, 0.0, 0.3])).save(path)
    assert main(["run", path]) == 2
    shown = " ".join(capsys.readouterr().err.split())
    assert "the drivers of O and tip contradict each other" in shown


def test_driver_of_a_point_is_a_driver_of_a_free_joint(tmp_path, capsys):
    """A driven point is short for a driver of a joint of type free, which constrains nothing; the scene has
    it, also after it was saved and read. MJCF has the hinge alone; its export names the missing driver."""
    scene = hanging(tip(polynomial=[0.0, "20 mm/s"]))
    free = Free(name="tip", bodies=("ground", "rod"), anchor=(0.6, -0.8, 0.0), axis=(1.0, 0.0, 0.0))
    assert scene.joint[-1] == free and scene.driver == (Driver(joint="tip", polynomial=(0.0, 0.02)),)
    scene.save(tmp_path / "rod.toml")
    assert Scene.from_file(tmp_path / "rod.toml") == scene
    assert scene.with_("driver[tip].polynomial[1]", 0.5).driver[0].polynomial[1] == 0.5
    assert main(["export", str(tmp_path / "rod.toml"), "--out", str(tmp_path / "rod.xml")]) == 0
    assert "driver of tip" in capsys.readouterr().out
    assert (tmp_path / "rod.xml").read_text().count("<joint") == 1


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"name": None}, "driver[0].joint: is required, or name of the driven point"),
        ({"along": [0, 0, 0]}, "driver[tip].along: must have a length, got the zero vector"),
        ({"body": "rodd"}, "driver[tip].body: unknown body 'rodd'; known: rod; did you mean 'rod'?"),
        ({"body": "ground"}, "driver[tip].body: a point of the ground cannot be driven"),
        ({"name": "O"}, "driver[O].name: 'O' is already the name of a joint"),
        ({"joint": "O"}, "driver[tip].joint: or a driven point, not both; got name, too"),
        ({"polynomial": [0.0, "1 rad/s"]}, "driver[tip].polynomial[1]: prescribes the displacement of a"),
    ],
)
def test_faulty_drivers_of_points_are_refused_with_their_field(change, fault):
    """A message begins with the field: a name is missing or taken, a direction is zero, a body is unknown or
    the ground, a joint is given too, or a unit is of an angle."""
    with pytest.raises(SceneError) as refusal:
        hanging({**tip(), **change})
    assert any(each.startswith(fault) for each in refusal.value.faults), refusal.value.faults
