"""Recorded motions: columns that are right within the tolerance, their headers, and faulty tables."""

import numpy as np
import pytest

from crosscheck.cli.commands import main
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.tolerances import FLOOR
from crosscheck.recorded.exact import reference_table, write
from crosscheck.recorded.judgement import judge_motion
from crosscheck.recorded.reading import read
from mbref.scene import Body, Revolute, Scene, SceneError, SlideSpring, Translational
from tests.helpers.tables import double_pendulum

TIMES = np.linspace(0.0, 0.4, 81)
SCENE = double_pendulum()


@pytest.fixture(scope="module")
def table() -> dict[str, np.ndarray]:
    found = reference_table(SCENE, TIMES)
    found.pop("bound")
    return found


@pytest.mark.parametrize(
    ("tolerance", "right"),  # of the position, of the rate
    [(FLOOR, (True, False)), (2e-8, (True, True)), (0.0, (False, False))],
    ids=["default, 1e-8", "2e-8", "zero"],
)
def test_column_is_right_within_the_tolerance_of_its_scale(table, tolerance, right):
    """The errors put in are 0.9e-8 of the mechanism's length in a position, and 1.9e-8 of the largest angular
    velocity in a rate. A right column has no time at which its error begins."""
    spin = max(abs(table[f"{b}.angular_velocity.{a}"]).max() for b in ("upper", "lower") for a in "xyz")
    errors = {"upper.position.x": 0.9e-8 * scene_length(SCENE), "upper.angular_velocity.z": 1.9e-8 * spin}
    once = np.arange(len(TIMES)) == 40  # one sample of a column, for which no explanation is searched
    off = {"time": TIMES, **{name: table[name] + error * once for name, error in errors.items()}}
    found = judge_motion(SCENE, off, tolerance=tolerance)
    assert tuple(c.is_right for c in found.columns) == right
    assert found.is_right == all(right) and (found.columns[0].begins is None) == right[0]


def test_column_states_the_time_at_which_its_error_begins(table):
    """One column is 1 mm off after 0.2501 s; samples are 5 ms apart: the first wrong one is at 0.255 s."""
    late = {**table, "upper.position.x": table["upper.position.x"] + 1e-3 * (TIMES > 0.2501)}
    column = next(c for c in judge_motion(SCENE, late).columns if not c.is_right)
    assert column.name == "upper.position.x" and column.begins == pytest.approx(0.255)
    assert column.largest == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("text", "columns", "says"),
    [
        ("time,upper.x\n0,1\n800,1\n", {}, "if they are in ms"),
        ("time,upper.x\n0,1\n", {"uper.position.x": "2"}, "did you mean 'upper.position.x'"),
        ("time,upper.x\n0,1\n", {"upper.position.x": "3"}, "no column '3'"),
        ("time,upper.x\n0,1\n", {"upper.position.x": "2", "upper.x": "1"}, "is given twice"),
        ("time,upper.x [furlong]\n0,1\n", {}, "unknown unit 'furlong'"),
        ("time,upper.x [deg]\n0,1\n", {}, "'deg' is not a unit of a quantity in m"),
    ],
)
def test_faulty_table_is_refused_with_its_fault(text, columns, says, tmp_path):
    """Faults are times up to 800 s, a slip in a name, a missing column, two places and two wrong units."""
    (tmp_path / "faulty.csv").write_text(text)
    with pytest.raises(SceneError, match=says):
        read(tmp_path / "faulty.csv", SCENE, columns)


@pytest.mark.parametrize(
    ("headers", "columns", "order"),
    [
        ("lower.x [mm],lower.position.x [mm]", {"lower.x": "3"}, "wxyz"),
        ("lower.x,Way of the rod (mm)", {"lower.position.x": "Way of the rod (mm)"}, "wxyz"),
        ("lower.x,r[1]", {"lower.x": "r[1]:mm"}, "wxyz"),
        ("lower.qx,lower.qy,lower.qz,lower.qw", {}, "xyzw"),
        ("lower.qx [-],lower.qy [-],lower.qz [-],lower.qw [-]", {}, "wxyz"),
        ("lower.qw,lower.qx,lower.qy,lower.qz", {}, "xyzw"),
    ],
)
def test_chosen_columns_have_the_units_and_places_of_their_headers(headers, columns, order, table, tmp_path):
    """Two columns are x in mm, of which one is chosen by number or header. Quaternions have w last, by their
    names or by the order that is given."""
    wanted = [table["lower.position.x"] * 1e3] * 2
    if "q" in headers:
        wanted = [table[f"lower.orientation.{a}"] for a in "xyzw"]
    numbers = zip(*(column.tolist() for column in (TIMES, *wanted)), strict=True)
    rows = "\n".join(",".join(map(repr, row)) for row in numbers)
    (tmp_path / "run.csv").write_text(f"time,{headers}\n{rows}\n")
    assert judge_motion(SCENE, read(tmp_path / "run.csv", SCENE, columns, order=order)).is_right


def test_column_below_the_tolerance_and_column_that_the_scene_lacks_are_stated(tmp_path, capsys):
    """A block of 10 N on a level spring moves as 1 - A + A cos 2t, A = 1e-5 m. Its energy 2 A² sin² 2t J is
    below 1e-7 J, 1e-8 of the scene's 10 J: zeros are right only within that. `S.way` is no column."""
    size = 1e-5
    scene = Scene(
        name="slow",
        gravity=(0.0, 0.0, -10.0),
        duration=2.0,
        body=[Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))],
        joint=[Translational(name="S", bodies=("ground", "b"), anchor=(0, 0, 0), axis=(1.0, 0.0, 0.0))],
        load=[SlideSpring(joint="S", stiffness=4.0, natural_displacement=-size)],
    )
    times = np.linspace(0.0, 2.0, 21)
    x = 1 - size + size * np.cos(2 * times)
    motion = {"time": times, "b.position.x": x, "b.position.z": 0 * x, "kinetic_energy": 0 * x, "S.way": x}
    assert judge_motion(scene, motion).ignored == ("S.way",)
    write(motion, tmp_path / "run.csv")
    scene.save(tmp_path / "slow.toml")
    assert main(["judge", str(tmp_path / "slow.toml"), str(tmp_path / "run.csv")]) == 0
    lines = capsys.readouterr().out.splitlines()
    shown = {cells[1].strip(): cells[4].strip() for line in lines if len(cells := line.split("│")) == 7}
    assert {n: v for n, v in shown.items() if v != "right"} == {"kinetic_energy": "right, within 1.0e-07 J"}
    assert "not read: S.way" in lines[-1]


@pytest.mark.parametrize("duration", [100.0, 1e4])
def test_angle_of_millions_of_turns_is_right_within_its_rounding(duration):
    """A rotor turns by 1e5 t rad: 1e9 rad at 1e4 s, rounded by 1.2e-7 rad. A number a turn off is wrong."""
    spin = Body(name="r", mass=1.0, inertia=(1.0,) * 3, position=(0, 0, 0), angular_velocity=(0, 0, 1e5))
    hinge = Revolute(name="A", bodies=("ground", "r"), anchor=(0, 0, 0), axis=(0, 0, 1.0))
    scene = Scene(name="spin", duration=duration, body=[spin], joint=[hinge])
    times = np.linspace(0, duration, 11)
    angle = 1e5 * times
    assert judge_motion(scene, {"time": times, "A.angle": angle}).is_right
    angle[7] += 2 * np.pi
    assert not judge_motion(scene, {"time": times, "A.angle": angle}).is_right


def test_judge_command_ends_with_status_2_for_what_it_cannot_read(tmp_path):
    """Wrong are a column without place or with two, and no file; test_largest_numbers.py has tolerances."""
    SCENE.save(tmp_path / "s.toml")
    (tmp_path / "t.csv").write_text("time,upper.x\n0,1\n")
    judge, motion = ["judge", str(tmp_path / "s.toml")], str(tmp_path / "t.csv")
    assert main([*judge, motion, "--column", "upper"]) == 2
    assert main([*judge, motion, *("--column", "upper.position.x=2") * 2]) == 2
    assert main([*judge, str(tmp_path / "none.csv")]) == 2
