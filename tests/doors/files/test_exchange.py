"""MJCF and URDF: scenes accelerate as MuJoCo's matrices of the file say, and survive a round trip."""

import dataclasses
from importlib.metadata import EntryPoint
from pathlib import Path

import mujoco
import numpy as np
import pytest

import mbref
from crosscheck.engines.mujoco.files import FORMAT
from crosscheck.judge.model_identity import Difference, gate, gate_times
from mbref import formats, rotations, simulate
from mbref.cli import main
from mbref.formats import ImportOptions
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Distance, Revolute, Scene, SceneError, Spring, Universal
from mbref.scenes import find_scene
from tests.helpers.measured import MARGIN

ALIKE = 6.1e-10  # measured difference of accelerations / the largest one; MARGIN of 10 for other processors

MODELS = Path(__file__).parent / "models"
NAMES = ("four_bar", "five_bar", "delta_leg", "stewart_legs", "slider_crank", "scissor")
EXPORTED = ("four_bar_gravity", "bennett", "andrews_squeezer", "flyball_governor", "sarrus")


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    """Register the format of MuJoCo's files, whether or not the installed metadata has it."""
    point = EntryPoint("mujoco", "crosscheck.engines.mujoco.files:FORMAT", formats.GROUP)
    monkeypatch.setattr(formats, "entry_points", lambda group: [point])


def held_acceleration(model, data) -> np.ndarray:
    """q̈ (nv,) at rest: M q̈ + c = τ + Jᵀλ with J q̈ = 0, by MuJoCo's M and J."""
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    jacobian = data.efc_J.reshape(data.nefc, model.nv)[rows]
    free = np.linalg.solve(mass, data.qfrc_passive + data.qfrc_applied - data.qfrc_bias)
    inverse = np.linalg.solve(mass, jacobian.T)
    return free - inverse @ np.linalg.pinv(jacobian @ inverse, rcond=1e-9) @ (jacobian @ free)


def acceleration_difference(scene: Scene, path: Path) -> float:
    """Return the largest difference of accelerations of centres of mass at rest at qpos0, by mbref and by
    MuJoCo's matrices of the file, over the largest acceleration, which is above 0.1 m/s²."""
    model = mujoco.MjModel.from_xml_path(str(path))
    start = simulate(scene, "mpi-svd+projection", [0.0])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    held, theirs = held_acceleration(model, data), {}
    for body in scene.body:
        to_point = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, to_point, None, np.array(body.position), model.body(body.name).id)
        theirs[body.name] = to_point @ held
    size = max(np.linalg.norm(a) for a in theirs.values())
    assert size > 0.1, theirs
    return max(np.abs(start[name].acceleration[0] - theirs[name]).max() for name in start.bodies) / size


def in_frames_of(scene: Scene, trajectory: Trajectory, own: Scene) -> Trajectory:
    """Return a trajectory of ``own`` as one of ``scene``, with bodies in another order and other axes."""
    places = [trajectory.bodies.index(body.name) for body in scene.body]
    theirs = np.array([own.body[p].orientation for p in places])
    ours = np.array([body.orientation for body in scene.body])
    turn = rotations.multiply(rotations.conjugate(theirs), ours)
    keys = ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
    changes = {key: getattr(trajectory, key)[:, places] for key in keys}
    changes["orientation"] = rotations.multiply(trajectory.orientation[:, places], turn)
    names = tuple(body.name for body in scene.body)
    again = dataclasses.replace(trajectory, bodies=names, engine="again", reactions=None, **changes)
    return Trajectory.from_record(scene.name, again.to_record())


def difference(scene: Scene, again: Scene) -> Difference | None:
    """Return the difference of poses and changes of velocity of two scenes by the judge's check."""
    runs = [simulate(s, "mpi-svd+projection", gate_times(scene)) for s in (scene, again)]
    return gate(scene, [runs[0], in_frames_of(scene, runs[1], again)])


@pytest.mark.parametrize("name", [name for name in NAMES if name != "slider_crank"])
def test_an_mjcf_file_written_and_read_again_moves_as_the_first(name, tmp_path):
    """`difference` is the judge's check of models: poses, and changes of velocity over a short time. The
    bodies of the slider-crank are others after the round trip, as the next test says."""
    scene = formats.read(MODELS / f"{name}.xml").scene
    formats.write(scene.with_(driver=()), tmp_path / "again.xml")
    again = formats.read(tmp_path / "again.xml").scene
    assert difference(scene.with_(driver=()), again) is None


def test_piston_of_a_cut_slide_is_read_in_two_parts_with_its_mass_after_a_round_trip(tmp_path):
    """The writer cuts the loop at the slide, joint 4: a share of the piston moves along it, and the rest is
    fixed to the pin and read as part of it. Both parts together have the mass of pin and piston."""
    scene = formats.read(MODELS / "slider_crank.xml").scene
    formats.write(scene, tmp_path / "again.xml")
    again = formats.read(tmp_path / "again.xml")
    assert "fixed to 'pin' and part of it: 'piston'" in again.notes
    assert FORMAT.write(scene).left_out[-1].startswith("joint D: its body piston is in parts")
    mass, found = ({body.name: body.mass for body in each.body} for each in (scene, again.scene))
    assert found.keys() == {"crank", "rod", "pin", "piston (share 4)"}
    both = mass["pin"] + mass["piston"]
    assert found["pin"] + found["piston (share 4)"] == pytest.approx(both, rel=1e-12)  # rounding
    assert acceleration_difference(again.scene, tmp_path / "again.xml") < MARGIN * ALIKE


@pytest.mark.filterwarnings("error")
def test_a_spring_whose_ends_meet_survives_a_round_trip(tmp_path):
    scene = find_scene("four_bar_gravity").with_(
        load=[Spring(bodies=("ground", "crank"), points=[(0, 1, 0)] * 2, stiffness=9, natural_length=0)]
    )
    formats.write(scene, tmp_path / "scene.xml")
    assert formats.read(tmp_path / "scene.xml").scene.load == scene.load


@pytest.mark.parametrize("name", EXPORTED)
def test_an_exported_scene_accelerates_in_mujoco_and_moves_when_read_again_as_the_scene(name, tmp_path):
    """The scene loses what MJCF cannot have: its drivers, start velocities and other loads. Gravity along no
    axis accelerates every mechanism. ``difference`` is the judge's check of models: None if all agrees."""
    scene = find_scene(name)
    loads = [load for load in scene.load if load.type in ("spring", "torsion_spring")]
    bodies = [b.model_copy(update={"velocity": None, "angular_velocity": None}) for b in scene.body]
    scene = scene.with_(driver=(), load=loads, body=bodies, gravity=(0.5, -9.0, 3.0))
    formats.write(scene, tmp_path / "scene.xml")
    assert acceleration_difference(scene, tmp_path / "scene.xml") < MARGIN * ALIKE
    assert difference(scene, formats.read(tmp_path / "scene.xml").scene) is None


def test_joints_of_a_file_become_joints_of_the_scene_by_name_and_kind():
    """In the file, px is a row of slides and hinges in a plane, u1 two hinges that cross, motor a hinge."""
    scene = formats.read(MODELS / "delta_leg.xml").scene
    expected = {"motor": "revolute", "u1": "universal", "px": "planar"}
    expected |= dict.fromkeys(("ball_a", "end_a", "end_b"), "spherical")
    assert {joint.name: joint.type for joint in scene.joint} == expected


def test_a_body_without_a_joint_is_part_of_its_parent():
    """In the file, the body `label` is a child of the body `top`, without a joint between them."""
    scissor = formats.read(MODELS / "scissor.xml")
    assert scissor.scene.joint_named("rail").type == "cylindrical"
    assert "label" not in {body.name for body in scissor.scene.body}
    assert "fixed to 'top' and part of it: 'label'" in scissor.notes


def test_a_joint_that_an_equality_holds_has_a_driver_that_keeps_it_at_zero():
    """In the file, an equality with one joint, s2, holds it at its reference."""
    scene = formats.read(MODELS / "stewart_legs.xml").scene
    assert [driver.joint for driver in scene.driver] == ["s2"] and scene.driver[0].polynomial == (0.0,)


def test_import_reports_actuators_softness_and_limits_that_it_leaves_out():
    """The five-bar has two motors, and MuJoCo's equalities are soft; the slider-crank's slide has a range."""
    left_out = formats.read(MODELS / "five_bar.xml").left_out
    assert "2 actuators without a control value: no force" in left_out
    assert any("softness of equalities" in sentence for sentence in left_out)
    assert "1 limit of a joint" in formats.read(MODELS / "slider_crank.xml").left_out


def test_export_reports_moments_and_drivers_that_it_leaves_out():
    """MJCF has neither. A moment drives the slider-crank, and a driver the four-bar."""
    left_out = FORMAT.write(find_scene("planar_slider_crank")).left_out
    assert left_out[0] == "load[0] (moment on crank): apply it by mjData.xfrc_applied"
    assert FORMAT.write(find_scene("four_bar")).left_out[0].startswith("driver of A: ")


def test_export_reports_the_mass_of_the_rod_for_a_distance_joint():
    """The rod's mass is a tenth of the least effective mass of a body at its anchors, from each body."""
    ends = Distance(name="D", bodies=("ground", "b"), anchors=[(0, 0, 1), (0, 0, 0)])
    body = Body(name="b", mass=1, inertia=(1, 1, 1), position=(0, 0, 0))
    [_, said] = FORMAT.write(Scene(name="rod", body=[body], joint=[ends])).left_out
    assert said == "distance joint D: is a rod of 0.2 kg between ball joints, with mass of b"


def changed(tmp_path, old: str, new: str) -> Path:
    """The four-bar's file with a text replaced."""
    text = (MODELS / "four_bar.xml").read_text()
    assert old in text
    (tmp_path / "changed.xml").write_text(text.replace(old, new))
    return tmp_path / "changed.xml"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('anchor="0.7 0 0"/>', 'anchor="0.7 0 0" active="false"/>', "'C' is not active"),
        ("</worldbody>", '<site name="mark"/></worldbody>', "1 site without a joint"),
        ("</equality>", '</equality><sensor><jointpos joint="A"/></sensor>', "1 sensor"),
    ],
)
def test_a_part_that_does_not_change_the_motion_is_reported(old, new, says, tmp_path):
    """An equality that is switched off, a site and a sensor are put into the file of the four-bar."""
    found = formats.read(changed(tmp_path, old, new))
    sentences = (*found.left_out, *found.notes)
    assert any(says in sentence for sentence in sentences), sentences


# an equality of two tendons by a polynomial, which no scene has
GEAR = """<tendon name="gear" tendon1="a" tendon2="d" polycoef="0 1 0.5 0 0"/></equality><tendon>
<fixed name="a"><joint joint="A" coef="1"/></fixed>
<fixed name="d"><joint joint="D" coef="1"/></fixed></tendon>"""


@pytest.mark.parametrize(
    ("old", "new", "kind", "says"),
    [
        ("</equality>", GEAR, "couplings", "'gear'"),
        ('<joint name="A"/>', '<joint name="A" frictionloss="1"/>', "friction", "dry friction of 'A'"),
        ("<worldbody>", '<option density="1.2"/><worldbody>', "fluid", "fluid"),
        ('<body name="crank"', '<body name="crank" gravcomp="1"', "gravity-compensation", "crank"),
    ],
)
def test_a_part_that_changes_the_motion_is_refused_unless_it_is_left_out(old, new, kind, says, tmp_path):
    """Without the part, the scene equals the unchanged four-bar."""
    path = changed(tmp_path, old, new)
    with pytest.raises(SceneError, match=f"{says}.*it changes the motion; --without {kind} leaves it out"):
        formats.read(path)
    found = formats.read(path, ImportOptions(without=[kind]))
    assert any(sentence.endswith(f"(--without {kind})") for sentence in found.left_out), found.left_out
    plain = formats.read(MODELS / "four_bar.xml").scene
    assert found.scene.with_(name=plain.name) == plain


def test_roll_pitch_and_yaw_of_a_loop_turn_its_axis(tmp_path):
    """URDF turns about the fixed axes x, then y, then z."""
    text = (MODELS / "four_bar.urdf").read_text()
    old = '<origin xyz="0.4 0 0"/></pre'
    assert old in text
    (tmp_path / "turned.urdf").write_text(text.replace(old, old.replace("/></", ' rpy="0.3 -0.5 0.8"/></')))
    scene = formats.read(tmp_path / "turned.urdf").scene
    roll, pitch, yaw = (rotations.from_vector(a) for a in np.diag([0.3, -0.5, 0.8]))
    turned = rotations.multiply(yaw, rotations.multiply(pitch, roll))
    assert scene.joint_named("C").axis == pytest.approx(rotations.rotate(turned, np.array([0.0, 1.0, 0.0])))


def test_import_writes_a_scene_that_export_writes_as_mjcf(tmp_path, capsys):
    """The model has a spring of 40 N/m, which stays, and two motors, left out. Counts are equal."""
    assert main(["import", str(MODELS / "five_bar.xml"), "--out", str(tmp_path / "five.toml")]) == 0
    assert "left out: 2 actuators" in capsys.readouterr().out
    assert Scene.from_file(tmp_path / "five.toml").load[0].stiffness == 40
    assert main(["export", str(tmp_path / "five.toml"), "--out", str(tmp_path / "five.xml")]) == 0
    again = formats.read(tmp_path / "five.xml").scene
    five = Scene.from_file(tmp_path / "five.toml")
    assert mbref.counts(again) == mbref.counts(five), "bodies, rows and freedoms"


@pytest.mark.parametrize(
    ("mass", "inertia", "says"),
    [(0.0, (0.0, 0.0, 0.0), "is a massless link"), (1.0, (0.0, 0.1, 0.1), "moment of inertia of 0")],
)
def test_export_refuses_a_body_that_mujoco_does_not_read_by_its_name(mass, inertia, says):
    """MuJoCo reads no moving body without mass, nor without inertia about an axis."""
    scene = find_scene("four_bar_gravity")
    light = {"mass": mass, "inertia": inertia}
    bodies = [b.model_copy(update=light) if b.name == "coupler" else b for b in scene.body]
    with pytest.raises(SceneError, match=f"body 'coupler': .*{says}"):
        FORMAT.write(scene.with_(body=bodies))


def test_names_that_mjcf_cannot_have_or_that_export_uses_get_a_number(tmp_path):
    """MJCF's world is no body; hinges A 1 and A 2 stand for a universal joint A."""
    bodies = [Body(name=n, mass=1, inertia=(1, 1, 1), position=(0, 0, 0)) for n in ("link 1", "world")]
    first = Universal.at("A", ("ground", "link 1"), anchor=(0, 0, 1), axes=((1, 0, 0), (0, 1, 0)))
    hinge = Revolute.at("A 1", ("link 1", "world"), anchor=(0, 0, 0), axis=(1, 0, 0))
    left = formats.write(Scene(name="names", body=bodies, joint=[first, hinge]), tmp_path / "a.xml")
    assert left[:2] == ("body name 'world': is 'world (2)'", "joint name 'A 1': is 'A 1 (2)'")
    again = formats.read(tmp_path / "a.xml").scene
    assert [each.name for each in (*again.body, again.joint[1])] == ["link 1", "world (2)", "A 1 (2)"]


def test_export_refuses_an_unknown_format_and_import_a_missing_file(tmp_path, capsys):
    assert main(["export", "bricard", "--out", str(tmp_path / "five.obj")]) == 2
    assert "no format writes .obj; known: .xml" in capsys.readouterr().err
    assert main(["import", str(tmp_path / "none.xml")]) == main(["import", "."]) == 2
    assert "none.xml" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["robot.xml", "robot.urdf", "robot.sdf"])
def test_diagnose_of_a_file_of_another_program_names_the_import_command(name, capsys):
    assert main(["diagnose", name]) == 2
    said = capsys.readouterr().err
    assert f"{name}: is no scene file; `mbref import {name}` makes one" in said
