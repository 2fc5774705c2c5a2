"""Parts that engines in joint coordinates share / reactions, rods, plane forms and kept files by hand."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines import kept, planar_scene, terms
from crosscheck.engines.spanning_tree import (
    Link,
    _rod,
    _without_point_mass,
    effective_mass,
    spanning_tree,
)
from crosscheck.engines.tree_reactions import LinkMotion, applied, joint_reactions
from mbref import rotations
from mbref.scene import (
    Body,
    Coupling,
    Cylindrical,
    Driver,
    Factor,
    Fixed,
    Force,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
    Universal,
)

X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


def body(name: str, *place: float, **parts: Any) -> Body:
    return Body(name=name, **{"mass": 2.0, "inertia": (0.3, 0.4, 0.5), "position": place, **parts})


def hinge(
    name: str, first: str, second: str, *anchor: float, axis: tuple[float, ...] = Z, **more
) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=anchor, axis=axis, **more)


# --- reactions --------------------------------------------------------------------------------------------
TURNED = tuple(rotations.from_vector(np.array([0.3, -0.2, 0.5])).tolist())
ARM = body("a", 0.5, 0.1, -0.2, mass=3.0, inertia=(0.2, 0.5, 0.6), orientation=TURNED)
HAND = body("b", 1.4, -0.3, 0.2, mass=1.5, inertia=((0.3, 0.02, 0.0), (0.02, 0.2, 0.01), (0.0, 0.01, 0.25)))
PINS = (
    hinge("A", "ground", "a", 0.1, 0.0, 0.05, axis=(0.0, 0.6, 0.8)),
    hinge("B", "b", "a", 0.9, -0.1, 0.3, axis=(2.0, 0.0, 0.0)),
)
LOADS = (
    Force(body="b", point=(1.5, -0.2, 0.1), force=(4.0, -5.0, 6.0), factor=Factor(polynomial=(0.5, 3.0))),
    Moment(body="a", moment=(0.7, 0.8, -0.9)),
    Spring(
        bodies=("a", "b"),
        points=((0.2, 0.3, 0.1), (1.3, 0.4, -0.6)),
        stiffness=20.0,
        damping=3.0,
        natural_length=0.4,
    ),
    Spring(
        bodies=("ground", "a"), points=((2.0, 1.0, 0.0), (0.6, 0.2, 0.0)), stiffness=7.0, natural_length=0.1
    ),
    TorsionSpring(joint="B", stiffness=5.0, damping=2.0, natural_angle=0.25),
    JointTorque(joint="A", torque=1.75),
)
ROBOT = Scene(name="robot", body=(ARM, HAND), joint=PINS, load=LOADS, gravity=(0.3, -9.0, 1.0))
TIME = 0.5  # s; the factor of the force is 0.5 + 3 · 0.5 = 2


def moving() -> LinkMotion:
    """Some motion of both bodies, in the order of the links."""
    turns = np.array([[0.4, -0.3, 0.8], [-0.7, 0.2, 0.1]])
    return LinkMotion(
        rotation=rotations.to_matrix(rotations.from_vector(turns)),
        position=np.array([[0.45, 0.2, -0.1], [1.2, 0.3, 0.5]]),
        velocity=np.array([[1.0, -2.0, 0.5], [0.3, 0.7, -1.1]]),
        angular_velocity=np.array([[0.9, 1.3, -0.4], [-1.2, 0.6, 2.0]]),
        acceleration=np.array([[3.0, 1.0, -2.0], [-1.5, 2.5, 4.0]]),
        angular_acceleration=np.array([[2.0, -3.0, 1.0], [0.5, 1.5, -2.5]]),
        coordinates=np.array([0.6, -0.35]),
        rates=np.array([1.4, -2.2]),
        time=TIME,
    )


def place(k: int, point: Any) -> np.ndarray:
    """A body-fixed point, given at t = 0, in the motion."""
    motion, start = moving(), np.array(ROBOT.body[k].position)
    return motion.position[k] + motion.rotation[k] @ (np.array(point) - start)


def pace(k: int, point: Any) -> np.ndarray:
    motion = moving()
    return motion.velocity[k] + np.cross(motion.angular_velocity[k], place(k, point) - motion.position[k])


def acting(k: int) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment about the centre of mass of all loads on a body, without gravity."""
    motion, centre = moving(), moving().position[k]
    force, moment = np.zeros(3), np.zeros(3)

    def pull(f: np.ndarray, at: np.ndarray) -> None:
        nonlocal force, moment
        force, moment = force + f, moment + np.cross(at - centre, f)

    ends = place(0, LOADS[2].points[0]), place(1, LOADS[2].points[1])
    length = np.linalg.norm(ends[1] - ends[0])
    along = (ends[1] - ends[0]) / length
    stretching = (pace(1, LOADS[2].points[1]) - pace(0, LOADS[2].points[0])) @ along
    tension = (20.0 * (length - 0.4) + 3.0 * stretching) * along
    pull(tension if k == 0 else -tension, ends[k])
    # the tree goes from a to b, so that angle B is the angle of a against b about -x of b
    spring = -5.0 * (-0.35 - 0.25) - 2.0 * -2.2
    twist = spring * (motion.rotation[1] @ [-1.0, 0.0, 0.0])
    if k == 1:
        pull(2.0 * np.array([4.0, -5.0, 6.0]), place(1, (1.5, -0.2, 0.1)))
        return force, moment + twist
    anchor = np.array([2.0, 1.0, 0.0])
    apart = place(0, (0.6, 0.2, 0.0)) - anchor
    pull(-7.0 * (np.linalg.norm(apart) - 0.1) * apart / np.linalg.norm(apart), place(0, (0.6, 0.2, 0.0)))
    turning = 1.75 * (motion.rotation[0] @ [0.0, 0.6, 0.8])
    return force, moment - twist + turning + [0.7, 0.8, -0.9]


def inertial(k: int) -> tuple[np.ndarray, np.ndarray]:
    """Mass times acceleration, and the rate of the angular momentum about the centre of mass."""
    motion, given = moving(), ROBOT.body[k]
    moments = np.array(given.inertia, dtype=float)
    moments = np.diag(moments) if moments.ndim == 1 else moments
    axes = motion.rotation[k] @ rotations.to_matrix(np.array(given.orientation))
    inertia, omega = axes @ moments @ axes.T, motion.angular_velocity[k]
    rate = inertia @ motion.angular_acceleration[k] + np.cross(omega, inertia @ omega)
    return given.mass * (motion.acceleration[k] - np.array(ROBOT.gravity)), rate


def test_reactions_balance_each_body():
    """The Newton-Euler equations of b give the reaction at B; the equations of a give the one at A."""
    tree = spanning_tree(ROBOT)
    assert [link.body for link in tree.links] == [0, 1] and not tree.closures
    found = joint_reactions(ROBOT, tree, moving(), ())
    centres = moving().position
    (force_b, moment_b), (needed_b, rate_b) = acting(1), inertial(1)
    on_b = needed_b - force_b
    pin = place(1, PINS[1].anchor)
    turn_b = rate_b - moment_b - np.cross(pin - centres[1], on_b)
    at_a = place(0, PINS[1].anchor)  # the anchor on the second body, a; the bodies' points are apart here
    moved = -turn_b + np.cross(pin - at_a, -on_b)
    assert found["B"] == pytest.approx(np.concatenate([-on_b, moved]), abs=1e-12), "on its second body"
    (force_a, moment_a), (needed_a, rate_a) = acting(0), inertial(0)
    on_a = needed_a - force_a + on_b
    foot = place(0, PINS[0].anchor)
    turn_a = rate_a - moment_a + turn_b + np.cross(pin - centres[0], on_b) - np.cross(foot - centres[0], on_a)
    assert found["A"] == pytest.approx(np.concatenate([on_a, turn_a]), abs=1e-12)


def test_loads_on_links_about_their_origins():
    """The links' origins are the centres of mass; the ground's ends are left out."""
    tree, totals = spanning_tree(ROBOT), np.zeros((2, 6))
    for link, force, moment in applied(ROBOT, tree, moving()):
        totals[link] += np.concatenate([force, moment])
    for k in range(2):
        assert totals[k] == pytest.approx(np.concatenate(acting(k)), abs=1e-12)
    light = ROBOT.with_(body=tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in ROBOT.body))
    assert applied(light, tree, moving()) == []


# --- rods -------------------------------------------------------------------------------------------------
def test_the_mass_that_a_point_of_a_body_feels():
    """2 kg with 0.1 and 0.05 kg m²: along x at 0.5 m, 1 / (1/2 + 0.25/0.05); along z 1 / (1/2 + 0.25/0.1)."""
    link = Link(0, np.array([1.0, 2.0, 3.0]), 2.0, np.zeros(3), np.diag([0.1, 0.7, 0.05]))
    assert effective_mass(link, np.array([1.0, 2.5, 3.0])) == pytest.approx(1 / 5.5)
    assert effective_mass(link, np.array([1.0, 2.0, 3.0])) == pytest.approx(2.0)
    shifted = Link(0, np.array([1.0, 1.8, 3.0]), 2.0, np.array([0.0, 0.2, 0.0]), link.inertia)
    assert effective_mass(shifted, np.array([1.0, 2.5, 3.0])) == pytest.approx(1 / 5.5)


def around(mass: float, arm: np.ndarray) -> np.ndarray:
    """The moments of inertia (3, 3) of a point mass at a distance."""
    return mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))


def test_a_point_mass_taken_out_of_a_body_and_put_back():
    inertia = np.array([[0.5, 0.02, 0.01], [0.02, 0.6, 0.03], [0.01, 0.03, 0.7]])
    place_, point = np.array([1.0, 2.0, 3.0]), np.array([1.4, 1.7, 3.2])
    whole = Link(0, place_, 3.0, np.array([0.05, -0.1, 0.02]), inertia)
    rest = _without_point_mass(whole, point, 0.5)
    centre = whole.position + whole.offset
    assert rest.mass == 2.5 and rest.position is place_
    assert (2.5 * (rest.position + rest.offset) + 0.5 * point) / 3.0 == pytest.approx(centre)
    together = rest.inertia + around(2.5, rest.position + rest.offset - centre) + around(0.5, point - centre)
    assert together == pytest.approx(inertia)


def test_the_rod_of_a_distance_joint():
    """A tenth of the lesser effective mass at each end: two point masses, 3 and 3.5 m apart."""
    nodes = [
        Link(0, np.zeros(3), 2.0, np.zeros(3), np.diag([0.1, 0.7, 0.05])),
        Link(1, np.array([3.0, 4.0, 0.0]), 8.0, np.zeros(3), np.eye(3)),
    ]
    anchors = np.array([[0.0, 0.5, 0.0], [3.0, 4.0, 0.0]])
    first, second = _rod(nodes, 7, (0, 1), anchors)
    mass = 0.1 / 5.5
    rod = nodes[2]
    assert rod.mass == pytest.approx(2 * mass) and rod.position.tolist() == [1.5, 2.25, 0.0]
    assert rod.inertia == pytest.approx(np.eye(3) * mass * (9 + 12.25) / 2)
    assert (first.nodes, second.nodes) == ((0, 2), (2, 1)) and (first.joint, second.joint) == (-1, 7)
    assert first.anchor.tolist() == anchors[0].tolist() and second.anchor.tolist() == anchors[1].tolist()
    assert [nodes[k].mass for k in (0, 1)] == pytest.approx([2.0 - mass, 8.0 - mass])
    assert [(b, a.tolist()) for b, a in rod.ends] == [(0, anchors[0].tolist()), (1, anchors[1].tolist())]
    alone = [nodes[1]]
    _rod(alone, 3, (-1, 0), anchors)
    assert alone[1].mass == pytest.approx(0.2 * (8.0 - mass)), "the ground has no end mass"


# --- plane forms ------------------------------------------------------------------------------------------
ENDS = ("a", "b")


@pytest.mark.parametrize(
    ("joint", "kind"),
    [
        (hinge("J", *ENDS, *X, axis=(0.0, 0.0, -2.0)), "revolute"),
        (hinge("J", *ENDS, *X, axis=(1e-13, 0.0, 1.0)), "revolute"),
        (hinge("J", *ENDS, *X, axis=(1e-11, 0.0, 1.0)), None),
        (hinge("J", *ENDS, *X, axis=X), None),
        (Translational(name="J", bodies=ENDS, anchor=X, axis=(1.0, 2.0, 0.0)), "translational"),
        (Translational(name="J", bodies=ENDS, anchor=X, axis=(1.0, 0.0, 1e-11)), None),
        (Translational(name="J", bodies=ENDS, anchor=X, axis=Z), None),
        (Fixed.at("J", ENDS, anchor=X), "fixed"),
        (Spherical(name="J", bodies=ENDS, anchor=X), "hinge"),
        (Universal(name="J", bodies=ENDS, anchor=X, axes=(X, Z)), "hinge"),
        (Universal(name="J", bodies=ENDS, anchor=X, axes=(Z, Y)), "hinge"),
        (Universal(name="J", bodies=ENDS, anchor=X, axes=(X, Y)), None),
        (Cylindrical(name="J", bodies=ENDS, anchor=X, axis=Z), None),
    ],
)
def test_joints_in_the_plane_whose_normal_is_z(joint, kind):
    found = planar_scene._hinged(joint, np.array(Z))
    if kind == "hinge":
        assert isinstance(found, Revolute) and (found.name, found.bodies) == ("J", ENDS)
        assert found.anchor == X and found.axis == Z
    else:
        assert found is (None if kind is None else joint)


@pytest.mark.parametrize(("off", "is_parallel"), [(0.25, False), (0.2499, True)])
def test_the_limits_of_axes_in_the_plane(off, is_parallel, monkeypatch):
    """A quarter, as a sine of the angle or as a part along the normal."""
    monkeypatch.setattr(planar_scene, "PARALLEL", 0.25)
    monkeypatch.setattr(planar_scene, "unit", lambda axis: axis)
    for joint in (
        hinge("J", *ENDS, *X, axis=(off, 0.0, 1.0)),
        Translational(name="J", bodies=ENDS, anchor=X, axis=(1.0, 0.0, off)),
        Translational(name="J", bodies=ENDS, anchor=X, axis=(1.0, 0.0, -off)),
    ):
        assert (planar_scene._hinged(joint, np.array(Z)) is joint) is is_parallel


@pytest.mark.parametrize(
    ("velocity", "spin"), [((0.0, 0.0, 1.0), (0.0, 0.0, 4.0)), ((4.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
)
def test_the_limit_of_velocities_within_the_plane(velocity, spin, monkeypatch):
    """A quarter of the largest velocity, 4 m/s or rad/s."""
    free = Scene(name="s", body=(body("a", *O, velocity=velocity, angular_velocity=spin),))
    for limit, is_within in ((0.25, True), (0.2499, False)):
        monkeypatch.setattr(planar_scene, "AT_REST", limit)
        assert planar_scene._starts_within(free, np.array(Z)) is is_within


@pytest.mark.parametrize(
    ("velocity", "spin", "is_within"),
    [
        ((3.0, 4.0, 0.0), (0.0, 0.0, 2.0), True),
        ((3.0, 4.0, 3e-12), (0.0, 0.0, 2.0), True),
        ((3.0, 4.0, 5e-12), (0.0, 0.0, 2.0), False),
        ((0.0, 0.0, 0.0), (1.9e-12, 0.0, 2.0), True),
        ((0.0, 0.0, 0.0), (0.0, 2.1e-12, 2.0), False),
    ],
)
def test_velocities_within_the_plane(velocity, spin, is_within):
    """Velocities of 4 m/s or 2 rad/s may have a component of 1e-12 of their size off the plane."""
    free = Scene(name="s", body=(body("a", *O, velocity=velocity, angular_velocity=spin),))
    assert planar_scene._starts_within(free, np.array(Z)) is is_within


def four_bar(**parts: Any) -> Scene:
    bodies = (body("a", 0.0, 0.5, 0.0), body("b", 1.0, 1.0, 0.0), body("c", 2.0, 0.5, 0.0))
    joints = (
        hinge("A", "ground", "a", *O),
        hinge("B", "a", "b", *Y),
        hinge("C", "b", "c", 2.0, 1.0, 0.0),
        hinge("D", "ground", "c", 2.0, 0.0, 0.0),
    )
    return Scene(name="s", **{"body": bodies, "joint": joints, **parts})


def test_a_cut_hinge_becomes_a_point_unless_something_acts_on_it():
    def kinds(scene: Scene) -> str:
        closed = planar_scene._closed_by_points(scene)
        assert [joint.name for joint in closed.joint] == list("ABCD")
        assert [joint.anchor_pair[0] for joint in closed.joint] == [j.anchor for j in scene.joint]
        return "".join(joint.type[0] for joint in closed.joint)

    scene = four_bar()
    cut = [scene.joint[closure.joint].name for closure in spanning_tree(scene).closures]
    assert cut == ["D"] and kinds(scene) == "rrrs"
    assert kinds(scene.with_(load=(TorsionSpring(joint="D", stiffness=1.0),))) == "rrrr"
    assert kinds(scene.with_(load=(Moment(body="c", moment=Z),))) == "rrrs"
    turning = scene.joint[3].model_copy(update={"armature": 0.1})
    assert kinds(scene.with_(joint=(*scene.joint[:3], turning))) == "rrrr"
    assert kinds(scene.with_(driver=(Driver(joint="D", polynomial=(0.0, 1.0)),))) == "rrsr"
    gears = Coupling(name="G", joints=("C", "D"), ratio=2.0)
    assert kinds(scene.with_(coupling=(gears,))) == "rsrr"
    assert planar_scene._freedoms(scene) == 1
    assert planar_scene._freedoms(scene.with_(driver=(Driver(joint="D", polynomial=(0.0, 1.0)),))) == 1
    assert planar_scene._freedoms(scene.with_(joint=scene.joint[:3])) == 3


# --- terms ------------------------------------------------------------------------------------------------
def test_rounding_of_rows_that_the_tree_satisfies():
    """Entries below 1e-13 of the largest entry of both ends, 4, are rounding."""
    first, second = np.array([[1.0, 2.0, -4.0]]), np.array([[1.0 + 3e-13, 2.0 - 6e-13, -3.0]])
    assert terms._unrounded(first, second)[0] == pytest.approx([0.0, -6e-13, 1.0], abs=1e-15)
    assert terms._unrounded(second, first)[0] == pytest.approx([0.0, 6e-13, -1.0], abs=1e-15)
    assert terms._unrounded(first / 8, second / 8)[0, 0] == 0.0


def test_settings_of_engines_that_give_terms():
    """The shortest step turns by 0.03 rad."""
    found = terms.sweep(7.0)
    assert {setting.family for setting in found} == {"terms"}
    assert [setting.options["rtol"] for setting in found] == [1e-3, 1e-5, 1e-7, 1e-9, 1e-11]
    assert {setting.options["min_step"] for setting in found} == {0.0043}


def test_rows_of_couplings_and_armatures():
    """B turns 2.5 times as fast as A, and its rotor has 0.3 kg m²."""
    pair = Coupling(name="G", joints=("A", "B"), ratio=2.5)
    chain = four_bar(coupling=(pair,))
    chain = chain.with_(joint=(chain.joint[0], chain.joint[1].model_copy(update={"armature": 0.3})))
    chain = chain.with_(body=chain.body[:2])
    made = SimpleNamespace(scene=chain, tree=spanning_tree(chain), at=SimpleNamespace(nv=2))
    assert terms.Simulation._couplings(made).tolist() == [[-2.5, 1.0]]
    assert terms.Simulation._rotors(made).tolist() == [[0.0, 0.0], [0.0, 0.3]]
    terms_ = terms.Terms(np.eye(2), *[np.zeros(2)] * 5)
    made.mechanism, made.rotors = SimpleNamespace(terms=lambda q, v: terms_), np.diag([0.0, 0.3])
    assert terms.Simulation._terms(made, None, None).mass.tolist() == [[1.0, 0.0], [0.0, 1.3]]


def projecting(gaps: list[float], has_closures: bool = True) -> tuple[Any, list[float]]:
    """A simulation of one coordinate whose residuals are given, and the corrections that it asks for."""
    moved: list[float] = []
    pending = iter(gaps)
    made = SimpleNamespace(
        tree=SimpleNamespace(closures=has_closures),
        scene=SimpleNamespace(coupling=()),
        split=lambda t, y: (y[:1], y[1:]),
        _terms=lambda q, v: None,
        _root=lambda t, terms_: None,
        _rows=lambda terms_, q, v: SimpleNamespace(
            residual=np.array([next(pending)]), jacobian=np.array([[2.0]])
        ),
        _least=lambda t, root, jacobian, wanted: moved.append(float(wanted[0])) or wanted / 2,
        at=SimpleNamespace(moved=lambda q, change: q + change),
    )
    return made, moved


def test_projection_of_a_state_onto_its_closures():
    """Newton's method ends at 1e-13; after ten corrections a residual below 1e-8 is accepted."""
    made, moved = projecting([0.5, -1e-3, 1e-13])
    found = terms.Simulation.settled(made, 0.0, np.array([3.0, 7.0]))
    assert moved == [-0.5, 1e-3, 14.0], "the last one is the velocity along the row, which is taken out"
    assert found == pytest.approx([3.0 - 0.25 + 0.5e-3, 0.0])
    made, moved = projecting([1e-12] * 9 + [0.99e-8])
    terms.Simulation.settled(made, 0.0, np.array([3.0, 7.0]))
    assert len(moved) == 11
    made, _ = projecting([1e-12] * 9 + [1e-8])
    with pytest.raises(terms.Failed, match=r"the closures could not be met at 0\.25 s"):
        terms.Simulation.settled(made, 0.25, np.array([3.0, 7.0]))
    made, moved = projecting([], has_closures=False)
    assert terms.Simulation.settled(made, 0.0, np.array([3.0, 7.0])).tolist() == [3.0, 7.0] and not moved


# --- kept files -------------------------------------------------------------------------------------------
@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "mbref" / "code"


def writes(text: str, made: list[str]) -> Any:
    def make(path: Path) -> None:
        made.append(text)
        path.write_text(text)

    return make


def test_files_are_made_once_and_again_if_damaged(cache):
    made: list[str] = []
    origin = kept.hashed("a", "b")
    assert origin == hashlib.sha256(b"a\nb").hexdigest()[:32] and len(origin) == 32
    path = kept.made_once("code", origin, ".so", writes("one", made))
    content = hashlib.sha256(b"one").hexdigest()[:32]
    assert path == cache / f"{origin}-{content}.so" and path.read_text() == "one"
    assert kept.made_once("code", origin, ".so", writes("two", made)) == path and made == ["one"]
    assert kept.kept("code", origin, ".c") is None and kept.kept("code", "other", ".so") is None
    path.write_text("damaged")
    again = kept.made_once("code", origin, ".so", writes("three", made))
    assert again.read_text() == "three" and made == ["one", "three"]
    assert sorted(p.suffix for p in cache.iterdir()) == [".so", ".so"], "no part of a file is left"


def test_the_folder_of_a_new_file_is_kept_small(cache, monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(kept, "remove_oldest", lambda *given: asked.append(given))
    kept.keep("code", "origin", ".so", writes("one", []))
    assert asked == [(cache, ".so")]


def test_files_that_cannot_be_made_leave_nothing(cache, monkeypatch):
    closed: list[int] = []
    opened = kept.tempfile.mkstemp

    def mkstemp(**given: Any) -> Any:
        handle, place = opened(**given)
        closed.append(-handle)
        return handle, place

    def close(handle: int) -> None:
        closed.append(handle)
        real_close(handle)

    def fail(path: Path) -> None:
        raise ValueError("no file")

    real_close = kept.os.close
    monkeypatch.setattr(kept.tempfile, "mkstemp", mkstemp)
    monkeypatch.setattr(kept.os, "close", close)
    with pytest.raises(ValueError, match="no file"):
        kept.keep("code", "origin", ".so", fail)
    assert list(cache.iterdir()) == [] and -closed[0] in closed[1:]


def test_files_are_kept_elsewhere_if_the_cache_cannot_be_written(cache):
    cache.parent.mkdir(parents=True)
    cache.write_text("a file in place of the folder")
    path = kept.made_once("code", "origin", ".so", writes("one", []))
    assert path.read_text() == "one" and path.parent != cache and path.name.startswith("origin-")


@pytest.mark.parametrize(
    ("most", "left"), [(18, "0123"), (17, "123"), (12, "123"), (11, "23"), (10, "23"), (9, "3"), (0, "3")]
)
def test_the_oldest_files_of_a_large_folder_are_removed(tmp_path, monkeypatch, most, left):
    """Four files of 6, 2, 4 and 6 bytes, the first one the oldest; the newest one always stays."""
    monkeypatch.setattr(kept, "MOST", most)
    for k, size in enumerate((6, 2, 4, 6)):
        path = tmp_path / f"{k}.so"
        path.write_bytes(b"x" * size)
        os.utime(path, (100.0 + k, 100.0 + k))
    (tmp_path / "large.txt").write_bytes(b"x" * 99)
    kept.remove_oldest(tmp_path, ".so")
    assert "".join(sorted(p.stem for p in tmp_path.glob("*.so"))) == left
    assert (tmp_path / "large.txt").exists()


def test_the_cache_is_in_the_home_folder_by_default(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", lambda: Path("/home/someone"))
    assert kept.cache("code") == Path("/home/someone/.cache/mbref/code") and kept.MOST == 64e6
