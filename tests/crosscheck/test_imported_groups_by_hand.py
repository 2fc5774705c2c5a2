"""Bodies of a compiled model, its poses and its couplings / small files, worked out by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from crosscheck.engines.mujoco.importing import groups, holding, massless, reading
from crosscheck.engines.mujoco.importing.actuators import moved_to_joints
from crosscheck.engines.mujoco.importing.chains import Chain
from crosscheck.engines.mujoco.importing.closures import Closure, Frame
from crosscheck.engines.mujoco.importing.couplings import of_equalities
from crosscheck.engines.mujoco.importing.groups import Groups, Piece
from crosscheck.engines.mujoco.importing.left_out import Part
from crosscheck.engines.mujoco.importing.massless import ARMATURE, COUPLING, LOAD, LOCK
from crosscheck.engines.mujoco.importing.posing import JointRow, Poses
from mbref.scene import Cylindrical, Revolute, SceneError, Spherical, Universal

HALF = math.sqrt(0.5)
LUMP = '<inertial pos="0 0 0" mass="{}" diaginertia="1 1.5 2"/>'


def model(bodies: str, more: str = "") -> Any:
    head = '<compiler angle="radian"/>'
    return mujoco.MjModel.from_xml_string(f"<mujoco>{head}{more}<worldbody>{bodies}</worldbody></mujoco>")


def placed(model: Any, *coordinates: float) -> Any:
    """Data with the kinematics at some coordinates."""
    data = mujoco.MjData(model)
    data.qpos[: len(coordinates)] = coordinates
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


ARM = f"""
<body name="arm" pos="1 0 0"><joint name="h" axis="0 0 1"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.2 0.25"/>
  <body name="lump" pos="2 0 0"><inertial pos="0 1 0" mass="3" diaginertia="1 1 1"/></body>
  <body name="wrist" pos="3 0 0"><joint name="t1" axis="1 0 0"/><joint axis="0 1 0" pos="0 0 1"/>
  {LUMP.format(2)}</body>
</body>
<body name="post">{LUMP.format(5)}</body>
<body name="hand" mocap="true"><geom size="0.1" mass="7"/></body>
<body name="ground"><joint name="g"/><body name="light"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
</body><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
<body><joint name="k"/><body name="thin"/><body>{LUMP.format(1)}</body><body name="stout">{LUMP.format(4)}
</body></body>
"""


@pytest.fixture(scope="module")
def arm() -> Any:
    return model(ARM)


def test_bodies_that_no_joint_separates_are_one_group(arm: Any) -> None:
    found = Groups(mujoco, arm)
    assert found.members == {0: [0, 4, 5], 1: [1, 2], 3: [3], 6: [6, 7], 8: [8, 9, 10, 11]}
    assert found.mass == {0: math.inf, 1: 4.0, 3: 2.0, 6: 3.0, 8: 5.0}
    assert found.names == {0: "ground", 1: "arm", 3: "wrist", 6: "ground 6", 8: "stout"}
    assert found.massive == [1, 3, 6, 8] and found.pieces == [Piece(1), Piece(3), Piece(6), Piece(8)]
    assert [found.parent(g) for g in (1, 3, 6, 8)] == [0, 1, 0, 0]
    assert [found.children(g) for g in (0, 1, 3)] == [[1, 6, 8], [3], []]
    assert [found.joints(g) for g in (1, 3, 6)] == [[0], [1, 2], [3]]
    assert [found.name_of(b) for b in (2, 3, 5, 9)] == ["arm", "wrist", "ground", "stout"]
    assert found.main(1) == 1 and found.main(8) == 11


def test_links_between_joints_of_a_group_have_names(arm: Any) -> None:
    found = Groups(mujoco, arm)
    assert found.name(Piece(3)) == "wrist" and found.name(Piece(3, 1)) == "wrist link t1"
    assert found.name(Piece(3, 2)) == "wrist link 2" and found.name(Piece(6, 3)) == "ground 6 link g"
    found.keep(set(), {1})
    assert found.pieces == [Piece(1), Piece(3, 1), Piece(3), Piece(6), Piece(8)]
    chain = model(f'<body name="a"><joint/>{LUMP.format(2)}<body><joint/>{LUMP.format(1)}</body></body>')
    chain.body_mass[1] = 0.0
    thin = Groups(mujoco, chain)
    assert thin.massive == [2]
    thin.keep({1}, set())
    assert thin.pieces == [Piece(1), Piece(2)]


def test_a_group_has_the_mass_and_the_inertia_of_its_bodies(arm: Any) -> None:
    """Centre (1, 0, 0)/4 + 3 (3, 1, 0)/4; by Steiner's theorem with the arms (-1.5, -0.75), (0.5, 0.25)."""
    found, data = Groups(mujoco, arm), placed(arm)
    body = found.body(data, Piece(1), np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
    assert (body.name, body.mass) == ("arm", 4.0) and body.position == pytest.approx((2.5, 0.75, 0.0))
    wanted = [[1.85, -1.5, 0.0], [-1.5, 4.2, 0.0], [0.0, 0.0, 5.0]]
    assert np.array(body.inertia) == pytest.approx(np.array(wanted))
    assert body.velocity == (1.0, 2.0, 3.0) and body.angular_velocity == (4.0, 5.0, 6.0)
    plain = found.body(data, Piece(3), None)
    assert plain.inertia == (1.0, 1.5, 2.0) and plain.velocity is None and plain.angular_velocity is None
    link = found.body(data, Piece(3, 1), None)
    assert link.mass == 0.0 and link.position == pytest.approx((4.0, 0.0, 1.0))
    assert np.abs(link.inertia).max() == 0.0


def test_inertia_is_in_the_axes_of_the_body(arm: Any) -> None:
    """A quarter turn of the arm turns the body, but not its inertia in its own axes."""
    found, data = Groups(mujoco, arm), placed(arm, math.pi / 2)
    body = found.body(data, Piece(1), None)
    assert body.position == pytest.approx((1 - 0.75, 1.5, 0.0)) and body.orientation == pytest.approx(
        (HALF, 0.0, 0.0, HALF)
    )
    wanted = [[1.85, -1.5, 0.0], [-1.5, 4.2, 0.0], [0.0, 0.0, 5.0]]
    assert np.array(body.inertia) == pytest.approx(np.array(wanted))


@pytest.mark.parametrize(("product", "is_plain"), [(1.0, True), (-1.0, True), (1.000001, False)])
def test_products_of_inertia_that_are_rounding(
    arm: Any, monkeypatch: pytest.MonkeyPatch, product: float, is_plain: bool
) -> None:
    """A quarter of the largest moment, 4."""
    monkeypatch.setattr(groups, "PLAIN", 0.25)
    found, data = Groups(mujoco, arm), placed(arm)
    inertia = np.array([[3.0, 0.0, product], [0.0, 4.0, 0.0], [product, 0.0, 2.0]])
    monkeypatch.setattr(found, "_inertia", lambda data, group, centre: inertia)
    body = found.body(data, Piece(1), None)
    assert body.inertia == ((3.0, 4.0, 2.0) if is_plain else tuple(map(tuple, inertia.tolist())))


def test_a_link_turns_with_the_joints_before_it(arm: Any) -> None:
    found, data = Groups(mujoco, arm), placed(arm, 0.0, math.pi / 2, 0.3)
    link, whole = found.placed(data, Piece(3, 1)), found.placed(data, Piece(3))
    assert link.orientation == pytest.approx([HALF, HALF, 0.0, 0.0])
    c, s = HALF * math.cos(0.15), HALF * math.sin(0.15)
    assert whole.orientation == pytest.approx([c, c, s, s])
    assert link.position == pytest.approx([4.0, -1.0, 0.0], abs=1e-12)
    straight = found.placed(placed(arm), Piece(3, 1)).jacobian
    wanted = np.zeros((6, 5))
    wanted[:, 0], wanted[:, 1] = (0, 3, 0, 0, 0, 1), (0, -1, 0, 1, 0, 0)
    assert straight == pytest.approx(wanted, abs=1e-12)
    assert found.placed(placed(arm), Piece(3)).jacobian[:, 2] == pytest.approx([-1, 0, 0, 0, 1, 0])


def test_a_link_before_a_ball_joint_or_a_slide_does_not_turn_with_it() -> None:
    joints = '<joint name="a" axis="0 0 1"/><joint name="b" type="ball"/>'
    turned = model(f'<body name="x">{joints}{LUMP.format(1)}</body>')
    for ball in ((0.5, 0.5, -0.5, 0.5), (0.7, 0.1, 0.5, -0.5)):
        data = placed(turned, math.pi / 2, *ball)
        link = Groups(mujoco, turned).placed(data, Piece(1, 0))
        assert link.orientation == pytest.approx([HALF, 0, 0, HALF])
    sliding = model(f'<body name="x">{joints.replace("ball", "slide")}{LUMP.format(1)}</body>')
    found = Groups(mujoco, sliding).placed(placed(sliding, math.pi / 2, 2.0), Piece(1, 0))
    assert found.orientation == pytest.approx([HALF, 0.0, 0.0, HALF])
    referred = '<joint name="a" axis="0 0 1" ref="0.5"/><joint name="b" axis="0 0 1" ref="0.3"/>'
    sprung = model(f'<body name="x">{referred}{LUMP.format(1)}</body>')
    found = Groups(mujoco, sprung).placed(placed(sprung, 0.5 + math.pi / 2, 1.0), Piece(1, 0))
    assert found.orientation == pytest.approx([HALF, 0.0, 0.0, HALF])


def test_accelerations_at_constant_rates_are_centripetal_and_gyroscopic(arm: Any) -> None:
    """The arm turns with 2 rad/s about z, 3 m from the wrist, whose joints turn with 3 and 5 rad/s."""
    found, data = Groups(mujoco, arm), placed(arm)
    data.qvel[:3] = 2.0, 3.0, 5.0
    mujoco.mj_comVel(arm, data)
    assert found.drift(data, Piece(3, 1)) == pytest.approx([0, 0, -9, 0, 6, 0], abs=1e-12)
    assert data.qvel[:3].tolist() == [2.0, 3.0, 5.0]
    assert found.drift(data, Piece(3)) == pytest.approx([-12, -20, 25, -10, 6, 15])
    assert found.drift(data, Piece(1)) == pytest.approx([-6, -3, 0, 0, 0, 0])


def test_a_link_does_not_accelerate_by_a_slide_behind_it() -> None:
    """A hinge turns the link with 2 rad/s, 1 m from its axis; the slide behind it has 3 m/s."""
    joints = '<joint axis="0 0 1"/><joint type="slide" axis="1 0 0" pos="1 0 0"/>'
    moved = model(f'<body name="x">{joints}{LUMP.format(1)}</body>')
    data = placed(moved)
    data.qvel[:] = 2.0, 3.0
    mujoco.mj_comVel(moved, data)
    found = Groups(mujoco, moved)
    assert found.drift(data, Piece(1, 0)) == pytest.approx([-4, 0, 0, 0, 0, 0], abs=1e-12)
    assert found.drift(data, Piece(1)) == pytest.approx([0, 12, 0, 0, 0, 0], abs=1e-12)


def test_bodies_fixed_to_the_ground_have_no_note_on_bodies_that_are_one() -> None:
    reader: Any = object.__new__(reading._Reader)
    pillars = "".join(f'<body name="{n}">{LUMP.format(1)}</body>' for n in "pq")
    arm = f'<body name="a"><joint/>{LUMP.format(1)}<body name="empty"/><body name="b">{LUMP.format(2)}</body>'
    reader.model = model(f"{pillars}{arm}</body>")
    reader.groups, reader.notes = Groups(mujoco, reader.model), []
    reader._read_merged()
    assert reader.notes == ["fixed to 'a' and part of it: 'b'"]


def test_a_ball_has_no_armature_in_a_scene() -> None:
    reader: Any = object.__new__(reading._Reader)
    reader.without, reader.kept = frozenset(), []
    reader.model = model(f'<body><joint type="ball" armature="2"/>{LUMP.format(1)}</body>')
    ball = Spherical(name="j", bodies=("ground", "b"), anchor=(0, 0, 0))
    assert reader._with_armature(row("ball", [(0, 0, 1)]), [ball]) == [ball] and not reader.kept


# --- Poses ------------------------------------------------------------------------------------------------
SLIDES = f"""<body name="a"><joint name="a" type="slide" axis="1 0 0"/>{LUMP.format(1)}</body>
<body name="b"><joint name="b" type="slide" axis="1 0 0"/>{LUMP.format(3)}</body>"""
KEYS = '<keyframe><key name="upper" qpos="0.5 0.25" qvel="3 4"/></keyframe>'


def poses(extent: float = 1.0, ratio: float = 2.0, more: str = "") -> Poses:
    """Two slides of 1 kg and 3 kg, of which the first is at 0.4 m + ratio times the second."""
    return Poses(mujoco, model(SLIDES, more), (), [JointRow("r", (0, 1), 0.4, ratio)], extent)


@pytest.mark.parametrize("extent", [0.1, 1.0, 5.0])
def test_loops_close_by_the_least_change_weighted_with_the_masses(extent: float) -> None:
    """m a² + 3 m b² is least with a = 0.4 + 2 b: a = 1.2/7, b = -0.8/7."""
    found = poses(extent)
    found.start("", {})
    assert found.gaps() == {"r": pytest.approx(0.4)} and found.residuals() == pytest.approx([-0.4])
    assert found.jacobian().tolist() == [[1.0, -2.0]]
    found.close()
    assert found.data.qpos == pytest.approx([1.2 / 7, -0.8 / 7], rel=1e-8) and found.gaps()["r"] < 1e-12


def test_given_coordinates_stay_and_others_close_the_loop() -> None:
    found = poses()
    found.start("", {"b": 0.3})
    assert found.held == [1] and found.data.qpos.tolist() == [0.0, 0.3]
    found.close()
    assert found.data.qpos == pytest.approx([1.0, 0.3])
    both = poses()
    both.start("", {"a": 0.6, "b": 0.3})
    assert not both._newton([0, 1]) and both.data.qpos.tolist() == [0.6, 0.3]
    both.close()  # the last attempts leave the given pose
    assert both.gaps()["r"] < 1e-12


def test_a_keyframe_is_the_start_with_its_velocities() -> None:
    found = poses(more=KEYS)
    found.start("upper", {"a": 0.75})
    assert found.data.qpos.tolist() == [0.75, 0.25] and found.data.qvel.tolist() == [3.0, 4.0]
    assert found.data.xpos[1:, 0] == pytest.approx([0.75, 0.25])


def test_what_a_pose_cannot_name() -> None:
    found = poses(more=KEYS)
    with pytest.raises(
        SceneError, match=r"--keyframe: no keyframe 'uper'; known: upper; did you mean 'upper'\?$"
    ):
        found.start("uper", {})
    with pytest.raises(SceneError, match=r"--pose: no joint 'z'; known: a, b$"):
        found.start("", {"z": 1.0})
    ball = Poses(mujoco, model(f'<body><joint name="q" type="ball"/>{LUMP.format(1)}</body>'), (), (), 1.0)
    with pytest.raises(SceneError, match="--pose q: has several coordinates; only hinges and slides"):
        ball.start("", {"q": 1.0})
    with pytest.raises(SceneError, match=r"no keyframe 'x'; known: none$"):
        ball.start("x", {})


def test_a_coordinate_counts_from_its_reference() -> None:
    text = SLIDES.replace('name="b" type', 'name="b" ref="0.1" type').replace(
        'name="a" type', 'name="a" ref="7" type'
    )
    found = Poses(
        mujoco, model(text), (), [JointRow("r", (0, 1), 0.4, 2.0), JointRow("s", (1, -1), 0.2, 9.0)], 1
    )
    found.start("", {"a": 7.5, "b": 0.35})
    assert found.residuals() == pytest.approx([0.5 - 0.4 - 0.5, 0.25 - 0.2])
    assert found.gaps() == {"r": pytest.approx(0.4), "s": pytest.approx(0.05)}
    assert found.jacobian().tolist() == [[1.0, -2.0], [0.0, 1.0]]


@pytest.mark.parametrize(("extent", "length"), [(0.5, 0.05), (3.0, 0.1)])
def test_a_straight_pose_is_left_along_the_accelerations(extent: float, length: float) -> None:
    """Springs of 6 N/m at 1 m accelerate 1 kg and 3 kg by 6 and 2 m/s²; the largest change has the length."""
    text = SLIDES.replace('type="slide"', 'type="slide" stiffness="6" springref="1"')
    found = Poses(mujoco, model(text), (), (), extent)
    found.start("", {})
    assert found._fall() == pytest.approx([length, length / 3])
    found.held = [0]
    assert found._fall() == pytest.approx([0.0, length])
    found.held = [0, 1]
    assert found._fall().tolist() == [0.0, 0.0]
    weight = Poses(mujoco, model(SLIDES.replace('axis="1 0 0"', 'axis="0 0 1"')), (), (), 1.0)
    weight.start("", {})
    assert weight._fall() == pytest.approx([-0.1, -0.1])


def test_a_loop_that_nothing_closes_has_the_least_gap() -> None:
    found = Poses(
        mujoco, model(SLIDES), (), [JointRow("r", (0, -1), 0.4, 0), JointRow("s", (0, -1), 0.6, 0)], 1.0
    )
    found.start("", {})
    with pytest.raises(SceneError, match=r"closure '[rs]': cannot be closed .* gap found is 0.1 m or rad"):
        found.close()


def test_a_step_is_bounded_by_a_fifth_of_the_extent() -> None:
    moved: list[np.ndarray] = []

    def integrate(model: Any, qpos: np.ndarray, step: np.ndarray, dt: float) -> None:
        moved.append(step.copy())
        mujoco.mj_integratePos(model, qpos, step, dt)

    class Watched:
        def __getattr__(self, name: str) -> Any:
            return integrate if name == "mj_integratePos" else getattr(mujoco, name)

    for extent, longest in ((0.5, 0.1), (8.0, 0.2)):
        moved.clear()
        found = Poses(Watched(), model(SLIDES), (), [JointRow("r", (0, -1), 0.5, 0.0)], extent)
        found.start("", {})
        found.close()
        assert moved[0] == pytest.approx([longest, 0.0]) and len(moved) <= 0.5 / longest + 2


@pytest.mark.parametrize(
    ("gap", "extent", "moves"), [(1.5e-12, 1.0, True), (1.5e-12, 0.1, True), (1.5e-12, 2.0, False)]
)
def test_gaps_within_rounding_of_the_extent_are_closed(gap: float, extent: float, moves: bool) -> None:
    found = Poses(mujoco, model(SLIDES), (), [JointRow("r", (0, -1), gap, 0.0)], extent)
    found.start("", {})
    found.close()
    assert found.data.qpos[0] == pytest.approx(gap if moves else 0.0)


@pytest.mark.parametrize(
    ("apart", "extent", "closes"), [(3e-9, 1.0, False), (3e-9, 0.1, False), (3e-9, 2.0, True)]
)
def test_loops_that_nearly_close(apart: float, extent: float, closes: bool) -> None:
    """Two rows that ask for different places of one slide leave half of their distance, 1.5e-9 m."""
    rows = [JointRow("r", (0, -1), 0.0, 0.0), JointRow("s", (0, -1), apart, 0.0)]
    found = Poses(mujoco, model(SLIDES), (), rows, extent)
    found.start("", {})
    assert found._newton([]) is closes and found.data.qpos[0] == pytest.approx(apart / 2)


def test_redundant_rows_have_small_singular_values() -> None:
    """Rows are weighted with the roots of the masses, 1 and √3; 1e-9 of the largest counts as zero."""
    found = poses()
    for small, wanted in ((1.5e-9, -1 / 1.5e-9), (0.9e-9, 0.0)):
        step = found._step(np.array([2.0, 1.0]), np.array([[1.0, 0.0], [0.0, small * math.sqrt(3)]]), [])
        assert step == pytest.approx([-2.0, wanted / math.sqrt(3)], rel=1e-6)
    light = SLIDES.replace('mass="3"', 'mass="1.5e-9"').replace("type", 'stiffness="1" springref="1" type')
    for mass, wanted in (("1.5e-9", [1.5e-10, 0.1]), ("0.9e-9", [0.1, 0.0])):
        falling = Poses(mujoco, model(light.replace("1.5e-9", mass)), (), (), 1.0)
        falling.start("", {})
        assert falling._fall() == pytest.approx(wanted, abs=1e-15)


def test_attempts_to_close_a_loop() -> None:
    """From the given pose and after a fall, with and without the given coordinates, 200 steps each."""
    moved: list[float] = []

    class Still:
        def __getattr__(self, name: str) -> Any:
            if name == "mj_integratePos":
                return lambda model, qpos, step, dt: moved.append(float(np.abs(step * dt).max()))
            return getattr(mujoco, name)

    text = SLIDES.replace("type", 'stiffness="1" springref="1" type')
    found = Poses(Still(), model(text), (), [JointRow("r", (0, -1), 0.5, 0.0)], 1.0)
    found.start("", {"b": 0.0})
    with pytest.raises(
        SceneError, match=r"closure 'r': cannot be closed from this pose; the least gap found is 0\.5 m"
    ):
        found.close()
    assert moved.count(0.1) == 2 and moved.count(0.2) == 800 and len(moved) == 802
    assert moved[200] == 0.1 and moved[601] == 0.1
    found.held = [0]
    assert found._fall() == pytest.approx([0.0, 0.1]), "coordinates that are given do not fall"


def test_one_open_loop_of_two_is_open() -> None:
    """The second slide closes; the first one cannot be at two places."""
    rows = [
        JointRow("r", (0, -1), 0.0, 0.0),
        JointRow("s", (0, -1), 1.0, 0.0),
        JointRow("t", (1, -1), 0.5, 0.0),
    ]
    found = Poses(mujoco, model(SLIDES), (), rows, 1.0)
    found.start("", {})
    assert found._newton([]) is False and found.data.qpos == pytest.approx([0.5, 0.5])


def test_a_coordinate_without_mass_has_a_billionth_of_the_mean_mass() -> None:
    """1 kg beside 3 kg: 1 m is shared as 3 to 1. Without the first mass its share is 3 to 1.5e-9."""
    found = poses()
    one = found._step(np.array([1.0]), np.array([[1.0, 1.0]]), [])
    assert one == pytest.approx([-0.75, -0.25])
    found.mass = lambda: np.diag([0.0, 3.0])  # type: ignore[method-assign]
    bare = found._step(np.array([1.0]), np.array([[1.0, 1.0]]), [])
    assert bare[1] / bare[0] == pytest.approx(1.5e-9 / 3, rel=1e-6)


# --- Couplings --------------------------------------------------------------------------------------------
THREE = "".join(
    f'<body name="{n}"><joint name="{n}" axis="0 0 1"/><site name="{n}"/>{LUMP.format(1)}</body>'
    for n in "xyz"
)
TENDONS = """<tendon><fixed name="p"><joint joint="x" coef="2"/></fixed>
<fixed name="q"><joint joint="y" coef="3"/></fixed>
<fixed name="both"><joint joint="x" coef="4"/><joint joint="y" coef="2"/></fixed>
<fixed name="all"><joint joint="x" coef="1"/><joint joint="y" coef="1"/><joint joint="z" coef="1"/></fixed>
<spatial name="rope"><site site="x"/><site site="y"/></spatial></tendon>"""


def equality(text: str, without: frozenset[str] = frozenset()) -> tuple[list[Any], list[int]]:
    """Return the closures and rows of the equalities, and whether each equality is still active."""
    found = model(THREE, f"{TENDONS}<equality>{text}</equality>")
    return list(of_equalities(mujoco, found, without)), found.eq_active0.tolist()


@pytest.mark.parametrize(
    ("text", "row"),
    [
        ('joint name="e" joint1="x" joint2="z" polycoef="0.2 5 0 0 0"', JointRow("e", (0, 2), 0.2, 5.0)),
        ('joint joint1="y" polycoef="0.2 5 0 0 0"', JointRow("equality 0", (1, -1), 0.2, 0.0)),
        ('joint joint1="y" polycoef="0.2 5 6 7 8"', JointRow("equality 0", (1, -1), 0.2, 0.0)),
        ('joint name="e" joint1="x" joint2="z" polycoef="0.2 0 0 0 0"', JointRow("e", (0, -1), 0.2, 0.0)),
        # 2 x = 0.6 + 0.5 · 3 y
        (
            'tendon name="e" tendon1="p" tendon2="q" polycoef="0.6 0.5 0 0 0"',
            JointRow("e", (0, 1), 0.3, 0.75),
        ),
        ('tendon name="e" tendon1="p" polycoef="0.6 0.5 0 0 0"', JointRow("e", (0, -1), 0.3, 0.0)),
        # 4 x + 2 y = 0.8
        ('tendon name="e" tendon1="both" polycoef="0.8 0 0 0 0"', JointRow("e", (0, 1), 0.2, -0.5)),
        # 4 x + 2 y = 0.8 + 2 · 2 x leaves y
        (
            'tendon name="e" tendon1="both" tendon2="p" polycoef="0.8 2 0 0 0"',
            JointRow("e", (1, -1), 0.4, 0.0),
        ),
    ],
)
def test_equalities_are_rows_of_two_coordinates(text: str, row: JointRow) -> None:
    found, active = equality(f"<{text}/>")
    assert (found[0].name, found[0].joints) == (row.name, row.joints) and len(found) == 1
    assert (found[0].offset, found[0].ratio) == pytest.approx((row.offset, row.ratio)) and active == [1]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            'joint name="e" joint1="x" joint2="z" polycoef="0 1 0 0 3"',
            "of type joint, whose polynomial is not linear",
        ),
        (
            'joint name="e" joint1="x" joint2="y" polycoef="0 1 3 0 0"',
            "of type joint, whose polynomial is not linear",
        ),
        ('tendon name="e" tendon1="all"', "of type tendon, which couples 3 joints instead of two"),
        (
            'tendon name="e" tendon1="rope"',
            "of type tendon, of a tendon that no fixed sum of joint coordinates gives",
        ),
    ],
)
def test_equalities_that_are_no_rows_are_parts_and_inactive(text: str, sentence: str) -> None:
    assert equality(f"<{text}/>") == ([Part("couplings", f"equality 'e' {sentence}")], [0])


def test_a_row_of_a_tendon_whose_second_joint_is_the_first_of_the_file() -> None:
    """2 y + 4 x = 0.8: y follows x with the ratio -2."""
    turned = TENDONS.replace(
        '<joint joint="x" coef="4"/><joint joint="y" coef="2"/>',
        '<joint joint="y" coef="2"/><joint joint="x" coef="4"/>',
    )
    text = '<equality><tendon name="e" tendon1="both" polycoef="0.8 0 0 0 0"/></equality>'
    [found] = of_equalities(mujoco, model(THREE, turned + text), frozenset())
    assert found == JointRow("e", (1, 0), 0.4, -2.0)


def test_equalities_of_other_types_are_parts() -> None:
    """A weld is a closure; a type that holds a body that deforms is none."""
    kinds = mujoco.mjtEq
    found = model(THREE, '<equality><joint name="e" joint1="x" joint2="z"/></equality>')
    found.eq_data[0, 5] = 7.0  # behind the five coefficients
    [row] = of_equalities(mujoco, found, frozenset())
    assert row == JointRow("e", (0, 2), 0.0, 1.0)
    found.eq_data[0, 4] = 7.0
    [part] = of_equalities(mujoco, found, frozenset())
    assert part == Part("couplings", "equality 'e' of type joint, whose polynomial is not linear")
    found.eq_type[0], found.eq_active0[0] = kinds.mjEQ_FLEX, 1
    [part] = of_equalities(mujoco, found, frozenset())
    assert part == Part("couplings", "equality 'e' of type flex") and not found.eq_active0[0]
    found.eq_active0[0] = 1
    assert list(of_equalities(mujoco, found, frozenset({"couplings"}))) == [part]


def test_couplings_that_are_left_out_are_inactive_and_locks_stay() -> None:
    text = '<joint name="e" joint1="x" joint2="z"/><joint name="f" joint1="y"/>'
    lock = JointRow("f", (1, -1), 0.0, 0.0)
    part = Part("couplings", "equality 'e' of type joint")
    assert equality(text, frozenset({"couplings"})) == ([part, lock], [0, 1])
    assert equality(text, frozenset({"springs"})) == ([JointRow("e", (0, 2), 0.0, 1.0), lock], [1, 1])


def test_inactive_equalities_are_noted_and_closures_are_read_elsewhere() -> None:
    text = '<joint joint1="x" active="false"/><connect site1="x" site2="y"/><weld site1="x" site2="z"/>'
    assert equality(text) == (["equality 'equality 0' is not active: it is not part of the scene"], [0, 1, 1])


# --- Actuators --------------------------------------------------------------------------------------------
ACTED = f"""<body name="u"><joint name="s" type="slide" damping="0.5" armature="0.25"/>{LUMP.format(1)}</body>
<body name="v"><joint name="r"/><site name="v"/>{LUMP.format(1)}</body>
<body name="w"><joint name="b" type="ball"/>{LUMP.format(1)}</body>"""


def test_rotors_of_actuators_move_to_their_joints_by_the_square_of_the_gear() -> None:
    found = model(
        ACTED,
        '<actuator><motor joint="s" gear="2" armature="3" damping="5"/>'
        '<motor joint="r" gear="3" damping="7"/>'
        '<motor jointinparent="r" gear="10" armature="0.5"/></actuator>',
    )
    assert list(moved_to_joints(mujoco, found)) == []
    assert found.dof_armature.tolist() == [0.25 + 12.0, 50.0, 0, 0, 0]
    assert found.dof_damping.tolist() == [0.5 + 20.0, 63.0, 0, 0, 0]
    assert not found.actuator_armature.any() and not found.actuator_damping.any()


def test_rotors_of_other_actuators_are_parts() -> None:
    found = model(
        ACTED,
        '<tendon><fixed name="t"><joint joint="s" coef="1"/></fixed></tendon>'
        '<actuator><motor name="m" tendon="t" armature="3"/><motor joint="b" damping="2"/>'
        '<motor joint="r" name="p" damping="0 1 0"/></actuator>',
    )
    assert list(moved_to_joints(mujoco, found)) == [
        Part("armature", "armature of 'm', which is no actuator of a hinge or slide"),
        Part("damping", "damping of 'actuator 1', which is no actuator of a hinge or slide"),
        Part("damping", "polynomial damping of 'p'"),
    ]
    assert found.dof_armature.tolist() == [0.25, 0, 0, 0, 0] and found.dof_damping.tolist() == [
        0.5,
        0,
        0,
        0,
        0,
    ]
    assert not found.actuator_dampingpoly.any()


# --- Massless links ---------------------------------------------------------------------------------------
def test_what_acts_along_a_joint() -> None:
    bodies = "".join(
        f'<body><joint name="{n}" type="slide" {more}/>{LUMP.format(1)}</body>'
        for n, more in (
            ("a", 'armature="1"'),
            ("b", 'stiffness="1"'),
            ("c", 'damping="1"'),
            ("d", ""),
            ("e", ""),
            ("f", ""),
        )
    )
    found = model(
        bodies,
        '<actuator><motor joint="d"/></actuator><keyframe><key name="k" ctrl="2"/></keyframe>',
    )
    rows = [JointRow("r", (4, 0), 0.0, 1.0), JointRow("s", (5, -1), 0.0, 0.0)]
    wanted = {0: {ARMATURE, COUPLING}, 1: {LOAD}, 2: {LOAD}, 3: {LOAD}, 4: {COUPLING}, 5: {LOCK}, -1: {LOCK}}
    assert massless.needs(mujoco, found, rows, 0, frozenset()) == wanted
    bare = massless.needs(mujoco, found, [], -1, frozenset({"armature"}))
    assert bare == {1: {LOAD}, 2: {LOAD}}


def test_groups_at_the_ends_of_closures_and_springs_are_held() -> None:
    tendons = """<tendon><spatial stiffness="1"><site site="x"/><site site="ground"/></spatial>
    <spatial><site site="y"/><site site="ground"/></spatial>
    <spatial damping="1"><site site="z"/><geom geom="g"/><site site="x"/></spatial></tendon>"""
    more = '<site name="ground"/><geom size="1"/><body name="w"><joint/><geom name="g" size="0.1"/></body>'
    found = model(THREE + more, tendons)
    assert massless.held(found, Groups(mujoco, found), ()) == {0, 1, 3}
    at = Frame(2, np.zeros(3), np.eye(3)), Frame(4, np.zeros(3), np.eye(3))
    closed = Closure("c", Spherical, at)
    bare = model(THREE + more)
    assert massless.held(bare, Groups(mujoco, bare), [closed]) == {2, 4}


def row(kinds: str, axes: Any) -> Chain:
    count = len(kinds.split())
    anchors = np.zeros((count, 3))
    return Chain(
        (Piece(0), Piece(1)), tuple(range(count)), tuple(kinds.split()), anchors, np.array(axes, float)
    )


def test_a_row_of_joints_is_one_joint_unless_something_acts_along_a_part() -> None:
    pair = row("hinge slide", [(0, 0, 1), (0, 0, 1)])
    sleeve = [Cylindrical(name="c", bodies=("ground", "b"), anchor=(0, 0, 0), axis=(0, 0, 1))]
    cross = [Universal(name="u", bodies=("ground", "b"), anchor=(0, 0, 0), axes=((1, 0, 0), (0, 1, 0)))]
    for wanted, carried in (
        ({}, True),
        ({0: {ARMATURE, LOAD, COUPLING}}, True),
        ({1: {LOAD, COUPLING}}, True),
        ({1: {ARMATURE}}, False),
        ({0: {LOCK}}, False),
        ({1: {LOCK}}, False),
    ):
        assert massless._carries(pair, sleeve, wanted) is carried, wanted
    assert massless._carries(pair, cross, {}) and not massless._carries(pair, cross, {0: {LOAD}})
    assert massless._carries(row("hinge", [(0, 0, 1)]), cross, {0: {LOCK}})


def test_dependent_motions_in_a_row_need_an_armature() -> None:
    bodies = Groups(mujoco, model(f'<body name="b"><joint/>{LUMP.format(1)}</body>'))
    twice = row("hinge slide hinge", [(0, 0, 1), (1, 0, 0), (0, 0, 1)])
    with pytest.raises(SceneError, match="body 'b': joints hinge, slide, hinge in a row have dependent"):
        massless._check(twice, bodies, {}, 1.0)
    with pytest.raises(SceneError, match="body 'b': joints hinge, hinge in a row have dependent"):
        massless._check(twice, bodies, {1: {ARMATURE}}, 1.0)
    massless._check(twice, bodies, {2: {ARMATURE}}, 1.0)
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    apart = Chain((Piece(0), Piece(1)), (0, 1), ("hinge", "hinge"), places, np.array([[0.0, 0.0, 1.0]] * 2))
    massless._check(apart, bodies, {}, 1.0)  # parallel hinges at two places move independently
    massless._check(twice, bodies, {k: {ARMATURE} for k in range(3)}, 1.0)


def test_rows_of_joints_are_read_as_joints_and_links() -> None:
    """A slide with a rotor moves a link; a sleeve without one is a joint; a free body has none."""
    text = f"""<body name="a"><joint name="s" type="slide" axis="0 0 1" armature="1"/>
    <joint name="h" axis="0 0 1"/>{LUMP.format(1)}</body>
    <body name="b" pos="2 0 0"><joint name="t" type="slide" axis="0 0 1"/>
    <joint name="i" axis="0 0 1"/>{LUMP.format(1)}</body><body name="c"><freejoint/>{LUMP.format(1)}</body>"""
    found = model(text)
    bodies, data = Groups(mujoco, found), placed(found)
    read = massless.read(mujoco, bodies, data, {0: {ARMATURE}}, 1.0)
    assert [(chain.joints, [joint.type for joint in joints]) for chain, joints in read] == [
        ((0,), ["translational"]),
        ((1,), ["revolute"]),
        ((2, 3), ["cylindrical"]),
        ((4,), []),
    ]
    assert [joint.bodies for _, joints in read for joint in joints] == [
        ("ground", "a link s"),
        ("a link s", "a"),
        ("ground", "b"),
    ]
    assert bodies.pieces == [Piece(1, 0), Piece(1), Piece(2), Piece(3)]
    thin = model(
        f'<body name="a"><joint axis="0 0 1"/>{LUMP.format(1)}<body name="b"><joint axis="0 1 0"/>'
        f'<joint axis="1 0 0"/>{LUMP.format(1)}</body></body>'
    )
    thin.body_mass[1] = 0.0
    bodies = Groups(mujoco, thin)
    read = massless.read(mujoco, bodies, placed(thin), {0: {LOAD}}, 1.0)
    assert [chain.ends for chain, _ in read] == [
        (Piece(0), Piece(1)),
        (Piece(1), Piece(2, 1)),
        (Piece(2, 1), Piece(2)),
    ]
    assert [[joint.name for joint in joints] for _, joints in read] == [
        ["a joint"],
        ["b link 1 joint"],
        ["b joint"],
    ]
    assert bodies.pieces == [Piece(1), Piece(2, 1), Piece(2)]
    twice = model(f'<body name="a"><joint axis="0 0 1"/><joint axis="0 0 1"/>{LUMP.format(1)}</body>')
    with pytest.raises(SceneError, match="body 'a': joints hinge, hinge in a row have dependent motions"):
        massless.read(mujoco, Groups(mujoco, twice), placed(twice), {}, 1.0)


def test_a_closure_is_a_joint_at_its_second_frame_along_the_axis_of_the_first(arm: Any) -> None:
    data, bodies = placed(arm), Groups(mujoco, arm)
    turned = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    ends = Frame(1, np.array([1.0, 2.0, 3.0]), turned), Frame(3, np.array([0.0, 0.5, 0.0]), np.eye(3))
    made = Closure("c", Revolute, ends).joint(data, bodies)
    assert (made.name, made.type, made.bodies) == ("c", "revolute", ("arm", "wrist"))
    assert made.anchor == pytest.approx(data.xpos[3] + [0.0, 0.5, 0.0])
    assert made.axis == pytest.approx((1.0, 0.0, 0.0))
    with pytest.raises(SceneError) as caught:
        Closure("c", Revolute, (ends[0], Frame(2, np.zeros(3), np.eye(3)))).joint(data, bodies)
    assert list(caught.value.faults) == ["closure 'c': both sides are on 'arm', or fixed to it"]


# --- Bodies that are held ---------------------------------------------------------------------------------
ROBOT = f"""<mujoco><worldbody><body name="base" pos="1 2 3"><freejoint/>{LUMP.format(1)}
<body name="arm" pos="0 0 1"><joint name="j"/>{LUMP.format(1)}</body></body>
<body name="other"><joint name="o"/>{LUMP.format(1)}</body><body name="fixed">{LUMP.format(1)}</body>
<body name="m0" mocap="true"/><body name="m1" mocap="true" pos="5 5 5"/></worldbody>
<keyframe><key name="k" qpos="4 5 6 0 1 0 0 0.5 0.25" mpos="1 1 1 2 3 4" mquat="1 0 0 0 0 0 1 0"/></keyframe>
</mujoco>"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    (tmp_path / "robot.xml").write_text(ROBOT)
    return tmp_path / "robot.xml"


def test_a_held_base_stays_where_the_reference_or_a_keyframe_has_it(robot: Path) -> None:
    held, notes = holding.compiled(mujoco, robot, ["base"], "")
    assert notes == [] and held.njnt == 2 and held.body("base").pos.tolist() == [1.0, 2.0, 3.0]
    held, _ = holding.compiled(mujoco, robot, ["base"], "k")
    assert held.body("base").pos.tolist() == [4.0, 5.0, 6.0]
    assert held.body("base").quat.tolist() == [0.0, 1.0, 0.0, 0.0]
    both, _ = holding.compiled(mujoco, robot, ["base", "other"], "")
    assert both.njnt == 1 and both.joint(0).name == "j"
    free, _ = holding.compiled(mujoco, robot, [], "k")
    assert free.njnt == 3


def test_motion_capture_bodies_stand_where_the_keyframe_has_them(robot: Path) -> None:
    there, _ = holding.compiled(mujoco, robot, [], "k")
    assert there.body("m0").pos.tolist() == [1.0, 1.0, 1.0]
    assert there.body("m1").pos.tolist() == [2.0, 3.0, 4.0] and there.body("m1").quat.tolist() == [0, 0, 1, 0]
    here, _ = holding.compiled(mujoco, robot, [], "")
    assert here.body("m1").pos.tolist() == [5.0, 5.0, 5.0]


@pytest.mark.parametrize("name", ["arm", "fixed", "nobody"])
def test_only_bodies_with_joints_to_the_ground_can_be_held(robot: Path, name: str) -> None:
    with pytest.raises(SceneError, match=f"--hold {name}: is not a body .*; known: base, other$"):
        holding.compiled(mujoco, robot, [name], "")


@pytest.mark.parametrize("hold", [[], ["base"]])
def test_meshes_that_are_missing_are_left_out_with_a_note(tmp_path: Path, hold: list[str]) -> None:
    mesh = '<asset><mesh name="m" file="none.stl"/></asset>'
    text = ROBOT.replace("<mujoco>", f"<mujoco>{mesh}").replace(
        '<joint name="j"/>', '<joint name="j"/><geom type="mesh" mesh="m"/>'
    )
    (tmp_path / "shown.xml").write_text(text)
    found, notes = holding.compiled(mujoco, tmp_path / "shown.xml", hold, "")
    assert notes == ["files that are missing: none.stl; these shapes have no effect"]
    assert found.ngeom == 0 and found.njnt == 3 - len(hold)


def test_a_file_that_mujoco_cannot_read_for_another_reason_stays_unread(tmp_path: Path) -> None:
    (tmp_path / "bad.xml").write_text(ROBOT.replace('mass="1"', 'mass="-1"', 1))
    with pytest.raises(ValueError, match="mass"):
        holding.compiled(mujoco, tmp_path / "bad.xml", [], "")
