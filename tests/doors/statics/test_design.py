"""Design: loops closed with given lengths, exchanges of joints, and diagnosis along a motion."""

import math
import tomllib

import numpy as np
import pytest

from mbref.cli.scene_files import template
from mbref.design.along_motion import along_motion
from mbref.design.assemble import assemble
from mbref.design.exchange import exchanges
from mbref.equations.counts import counts
from mbref.equations.model import Model
from mbref.scene import Coupling, Driver, Scene, SceneError, TorsionSpring
from mbref.scenes import find_scene
from tests.helpers.parts import hinge
from tests.helpers.statics import rod

ROUNDING = 1e-12  # m or rad, of lengths of about 0.5 m after 20 partial displacements


def violation(scene: Scene) -> float:
    """Return the largest violation of the joints at the start (m or rad)."""
    model = Model(scene.with_(driver=()))
    return float(np.abs(model.terms(0.0, model.start()).phi).max())


def length(scene: Scene, first: str, second: str) -> float:
    return math.dist(scene.joint_named(first).anchor, scene.joint_named(second).anchor)


def test_assembled_four_bar_has_the_requested_lengths_and_its_changes_are_listed():
    """All links have 0.5 m before. Listed are lengths before and after, and the distance by which joint C
    moves; the crank's centre of mass stays in its middle. A spring of joint A is relaxed at one
    orientation of the crank: its natural angle counts from the new pose."""
    wanted = {("A", "B"): 0.3, ("B", "C"): 0.55, ("C", "D"): 0.45, ("A", "D"): 0.52}
    spring = {"type": "torsion_spring", "joint": "A", "stiffness": 2.0, "natural_angle": 0.4}
    found = assemble(find_scene("four_bar_gravity").with_(load=[spring]), wanted)
    assert violation(found.scene) < ROUNDING
    for pair, d in wanted.items():
        assert length(found.scene, *pair) == pytest.approx(d, abs=ROUNDING)
        assert found.lengths[f"{pair[0]}–{pair[1]}"] == pytest.approx((0.5, d), abs=ROUNDING)
    before, after = (scene.joint_named("C").anchor for scene in (find_scene("four_bar_gravity"), found.scene))
    assert found.joints["C"] == pytest.approx(math.dist(before, after))
    turned = found.bodies["crank"][1]  # rad; the crank gets steeper
    assert turned > 0.01 and found.scene.load[0].natural_angle == pytest.approx(0.4 - turned)
    middle = np.mean([found.scene.joint_named(j).anchor for j in "AB"], axis=0)
    assert np.allclose(found.scene.body[0].position, middle, rtol=0, atol=ROUNDING)


def test_assembly_of_a_closed_loop_without_requested_lengths_leaves_it_in_place_to_rounding():
    """The built-in linkage is closed: its joints and bodies move (m) and turn (rad) by rounding alone."""
    scene = find_scene("bennett")
    found = assemble(scene, {})
    assert found.joints.keys() == {joint.name for joint in scene.joint}
    assert found.bodies.keys() == {body.name for body in scene.body}
    assert max(found.joints.values()) < ROUNDING
    assert max(max(displacement) for displacement in found.bodies.values()) < ROUNDING


@pytest.mark.parametrize(
    ("pair", "size", "says"),
    [
        (("A", "B"), 5.0, r"joint\[.\]: the loops cannot be closed with these lengths"),
        (("A", "X"), 1.0, "no joint 'X'; joints: A, B, C, D"),
        (("A", "C"), 1.0, "'A' and 'C' share no link"),
    ],
)
def test_impossible_length_or_pair_of_joints_is_refused(pair, size, says):
    """Links of 0.5 m close no loop with one of 5 m; there is no joint X; A-C is a diagonal."""
    with pytest.raises(SceneError, match=says):
        assemble(find_scene("four_bar_gravity"), {pair: size})


def four_bar_with_flag() -> Scene:
    """Return a four-bar whose crank is a plate of three hinges A, B and P, with a flag at P."""
    scene = find_scene("four_bar_gravity")
    changes = {"name": "P", "bodies": ("crank", "flag"), "anchor": (0.1, 0.3, 0.0)}
    third = scene.joint[1].model_copy(update=changes)
    flag = scene.body[0].model_copy(update={"name": "flag", "position": (0.1, 0.4, 0.0)})
    return scene.with_(body=(*scene.body, flag), joint=(*scene.joint, third))


def test_plate_gets_the_lengths_of_its_three_sides():
    """The sides 0.5, 0.35 and 0.25 m are between its hinges A, B and P."""
    sides = {("A", "B"): 0.5, ("A", "P"): 0.35, ("B", "P"): 0.25}
    found = assemble(four_bar_with_flag(), sides).scene
    assert violation(found) < ROUNDING
    assert [length(found, *pair) for pair in sides] == pytest.approx(list(sides.values()), abs=ROUNDING)


def test_sides_that_violate_the_triangle_inequality_are_refused():
    """The crank's three hinges cannot be 0.5, 0.1 and 0.2 m apart: 0.5 m > 0.1 m + 0.2 m."""
    with pytest.raises(SceneError, match=r"body\[crank\]: no link has these lengths"):
        assemble(four_bar_with_flag(), {("A", "B"): 0.5, ("A", "P"): 0.1, ("B", "P"): 0.2})


def test_hinge_with_a_driver_or_a_torsion_spring_is_exchanged_only_for_a_cylindrical_joint():
    """Of the joints with fewer rows only the cylindrical one has an angle, on which both act."""
    plain = find_scene("planar_slider_crank")
    spring = TorsionSpring(joint="A", stiffness=1.0, damping=0.0, natural_angle=0.1)
    kinds = {
        "free": exchanges(plain),
        "sprung": exchanges(plain.with_(load=(spring,))),
        "driven": exchanges(plain.with_(load=(), driver=(Driver(joint="A", polynomial=(0.0, 1.0)),))),
    }
    of_a = {name: {swap["A"] for swap in found if "A" in swap} for name, found in kinds.items()}
    assert of_a["free"] - {"cylindrical"} and all(kinds.values()), kinds
    assert of_a["sprung"] == of_a["driven"] == {"cylindrical"}, of_a


BALL, LINE = "spherical", "inline"


def test_one_of_two_hinges_is_removed_unless_something_acts_on_it():
    """A pendulum on two hinges of one axis has 10 rows of rank 5. A ball joint (3 rows) and a point on a line
    (2 rows) hold it as well without redundancy, and so does one hinge. If a driver acts on the upper hinge,
    only the lower one may go. The ground is a frame or a body."""
    hinges = [hinge(name, "ground", "door", (0.0, 0.0, z)) for name, z in (("lower", 0.0), ("upper", 1.0))]
    for ground in ("frame", "body"):
        twice = Scene(name="door", ground=ground, body=[rod("door", (0.5, 0.0, 0.0))], joint=hinges)
        pairs = [{"lower": one, "upper": other} for one, other in ((BALL, LINE), (LINE, BALL))]
        assert exchanges(twice) == [*pairs, {"lower": "removed"}, {"upper": "removed"}]
        driven = twice.with_(driver=(Driver(joint="upper", polynomial=(0.0, 1.0)),))
        assert exchanges(driven) == [{"lower": "removed"}]


@pytest.mark.parametrize(
    ("armature", "coupling"),
    [(0.1, ()), (0.0, (Coupling(name="gears", joints=("upper", "W"), ratio=2.0),))],
    ids=["armature", "coupling"],
)
def test_only_the_other_of_two_hinges_is_removed_if_one_has_an_armature_or_a_coupling(armature, coupling):
    """A door on two hinges of one axis; the upper one has an armature, or is geared to a wheel."""
    bodies = [rod(name, (0.5, 0.0, 0.0)) for name in ("door", "wheel")]
    hinges = [
        hinge("lower", "ground", "door", (0.0, 0.0, 0.0)),
        hinge("upper", "ground", "door", (0.0, 0.0, 1.0), armature=armature),
        hinge("W", "ground", "wheel", (0.0, 0.0, 0.0)),
    ]
    scene = Scene(name="doors", body=bodies, joint=hinges, coupling=coupling)
    assert exchanges(scene, most=20) == [{"lower": "removed"}]


def test_no_exchange_ends_the_redundancy_of_a_second_coupler_of_equal_length():
    """``exchanges`` lists only sets that end all redundancy. The five-bar is the four-bar with a bar on two
    hinges parallel to the coupler: 24 coordinates, 28 rows and one freedom, so that 5 rows are redundant. One
    of them is redundant in the plane, by equal lengths, which no joint type changes. Without the bar, a ball
    at B or C ends all redundancy."""
    assert counts(find_scene("five_bar_gravity")).redundant == 28 - (24 - 1)
    assert exchanges(find_scene("five_bar_gravity")) == []
    assert exchanges(find_scene("four_bar_gravity")) == [{"B": BALL}, {"C": BALL}]


def test_diagnosis_along_a_motion_that_ends_early_states_cause_and_time():
    """A four-bar whose hinge B is tilted by 0.003 rad closes at the start, but cannot follow its driver:
    Newton's method does not converge. Without tilt the motion ends as planned, and no cause is stated."""
    scene = find_scene("four_bar").with_(duration=0.01)
    found = along_motion(tilted_at_rest(scene, 0.003))
    assert found.end < 0.01
    assert found.stopped.startswith("the iteration did not converge at t = "), found.stopped
    assert along_motion(scene).stopped == ""


def test_driver_of_a_locked_loop_is_refused_at_the_start():
    """A hinge tilted by 0.1 rad locks the loop: the driver's rate at t = 0 contradicts the joints."""
    with pytest.raises(SceneError, match=r"driver\[A\]: contradicts the joints at t = 0, most of all at"):
        along_motion(tilted_at_rest(find_scene("four_bar"), 0.1))


def tilted_at_rest(scene, tilt):
    """Return the four-bar at rest with a revolute joint B, its axis (0, tilt, 1)."""
    corner = scene.joint_named("B")
    revolute = hinge("B", *corner.bodies, corner.anchor_pair[0], (0.0, tilt, 1.0))
    at_rest = [body.model_copy(update={"velocity": None, "angular_velocity": None}) for body in scene.body]
    return scene.with_(body=at_rest, joint=[revolute if j.name == "B" else j for j in scene.joint])


def test_redundancy_that_a_rounded_axis_hides_is_reported():
    """Axis B is off by 2e-7 rad, and the row that is redundant without this tilt has a singular value below
    the tilt and far above the rounding of 1e-16. ``by_rounding`` has it; the row still is redundant."""
    scene = find_scene("planar_slider_crank_gravity").with_(duration=0.2)
    tilted = scene.with_("joint[B].axis", [2e-7, 0.0, 1.0])
    assert along_motion(scene).by_rounding == ()
    found = along_motion(tilted)
    assert found.redundant == along_motion(scene).redundant
    assert found.by_rounding and 1e-9 < max(found.by_rounding) < 2e-7


def without_comment_sign(line: str) -> str:
    """Return the line without the sign if the rest is TOML, the head of a table or a field."""
    try:
        tomllib.loads(line.removeprefix("# "))
    except tomllib.TOMLDecodeError:
        return line
    return line.removeprefix("# ")


def test_template_is_a_scene_also_with_its_commented_entries(tmp_path):
    """The template is a slider-crank with one degree of freedom and a moment as its load. Its comments that
    are TOML, and no prose, are three further loads, a driver, and fields of the crank such as its angular
    velocity of 5 rad/s: the scene is valid with them, too."""
    (tmp_path / "plain.toml").write_text(template())
    plain = Scene.from_file(tmp_path / "plain.toml")
    assert counts(plain).degrees_of_freedom == 1
    lines = [without_comment_sign(line) for line in template().splitlines()]
    (tmp_path / "whole.toml").write_text("\n".join(lines))
    whole = Scene.from_file(tmp_path / "whole.toml")
    assert {load.type for load in whole.load} == {"moment", "force", "spring", "torsion_spring"}
    assert whole.driver and whole.body[0].angular_velocity == (0.0, 0.0, 5.0)
