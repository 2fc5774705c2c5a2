"""Outputs of a motion by name: drivers, springs, violations and determined reactions against closed forms."""

import csv
import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

from crosscheck.judge.joint_reactions import shared_wrenches
from mbref import Motion, Scene, find_scene, simulate
from mbref.cli.commands import main
from mbref.motions.outputs import OUTPUTS

PAGE = Path(__file__).parents[3] / "docs" / "outputs.md"
TIMES = np.linspace(0.0, 1.0, 21)
MASS, INERTIA, ARM, G = 2.0, 0.3, 0.7, 9.81
SWING = {"amplitude": 0.8, "frequency": 3.0}
STIFFNESS, DAMPING, LENGTH, TWIST = 40.0, 1.5, 0.9, 0.25
POST = (0.5, 1.1, 0.0)  # m, the spring's end on the ground
ACCURACY = 1e-8  # N, N m, W, m, m/s; rounding of values of up to 100, as drivers prescribe the motion


def pendulum(bodies=("ground", "rod"), axis=(0.0, 0.0, 2.0), load=()) -> Scene:
    """Return a rod along x that a driver turns about the origin by 0.8 sin 3t + 0.5 t."""
    rod = {"name": "rod", "mass": MASS, "inertia": [INERTIA] * 3, "position": [ARM, 0.0, 0.0]}
    hinge = {"name": "A", "type": "revolute", "bodies": bodies, "anchor": [0.0, 0.0, 0.0], "axis": axis}
    driver = {"joint": "A", "polynomial": [0.0, 0.5], "sine": SWING}
    return Scene(name="pendulum", gravity=(0, -G, 0), body=[rod], joint=[hinge], driver=[driver], load=load)


def angle(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return θ, θ' and θ'' of the rod about z."""
    return 0.8 * np.sin(3 * t) + 0.5 * t, 2.4 * np.cos(3 * t) + 0.5, -7.2 * np.sin(3 * t)


SPRINGS = (
    {
        "type": "spring",
        "bodies": ["ground", "rod"],
        "points": [POST, [1.2, 0.0, 0.0]],
        "stiffness": STIFFNESS,
        "damping": DAMPING,
        "natural_length": LENGTH,
    },
    {
        "type": "torsion_spring",
        "joint": "A",
        "stiffness": STIFFNESS,
        "damping": DAMPING,
        "natural_angle": TWIST,
    },
    {"type": "force", "body": "rod", "point": [1.2, 0.0, 0.0], "force": [1.0, 0.0, 0.0]},
)


@pytest.fixture(scope="module")
def sprung() -> Motion:
    return simulate(pendulum(load=SPRINGS), times=TIMES)


def test_length_rate_and_force_of_a_spring_follow_from_geometry(sprung):
    """The length is a distance of two points; force and power are k (l - l₀) + c l' and -F l' (ACCURACY)."""
    theta, turning, _ = angle(TIMES)
    tip = 1.2 * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    speed = 1.2 * turning[:, None] * np.stack([-np.sin(theta), np.cos(theta)], axis=1)
    apart = tip - np.array(POST[:2])
    length = np.sqrt(apart[:, 0] ** 2 + apart[:, 1] ** 2)
    rate = (apart * speed).sum(axis=1) / length
    force = STIFFNESS * (length - LENGTH) + DAMPING * rate
    found = sprung.load_at(0)
    for own, right in ((found.length, length), (found.length_rate, rate), (found.force, force)):
        assert np.allclose(own, right, rtol=0, atol=ACCURACY)
    assert np.allclose(found.power, -force * rate, rtol=0, atol=ACCURACY) and found.torque is None


def test_load_of_a_number_that_does_not_exist_is_refused(sprung):
    """The scene has the three loads of SPRINGS, which are numbered from 0."""
    with pytest.raises(IndexError, match="no load 3; the scene has 3 loads"):
        sprung.load_at(3)


def test_armature_changes_neither_violations_nor_determined_reactions():
    """An armature adds a rotor as a body, with rows that belong to no joint. Violations stay rounding, and
    the components that are determined are those of the scene without it."""
    scene = find_scene("four_bar_gravity")
    joints = [j.model_copy(update={"armature": 0.5}) if j.name == "A" else j for j in scene.joint]
    motion = simulate(scene.with_(joint=joints), times=TIMES[:3] / 10)
    assert all(level.max() < ACCURACY for level in motion.violation)
    still = simulate(scene, times=TIMES[:3] / 10).determined_reactions
    found = motion.determined_reactions
    assert set(found) == set(still) and all((found[name] == still[name]).all() for name in still)


@pytest.mark.parametrize("ground", ["frame", "body"])
def test_violation_is_the_distance_by_which_a_body_is_out_of_its_plane(ground):
    """The rod is moved across the plane at the second of three samples: by 1 mm, 1 cm/s and 0.1 m/s², which
    are the violations to rounding (ACCURACY). A motion without accelerations has no violation of them."""
    motion = simulate(find_scene("planar_slider_crank").with_(ground=ground), times=TIMES[:3] / 10)
    for level, size in {"position": 1e-3, "velocity": 1e-2, "acceleration": 0.1}.items():
        moved = getattr(motion, level).copy()
        moved[1, 1, 2] += size
        found = getattr(dataclasses.replace(motion, **{level: moved}).violation, level)
        assert found == pytest.approx([0.0, size, 0.0], abs=ACCURACY), level
    bare = dataclasses.replace(motion, acceleration=None)
    assert bare.violation.acceleration is None and "acceleration_violation" not in bare.columns()


@pytest.mark.parametrize(
    "name", ["planar_slider_crank", "four_bar", "five_bar", "spatial_slider_crank", "bennett"]
)
def test_component_is_determined_where_the_judge_finds_no_open_wrench(name):
    """The judge returns a basis of unit wrenches that may be added to all joints without a change of the
    motion; a component is open where one of them is above rounding, 1e-6. At the third sample the driven
    parallelograms are flat: further components are open there."""
    scene, flat = find_scene(name), np.pi / 2 / 124.8  # s
    motion = simulate(scene, times=(times := np.array([0.0, 0.003, flat, 0.02])))
    found = motion.determined_reactions
    for k, t in enumerate(times):
        opened = shared_wrenches(scene, t, motion.position[k], motion.orientation[k])
        for joint, basis in opened.items():
            assert (found[joint][k] == (np.abs(basis).max(axis=1, initial=0.0) < 1e-6)).all(), (joint, t)


def test_unavailable_column_is_refused_with_its_need_or_a_suggestion(sprung):
    """``bare`` has no mass, hinge A has no displacement; other names are misspelt or unknown."""
    massless = sprung.mechanism.body[0].model_copy(update={"mass": None, "inertia": None})
    bare = simulate(sprung.mechanism.with_(body=[massless], load=[]), times=TIMES[:2])
    for motion, name, says in (
        (bare, "driver(A).torque", "it needs the mass and inertia of every body"),
        (bare, "energy", "it needs the mass and inertia of every body"),
        (sprung, "A.displacement", "it needs a joint that slides"),
        (sprung, "driver(B).torque", r"did you mean 'driver\(A\)\.torque'"),
        (
            sprung,
            "colour",
            r"there are columns of rod, A, driver\(A\), load\(0\), load\(1\), load\(2\), position_violation",
        ),
    ):
        with pytest.raises(ValueError, match=says):
            motion.columns(name)


def test_columns_that_are_asked_alone_are_those_of_the_whole_table(sprung):
    """Each name, and each beginning of one that ends before a dot, is asked alone."""
    table = sprung.columns()
    beginnings = {".".join(name.split(".")[:k]) for name in table for k in range(1, 4)}
    for asked in sorted(beginnings - {"time"}):
        wanted = {name for name in table if name == asked or name.startswith(f"{asked}.")} | {"time"}
        found = sprung.columns(asked)
        assert set(found) == wanted and all((found[name] == table[name]).all() for name in wanted), asked


def test_driver_of_a_joint_that_is_not_driven_is_refused_with_the_driven_ones(sprung):
    """The pendulum has one joint, A, which is driven."""
    with pytest.raises(KeyError, match="no driver of a joint 'B'; driven joints: A"):
        sprung.driver("B")


def test_page_of_outputs_has_a_row_for_every_output():
    """The table of docs/outputs.md has column, unit, shape and meaning of OUTPUTS, in their order."""
    rows = [f"| `{o.column}` | {o.unit} | {o.shape} | {o.meaning} |" for o in OUTPUTS]
    assert [line for line in PAGE.read_text().splitlines() if line.startswith("| `")] == rows


def test_command_run_prints_and_writes_the_requested_columns(tmp_path, capsys):
    """At t = 0 the rod is level and does not accelerate: the torque is m g l = 13.734 N m."""
    path, table = (str(tmp_path / name) for name in ("my.toml", "run.csv"))
    pendulum().save(path)
    asked = ["A.angle", "driver(A).torque"]
    assert main(["run", path, "--times", "0,0.5", "--out", table, "--columns", *asked]) == 0
    shown = capsys.readouterr().out
    assert "driver(A).torque" in shown and f"{MASS * G * ARM:.5g}" in shown
    with open(table, newline="") as file:
        first = next(csv.DictReader(file))
    assert list(first) == ["time", *asked]
    assert float(first["driver(A).torque"]) == pytest.approx(MASS * G * ARM)


def test_command_plot_writes_png_and_svg(tmp_path):
    """The suffix of the file decides; a PNG begins with 0x89 and "PNG"."""
    path, picture = str(tmp_path / "my.toml"), tmp_path / "run.png"
    pendulum().save(path)
    assert main(["plot", path, "A.angle", "--samples", "5", "--out", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["plot", path, "--samples", "5", "--out", str(picture.with_suffix(".svg"))]) == 0
    assert "<svg" in picture.with_suffix(".svg").read_text()


def test_gif_of_a_short_motion_plays_four_seconds(tmp_path):
    """A motion of 1 s is slowed to 4 s: the frames' durations (ms) in the file add up to it."""
    from PIL import Image

    path = tmp_path / "my.toml"
    pendulum().save(path)
    assert main(["animate", str(path), "--samples", "7", "--out", str(tmp_path / "my.gif")]) == 0
    with Image.open(tmp_path / "my.gif") as film:
        lasts = []
        for k in range(film.n_frames):
            film.seek(k)
            lasts.append(film.info["duration"])
    assert len(lasts) == 7 and sum(lasts) == 4000


@pytest.mark.slow
def test_animation_is_written_as_mp4(tmp_path):
    """The first box of an ISO base media file has the type ftyp, at its bytes 4 to 8."""
    pytest.importorskip("imageio_ffmpeg", reason="the extra video writes MP4")
    path = tmp_path / "my.toml"
    pendulum().save(path)
    assert main(["animate", str(path), "--samples", "7", "--out", str(tmp_path / "my.mp4")]) == 0
    assert (tmp_path / "my.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize(
    ("missing", "command", "ending"),
    [("PIL", "animate", "gif"), ("imageio_ffmpeg", "animate", "mp4"), ("matplotlib.figure", "plot", "png")],
)
def test_picture_that_needs_a_missing_library_is_refused_with_the_extra_to_install(
    missing, command, ending, tmp_path, monkeypatch, capsys
):
    """None in ``sys.modules`` makes the import of the library fail; the command ends with status 2."""
    monkeypatch.setitem(sys.modules, missing, None)
    path = tmp_path / "my.toml"
    pendulum().save(path)
    assert main([command, str(path), "--samples", "3", "--out", str(tmp_path / f"my.{ending}")]) == 2
    assert "pip install 'mbref[" in capsys.readouterr().err


@pytest.mark.parametrize("duration", ["1e-300", "1e-14", "1e-6"])
def test_velocities_of_a_very_short_run_are_printed(duration, capsys):
    """The crank of the four-bar starts with -124.8 rad/s, and its coupler with 62.4 m/s."""
    assert main(["run", "four_bar", "--duration", duration, "--samples", "2", "--estimate", "no"]) == 0
    shown = capsys.readouterr().out
    assert "-124.8 │" in shown and "62.4 │" in shown, shown


def test_tables_of_many_columns_fit_80_characters_and_break_no_number(capsys):
    """19 numbers of the coupler and the energy, at three times; each table begins with the time."""
    columns = ("coupler", "energy")
    words = ("--duration", "0.02", "--samples", "3", "--columns", *columns)
    assert main(["run", "four_bar_gravity", *words]) == 0
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= 80
    cells = [line.strip("│").split("│") for line in shown.splitlines() if line.startswith("│")]
    assert {row[0].strip() for row in cells} == {"0", "0.01", "0.02"}
    motion = simulate("four_bar_gravity", times=[0.0, 0.01, 0.02]).columns(*columns)
    expected = [f"{x:.6g}" for name, of in motion.items() if name != "time" for x in np.round(of, 12) + 0.0]
    assert sorted(cell.strip() for row in cells for cell in row[1:]) == sorted(expected)
