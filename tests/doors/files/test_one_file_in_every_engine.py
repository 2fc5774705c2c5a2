"""One file in every engine: its meaning, planted differences by part and kind, verdicts and advice. The
corpus has small files of one feature each. A machine, bodies, joints, loops and couplings, is what a file
means or a reader makes of it."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crosscheck.cli.commands import main
from crosscheck.cli.files import document
from crosscheck.engines.loaders.loader import DOUBLE, MJCF, SDF, URDF, built
from crosscheck.engines.loaders.machine import Machine, vector
from crosscheck.engines.loaders.mujoco import Mujoco
from crosscheck.engines.loaders.own import Own
from crosscheck.files import public
from crosscheck.files.constraints import rows_of
from crosscheck.files.corpus import CASES
from crosscheck.files.corpus.case import value_at
from crosscheck.files.corpus.mjcf import HINGE, arm, body, hinge, model
from crosscheck.files.corpus.mjcf_equalities import pair
from crosscheck.files.differences import of_reading
from crosscheck.files.dynamics_differences import of_rows, of_values
from crosscheck.files.matching import matched
from crosscheck.files.meaning import form_of, meant
from crosscheck.files.merged import size_of
from crosscheck.files.reading import differences, displacements, file_of
from crosscheck.files.statics import poses
from crosscheck.files.statics_differences import of_statics
from reports.blocks import Moving
from reports.robot_files import blocks

ROUNDING = 1e-12  # m, rad, kg, kg m² of numbers near one, after some rotations
NOT_OURS = ("spring polynomial", "damping polynomial")
READERS = "tests.helpers.planted_readers"
LOOP = pair(
    '<connect name="close" body1="lower" body2="other" anchor="0.1 0 0.1"/>'
    '<joint name="gear" joint1="side" joint2="elbow" polycoef="0.1 2 0 0 0"/>'
)


def one_equality(kind: str) -> str:
    """Return LOOP with its equality of a kind alone, which leaves one or two freedoms; "weld" is a weld whose
    torquescale of 0 leaves rotations free."""
    others = "<connect [^>]*>" if kind == "joint" else "<joint [^>]*polycoef[^>]*>"
    text = LOOP.replace("<connect", '<weld torquescale="0"') if kind == "weld" else LOOP
    return re.sub(others, "", text).replace('polycoef="0.1', 'polycoef="0')  # the reference pose obeys it


def written(folder: Path, text: str, name: str = "robot.xml") -> Path:
    (folder / name).write_text(text)
    return folder / name


def named(kind: str, name: str, **changes: Any) -> Callable[[Machine], Machine]:
    """Return the planting of a change into one part."""

    def plant(machine: Machine) -> Machine:
        parts = [replace(p, **changes) if p.name == name else p for p in getattr(machine, kind)]
        return replace(machine, **{kind: tuple(parts)})

    return plant


def without(kind: str, name: str) -> Callable[[Machine], Machine]:
    return lambda m: replace(m, **{kind: tuple(p for p in getattr(m, kind) if p.name != name)})


TURNED = ((0.04, 0.0, 0.0), (0.0, 0.03, 0.0), (0.0, 0.0, 0.02))  # kg m²; x and y are exchanged
PLANTED = {  # part, name and field of a difference, and its planting
    ("body", "upper", "mass"): named("bodies", "upper", mass=2.001),
    ("body", "lower", "centre"): named("bodies", "lower", centre=(0.0, 0.001, 1.0)),
    ("body", "other", "inertia"): named("bodies", "other", inertia=TURNED),
    ("body", "lower", "body"): without("bodies", "lower"),
    ("joint", "shoulder", "axis"): named("joints", "shoulder", axis=(0.0, -1.0, 0.0)),
    ("joint", "elbow", "axis"): named("joints", "elbow", axis=(0.0, 2.0, 0.0)),
    ("joint", "side", "anchor"): named("joints", "side", anchor=(0.301, 0.0, 0.4)),
    ("joint", "elbow", "type"): named("joints", "elbow", type="translational"),
    ("joint", "elbow", "bodies"): named("joints", "elbow", bodies=("other", "lower")),
    ("joint", "side", "joint"): without("joints", "side"),
    ("joint", "elbow", "damping"): named("joints", "elbow", damping=(0.0, 0.1)),
    ("joint", "elbow", "stiffness"): named("joints", "elbow", stiffness=(1.0,)),
    ("joint", "elbow", "armature"): named("joints", "elbow", armature=0.1),
    ("joint", "elbow", "friction"): named("joints", "elbow", friction=0.1),
    ("joint", "elbow", "limits"): named("joints", "elbow", upper=1.0),
    ("joint", "elbow", "reference"): named("joints", "elbow", reference=0.1),
    ("loop", "close", "loop"): without("loops", "close"),
    ("loop", "close", "anchor"): named("loops", "close", anchors=((0.1, 0, 0.9), (0.1, 0, 0.901))),
    ("coupling", "side", "coupling"): without("couplings", "gear"),
    ("coupling", "side", "law"): named("couplings", "gear", coefficients=(0.1, -2.0)),
    ("gravity", "gravity", "gravity"): lambda machine: replace(machine, gravity=(0.0, 0.0, 9.81)),
}


@pytest.mark.parametrize("form", [MJCF, URDF, SDF])
def test_corpus_means_what_the_specification_says(form: str, tmp_path: Path):
    """Each file of the corpus states numbers of its feature, which are not taken from any reader."""
    for case in (case for case in CASES if case.form == form):
        path = written(tmp_path, case.text, case.file)
        machine = meant(path, form_of(path))
        for place, right in case.right.items():
            found = value_at(machine, place)
            is_text = isinstance(right, str) or (isinstance(right, tuple) and isinstance(right[0], str))
            same = found == right if is_text else np.allclose(found, right, rtol=0, atol=ROUNDING)
            assert same, f"{case.name}: {place} is {found}, not {right}"


@pytest.mark.parametrize("step", [6, pytest.param(1, marks=pytest.mark.slow)], ids=["few", "all"])
def test_own_import_builds_the_machine_of_each_file_of_the_corpus(step: int, tmp_path: Path):
    """The machine is the file's except for limits and friction of joints, which the import leaves out. Files
    of NOT_OURS have springs or dampers by polynomials, of which a scene has the first number."""
    for case in (case for case in CASES[::step] if case.name not in NOT_OURS):
        path = written(tmp_path, case.text, case.file)
        own = Own().load(path, case.form).machine()
        found = of_reading(matched(meant(path, case.form), own, DOUBLE), DOUBLE)
        assert {d.field for d in found} <= {"limits", "friction"}, (case.name, found)


def test_rest_of_a_spring_is_no_difference_where_the_import_moved_the_joint(tmp_path: Path):
    """An offset of 0.1 moves the elbow, so that the scene's spring counts from another pose."""
    path = written(tmp_path, LOOP.replace('name="elbow"', 'name="elbow" stiffness="2" springref="0.3"'))
    (elbow,) = (joint for joint in meant(path, MJCF).joints if joint.name == "elbow")
    found = of_reading(matched(meant(path, MJCF), Own().load(path, MJCF).machine(), DOUBLE), DOUBLE)
    assert elbow.rest and "rest" not in {d.field for d in found}


@pytest.mark.parametrize("planted", PLANTED, ids=" ".join)
def test_planted_difference_is_named_by_part_and_field(planted: tuple[str, str, str], tmp_path: Path):
    """One field of one part of the file's machine is changed; ``planted`` names part and field."""
    machine = meant(written(tmp_path, LOOP), MJCF)
    found = of_reading(matched(machine, PLANTED[planted](machine), DOUBLE), DOUBLE)
    assert [(d.part, d.name, d.field) for d in found] == [planted]


def test_order_names_of_models_and_direction_of_a_joint_are_no_differences(tmp_path: Path):
    """A reader may list parts in another order, write the model before names, and lead a joint from the
    child to the parent, whose axis is then reversed."""
    machine = meant(written(tmp_path, LOOP), MJCF)
    side = next(joint for joint in machine.joints if joint.name == "side")
    turned = replace(side, bodies=side.bodies[::-1], axis=vector(-np.array(side.axis)))
    joints = tuple(turned if joint is side else joint for joint in machine.joints)
    bodies = tuple(replace(body, name=f"arm/{body.name}") for body in reversed(machine.bodies))
    own = replace(machine, bodies=bodies, joints=joints)
    own = replace(own, joints=tuple(replace(j, bodies=renamed(j.bodies)) for j in own.joints))
    own = replace(own, loops=tuple(replace(loop, bodies=renamed(loop.bodies)) for loop in own.loops or ()))
    assert of_reading(matched(machine, own, DOUBLE), DOUBLE) == []


def renamed(pair_of_bodies: tuple[str, str]) -> Any:
    return tuple(name if name == "world" else f"arm/{name}" for name in pair_of_bodies)


def test_mass_matrix_and_gravity_torques_are_mujocos_at_four_poses(tmp_path: Path):
    """MuJoCo's own matrices and torques agree with those of the neutral form, the machine of the file; 0.1
    kg m² more armature of the elbow is named as a difference of the mass matrix."""
    path = written(tmp_path, LOOP.replace('name="elbow"', 'name="elbow" armature="0.5"'))
    machine, gravity = meant(path, MJCF), (1.0, 2.0, -9.0)
    asked = poses(machine, size_of(machine))
    own = [Mujoco().load(path, MJCF).statics(pose, gravity) for pose in asked]
    assert of_statics(matched(machine, machine, DOUBLE), own, asked, gravity, ROUNDING) == []
    heavier = named("joints", "elbow", armature=0.6)(machine)
    found = of_statics(matched(heavier, machine, DOUBLE), own, asked, gravity, DOUBLE)
    assert [(d.field, d.name) for d in found] == [("mass matrix", "elbow")]


def carried_by(joint: str) -> str:
    """Return an arm with a sprung and damped elbow on a body with a joint, under gravity."""
    elbow = '<joint name="elbow" type="hinge" axis="0 1 0" damping="0.3" stiffness="5" springref="20"/>'
    wrist = '<joint name="wrist" axis="1 0 0"/>'
    text = model(body("upper", joint + body("lower", elbow + body("hand", wrist))))
    return text.replace("<worldbody>", '<option gravity="1 2 -9"/><worldbody>')


DAMPED_HINGE = HINGE.replace("/>", ' damping="0.2"/>')
SPRUNG_LINE = '<joint name="s" type="slide" stiffness="9" damping="2"/><joint name="h" stiffness="3"/>'
TREES = {"tree": DAMPED_HINGE, "line": SPRUNG_LINE, "ball": '<joint type="ball"/>', "free": "<freejoint/>"}

DAMPED = {  # trees, also with joints of several freedoms, a loop and a coupling, each with dampers
    **{name: carried_by(joint) for name, joint in TREES.items()},
    **{k: one_equality(k).replace('"elbow"', '"elbow" damping="0.3"', 1) for k in ("connect", "joint")},
}


@pytest.mark.parametrize("is_damped", [True, False], ids=["its file", "a file without dampers"])
@pytest.mark.parametrize("text", DAMPED.values(), ids=DAMPED)
def test_mujoco_accelerates_as_the_file_and_dampers_it_does_not_read_are_named(text, is_damped, tmp_path):
    """MuJoCo's accelerations at random states are compared with those of the file's meaning, which come from
    differences of order four and are right to 1e-9. If MuJoCo reads the file, none differs. If it reads the
    file without dampers, each joint that has one is named with the field "damping"."""
    file = file_of(written(tmp_path, text))
    read = text if is_damped else re.sub(' damping="[^"]*"', "", text)
    engine = Mujoco().load(written(tmp_path, read, "engine.xml"), MJCF)
    own = [engine.accelerations(*state, file.asked.gravity) for state in file.asked.states]
    match = matched(file.machine, file.machine, DOUBLE)
    found = of_values(match, own, file.accelerations, "acceleration", 1e-9)
    dampers = {(joint.name, "damping") for joint in file.machine.joints if joint.damping}
    assert own and dampers and {(d.name, d.field) for d in found} == (set() if is_damped else dampers)


@pytest.mark.parametrize("kind", ["connect", "joint"])
def test_constraint_rows_of_mujoco_are_the_files_at_four_closed_poses(kind, tmp_path):
    """The file has a loop or a coupling. Poses obey it to 1e-11, and rows may differ by 1e-9."""
    file = file_of(path := written(tmp_path, DAMPED[kind]))
    rows = [Mujoco().load(path, MJCF).rows(pose) for pose in file.asked.closed]
    match = matched(file.machine, file.machine, DOUBLE)
    assert len(rows) == 4 and of_rows(match, rows, file.asked.closed, 1e3 * ROUNDING) == []


@pytest.mark.parametrize(
    "what", ["line", pytest.param("ball", marks=pytest.mark.slow), "free", "connect", "joint", "weld"]
)
def test_mbref_and_mujoco_end_runs_where_the_meaning_of_the_file_does(what: str, tmp_path: Path):
    """Runs of 0.1 s from a random state that obeys the equalities end where those of the file's own meaning
    do: our import by mbref to 1e-7, and MuJoCo in small steps, whose equalities are soft, to 1e-3."""
    file = file_of(written(tmp_path, carried_by(TREES[what]) if what in TREES else one_equality(what)))
    for reader, tolerance in ((Own(), 1e-7), (Mujoco(), 1e-3)):
        found = built(reader, file.path, MJCF, file.asked)
        assert found.ends and found.accelerations
        assert differences(matched(file.machine, found.machine, DOUBLE), file, found, DOUBLE) == []
        ends = [short for short, _ in displacements(file, found)]
        match = matched(file.machine, found.machine, DOUBLE)
        assert of_values(match, ends, file.moved, "displacement", tolerance) == []


@pytest.mark.parametrize("angle", [0.05, 1.0])
def test_motion_near_the_flat_position_of_a_parallelogram_is_no_difference(angle: float, tmp_path, capsys):
    """MuJoCo reads the file right. Near the flat position the motion may branch, and errors of its soft loop
    grow: the motion is not compared there, and the reason is printed."""
    x, z = (0.2 * f(angle) for f in (np.cos, np.sin))
    link = '<joint name="{0}" axis="0 -1 0"/><geom type="capsule" fromto="0 0 0 {1} 0 {2}" size=".01"/>'
    crank, rocker, coupler = (link.format(name, x, z) for name in "ADB")
    coupler = coupler.replace(f"{x} 0 {z}", "0.4 0 0")
    text = (
        f'<mujoco><worldbody><body>{crank}<body name="b" pos="{x} 0 {z}">{coupler}</body></body>'
        f'<body name="c" pos="0.4 0 0">{rocker}</body></worldbody>'
        '<equality><connect body1="b" body2="c" anchor="0.4 0 0"/></equality></mujoco>'
    )
    assert main(["files", str(written(tmp_path, text)), "--engine", "mujoco", "--no-advice"]) == 0
    assert ("motion not compared" in capsys.readouterr().out) == (angle < 0.1)


SERVO = '<actuator><position joint="elbow" kp="4" gear="2" armature="0.1" damping="0.2"/></actuator>'
ROPE = '<tendon><fixed stiffness="9" armature="1"><joint joint="elbow" coef="2"/></fixed></tendon>'
SWITCHED = (  # more parts, a flag that is off; stiffness, damping and friction; damping and armature
    ("", "spring", ((), (0.3,), 0.2), ((), 0.0)),
    (ROPE, "damper", ((5.0,), (), 0.2), ((), 0.0)),
    (SERVO, "constraint", ((5.0,), (0.3,), 0.0), ((0.8,), 0.4)),
)


@pytest.mark.parametrize(("more", "off", "shoulder", "elbow"), SWITCHED)
def test_flags_of_an_mjcf_file_count_and_its_servos_and_tendons_do_not(more, off, shoulder, elbow, tmp_path):
    """Damping and armature of an actuator act on its joint without control. No scene has dry friction."""
    joint = hinge('stiffness="5" damping="0.3" frictionloss="0.2"')
    file = file_of(written(tmp_path, arm(joint, more, f'<option><flag {off}="disable"/></option>')))
    first, second = file.machine.joints[-2:]
    assert (first.stiffness, first.damping, first.friction) == shoulder
    assert (second.damping, second.armature) == elbow
    for reader in (Own(), Mujoco()):
        found = built(reader, file.path, MJCF, file.asked)
        rest = differences(matched(file.machine, found.machine, DOUBLE), file, found, DOUBLE)
        assert {d.field for d in rest} <= {"friction"}, rest


@pytest.mark.parametrize(
    ("arm", "change", "name", "field"),
    [
        ("upper", lambda matrix: matrix, "close", "Jacobian"),
        ("lower", lambda matrix: (*matrix,)[:1], "close", "Jacobian"),
        ("lower", lambda matrix: (*matrix, (1.0, 0.0, 0.0)), "loops and couplings", "rank of the rows"),
    ],
    ids=["another arm", "one row instead of two", "one row more"],
)
def test_rows_that_do_not_hold_the_loop_are_named(arm, change, name, field, tmp_path):
    """In the file the loop "close" holds a point of the lower arm to the other one by two rows."""
    file = file_of(written(tmp_path, one_equality("connect")))
    match, size = matched(file.machine, file.machine, DOUBLE), size_of(file.machine)
    loops = tuple(replace(loop, bodies=(arm, loop.bodies[1])) for loop in file.machine.loops or ())
    rows = [rows_of(replace(file.machine, loops=loops), pose, size) for pose in file.asked.closed]
    changed = [replace(each, matrix=change(each.matrix)) for each in rows]
    found = of_rows(match, changed, file.asked.closed, DOUBLE)
    assert (name, field) in [(d.name, d.field) for d in found]


def read_without_mimics(folder: Path, capsys: Any) -> dict[str, Any]:
    """Return the JSON of `crosscheck files`, status 1, of a reader that drops mimics with a message."""
    case = next(case for case in CASES if (case.form, case.name) == (URDF, "mimic offset"))
    text = case.text.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><dynamics friction="0.2"/>', 1)
    path = written(folder, text, "robot.urdf")
    assert main(["files", str(path), "--engine", f"{READERS}:Uncoupled", "--json"]) == 1
    return json.loads(capsys.readouterr().out)


def test_pictures_of_a_reader_show_the_file_beside_the_machine_that_was_read(tmp_path: Path, capsys: Any):
    """The second panel has the name of each joint, though the joints are no longer coupled."""
    printed = read_without_mimics(tmp_path, capsys)
    (pictures,) = [block for block in blocks(printed) if isinstance(block, Moving)]
    assert [title for title, _ in pictures.panels] == ["the file", "uncoupled"]
    assert all(f">{name}<" in pictures.panels[1][1] for name in ("shoulder", "elbow", "wrist"))


def test_verdict_names_what_is_dropped_and_whether_the_reader_says_so(tmp_path: Path, capsys: Any):
    """Of a URDF file, friction is dropped without a message, and a mimic joint with one."""
    (found,) = read_without_mimics(tmp_path, capsys)["readers"]
    assert found["grade"] == "another machine"
    assert found["messages"] == ["mimic of joint 'wrist' is not supported"]
    assert "friction of joint shoulder (0.2) dropped without a message" in found["verdict"]
    assert "wrist follows nothing (wrist = 0.3 + -1 elbow), dropped with a message" in found["verdict"]


def test_advice_was_tried_and_refusals_have_the_readers_message(tmp_path: Path, capsys: Any):
    """The strict reader needs a model's name; unit axes, which the file also lacks, do not help it."""
    text = LOOP.replace(' model="arm"', "").replace('axis="0 1 0"', 'axis="0 2 0"')
    assert main(["files", str(written(tmp_path, text)), "--engine", f"{READERS}:Strict"]) == 1
    printed = capsys.readouterr().out
    assert "cannot read: ValueError: the model has no name" in printed
    assert printed.count("Tried:") == 1
    assert "Tried: give the model a name, <mujoco model=…>. Result: the file's machine in strict." in printed


def test_joint_without_limits_has_null_in_the_json_document(tmp_path: Path):
    """JSON has no infinity; no joint of LOOP has limits."""
    found = json.loads(json.dumps(document(file_of(written(tmp_path, LOOP)), [], []), allow_nan=False))
    assert {joint["upper"] for joint in found["machine"]["joints"]} == {None}


def test_file_whose_links_are_no_tree_is_refused_in_a_sentence(tmp_path: Path, capsys: Any):
    """Two links without a joint are two roots."""
    bad = written(tmp_path, "<robot><link name='a'/><link name='b'/></robot>", "bad.urdf")
    assert main(["files", str(bad)]) == 2
    assert "the links are no tree with one root: a, b" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("mojoco", "did you mean 'mujoco'"),
        ("no_such_module:Reader", "cannot be loaded: No module named 'no_such_module'"),
        ("json:Reader", "cannot be loaded: module 'json' has no attribute 'Reader'"),
        ("json:JSONDecoder", "cannot be loaded: the object is no class derived from"),
    ],
)
def test_unknown_reader_of_files_is_refused_with_its_reason(
    name: str, says: str, tmp_path: Path, capsys: Any
):
    """JSONDecoder is a class, and no reader of robot files."""
    assert main(["files", str(written(tmp_path, LOOP)), "--engine", name]) == 2
    assert says in capsys.readouterr().err


def test_own_import_reads_public_files_of_robots_or_refuses_them_by_name():
    """The stored records are of at least 60 files of 12 packages. Each file gives the same machine except for
    limits and friction of joints, or is refused in words, which name no folder."""
    found = [record for record in public.read() if record["reader"] == "mbref"]
    assert len(found) >= 60 and len({record["package"] for record in found}) >= 12
    for record in found:
        assert record["grade"] in ("the same machine", "the same except for") or record["words"], record
        assert {*record["causes"]} <= {"limits of a joint: lost", "friction of a joint: lost"}, record
        assert "/tmp" not in record["words"] and "without a message" not in record["words"], record
