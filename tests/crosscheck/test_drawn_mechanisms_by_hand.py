"""Hypothesis strategies of the suite / draws: the grids of their numbers, and what each draw promises."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from crosscheck.conformance import strategies
from crosscheck.judge.constraints import initial_poses, jacobian
from mbref import rotations
from mbref.scene import GROUND, Body, Force, Moment, Revolute, Spring
from mbref.scenes import SCENES


def drawn(strategy: st.SearchStrategy[Any], count: int = 30) -> list[Any]:
    """Values of a strategy, equal in every run."""
    found: list[Any] = []

    @settings(
        max_examples=count,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def draw(value: Any) -> None:
        found.append(value)

    draw()
    return found


def block(name: str, x: float) -> Body:
    return Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=(x, 0.0, 0.0))


def spans(values: list[float] | np.ndarray, grid: float, least: float, most: float) -> bool:
    """Whether values are multiples of a grid between two ends, and spread over half of the range."""
    array = np.array(values) / grid
    low, high = np.round([min(values), max(values)], 9)
    is_spread = high - low > (most - least) / 2
    return bool(np.allclose(array, np.round(array)) and least <= low and high <= most and is_spread)


def test_grids():
    numbers = np.array(drawn(strategies.vectors)).ravel()
    assert spans(numbers, 1 / 8, -1.0, 1.0) and len(set(numbers)) > 8
    lengths = [float(np.linalg.norm(v)) for v in drawn(strategies.directions)]
    assert min(lengths) > 0.2 and max(lengths) > 1.0


@pytest.mark.parametrize(
    ("vector", "is_long"),
    [((0.2, 0.0, 0.0), False), ((0.0, 0.0, -0.21), True), ((0.125, 0.125, 0.125), True)],
)
def test_vectors_of_a_fifth_are_no_directions(vector, is_long):
    assert strategies.is_direction(vector) is is_long


def test_bodies_are_near_their_places_in_a_row():
    bodies = drawn(strategies._bodies("b", 2))
    places = np.array([body.position for body in bodies]) - [1.8, 0.0, 0.0]
    assert spans(np.round(places, 12).ravel(), 1 / 16, -0.5, 0.5), (
        "0.6 m for each body before, and half a metre"
    )
    assert spans([body.mass for body in bodies], 0.5, 0.5, 4.0)
    moments = np.array([np.linalg.eigvalsh(np.array(body.inertia)) for body in bodies])
    assert 0.02 <= np.round(moments.min(), 9) < 0.04 and 0.06 < np.round(moments.max(), 9) <= 0.08
    assert np.allclose(100 * moments, np.round(100 * moments)), "sums of two of 0.01 to 0.04 kg m²"
    assert np.all(moments[:, 0] + moments[:, 1] > moments[:, 2]), "a body of positive density"
    axes = [np.abs(np.array(body.inertia) - np.diag(np.diag(body.inertia))).max() for body in bodies]
    assert max(axes) > 1e-3, "products of inertia"
    turns = [rotations.angle_between(np.array(body.orientation), np.array([1.0, 0, 0, 0])) for body in bodies]
    assert max(turns) > 1.0 and min(turns) < 1e-12


@pytest.mark.parametrize("kind", strategies.KINDS)
def test_joints_are_near_the_middle_of_two_bodies(kind: str):
    """Bodies at x = 1 and 3 m: anchors within a quarter of a metre of x = 2 m, the further anchor of a bar
    half an axis away, axes at right angles."""
    bodies = [block("a", 1.0), block("b", 3.0)]
    joints = drawn(strategies._joints("J", ("a", "b"), bodies, [kind]), 12)
    assert {(joint.type, joint.name, joint.bodies) for joint in joints} == {(kind, "J", ("a", "b"))}
    anchors = np.array([joint.anchor_pair for joint in joints])
    assert spans((anchors[:, 0] - [2.0, 0.0, 0.0]).ravel(), 1 / 32, -0.25, 0.25)
    reach = np.linalg.norm(anchors[:, 1] - anchors[:, 0], axis=-1)
    if kind == "distance":
        assert reach.min() > 0.1 and reach.max() < 0.87
        assert spans((anchors[:, 1] - anchors[:, 0]).ravel(), 1 / 16, -0.5, 0.5)
    else:
        assert reach.max() == 0.0
    if kind == "universal":
        axes = np.array([joint.axes for joint in joints])
        assert np.abs(np.sum(axes[:, 0] * axes[:, 1], axis=-1)).max() < 1e-12


def test_joints_with_the_ground_are_near_the_middle_between_origin_and_body():
    joints = drawn(strategies._joints("J", (GROUND, "b"), [block("b", 3.0)], ["spherical"]), 12)
    places = np.array([joint.anchor_pair[0] for joint in joints]) - [1.5, 0.0, 0.0]
    assert 0.1 < np.abs(places).max() <= 0.25


def test_loads_of_the_last_body():
    loads = [load for some in drawn(strategies._loads([block("a", 1.0), block("b", 3.0)])) for load in some]
    assert {type(load) for load in loads} == {Moment, Force, Spring}
    assert {load.body for load in loads if isinstance(load, Moment | Force)} == {"b"}
    points = np.array([load.point for load in loads if isinstance(load, Force)]) - [3.0, 0.0, 0.0]
    assert spans(points.ravel(), 1 / 32, -0.25, 0.25)
    springs = [load for load in loads if isinstance(load, Spring)]
    known = {(load.bodies, load.points[0], load.stiffness, load.natural_length) for load in springs}
    assert known == {((GROUND, "b"), (0.0, 2.0, 0.0), 20.0, 0.5)}
    assert np.abs(np.array([load.points[1] for load in springs]) - [3.0, 0.0, 0.0]).max() <= 0.25


def test_second_hinge_on_the_axis_of_a_hinge():
    axis = np.array([3.0, 0.0, 4.0])
    hinge = Revolute(name="A", bodies=(GROUND, "a"), anchor=(1.0, 0.0, 0.0), axis=axis)
    pairs = drawn(strategies._two_hinges([block("a", 1.0)], [hinge]), 8)
    assert {joint.type for [joint] in pairs} == {"revolute", "cylindrical"}
    for [joint] in pairs:
        assert joint.name == "R" and joint.bodies == hinge.bodies
        assert np.allclose(joint.anchor_pair[0], [1.0 + 0.4 * 0.6, 0.0, 0.4 * 0.8])
        assert np.allclose(np.cross(joint.axis, axis), 0.0)
    ball = strategies.JOINT_TYPES["spherical"].at("B", (GROUND, "a"), anchor=(1.0, 0.0, 0.0))
    [[copy], *_] = drawn(strategies._two_hinges([block("a", 1.0)], [ball]), 3)
    assert copy.name == "R" and copy.model_copy(update={"name": "B"}) == ball, "a duplicate joint"


def test_freedoms_are_coordinates_less_independent_rows():
    hinge = Revolute(name="A", bodies=(GROUND, "a"), anchor=(1.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    again = hinge.model_copy(update={"name": "B", "anchor": (1.0, 0.0, 0.5)})
    bodies = [block("a", 1.0), block("b", 3.0)]
    assert strategies._freedoms(bodies, [hinge]) == strategies._freedoms(bodies, [hinge, again]) == 7


def test_mechanisms_are_a_tree_with_loops_and_consistent_velocities():
    found = drawn(strategies.mechanisms(), 8)
    bodies, loops = [len(scene.body) for scene in found], []
    for scene in found:
        tree, closing = scene.joint[: len(scene.body)], scene.joint[len(scene.body) :]
        assert [joint.bodies[1] for joint in tree] == [f"b{k}" for k in range(len(scene.body))]
        assert all(
            joint.bodies[0] in (GROUND, *(b.name for b in scene.body[:k])) for k, joint in enumerate(tree)
        )
        assert [joint.name for joint in tree] == [f"J{k}" for k in range(len(tree))]
        assert {joint.name for joint in closing} <= {"L0", "L1"}
        rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
        twists = np.array([[*body.velocity, *body.angular_velocity] for body in scene.body]).ravel()
        assert np.abs(rows @ twists).max(initial=0.0) < 1e-12 * max(1.0, np.abs(twists).max())
        assert scene.name == "drawn" and scene.duration == 0.05
        loops.append(len(closing))
    assert 1 <= min(bodies) < max(bodies) <= 4 and 0 < max(loops) <= 2
    gravity = np.array([scene.gravity for scene in found]).ravel()
    assert spans(gravity, 1.0, -8.0, 8.0) and any(scene.body[0].velocity != (0, 0, 0) for scene in found)
    doubled = drawn(strategies.mechanisms(most_bodies=2, most_loops=0, redundant=True), 3)
    assert all(scene.joint[-1].name == "R" for scene in doubled)
    assert all(len(scene.joint) == len(scene.body) + 1 <= 3 for scene in doubled), "no loop"


def test_a_single_body_closes_no_loop():
    alone = drawn(strategies.mechanisms(most_bodies=1, kinds=("spherical", "distance")), 6)
    assert all(len(scene.body) == len(scene.joint) == 1 for scene in alone)


def test_masses_of_paper_mechanisms():
    names = ("planar_slider_crank", "spatial_slider_crank")
    factors: dict[str, set[float]] = {"mass": set(), "inertia": set()}
    for scene in drawn(strategies.paper_mechanisms(names), 12):
        assert scene.name in names
        for body, plain in zip(scene.body, SCENES[scene.name]().body, strict=True):
            factors["mass"].add(round(body.mass / plain.mass, 9))
            [inertia] = {
                round(a / b, 9)
                for a, b in zip(np.ravel(body.inertia), np.ravel(plain.inertia), strict=True)
                if b
            }
            factors["inertia"].add(inertia)
            changed = {"mass": plain.mass, "inertia": plain.inertia}
            assert body.model_copy(update=changed) == plain
    assert factors["mass"] == factors["inertia"] == {0.25, 0.5, 1.0, 2.0, 4.0}


def shapes(strategy: Callable[..., Any], **wanted: Any) -> tuple[list[np.ndarray], set[int], set[int]]:
    found = drawn(strategy(**wanted), 12)
    return found, {m.shape[0] for m in found}, {m.shape[1] for m in found}


def test_matrices_of_a_rank_or_a_spectrum():
    found, rows, columns = shapes(strategies.matrices, rank=3)
    assert rows | columns <= {3, 4, 5, 6, 7, 8} and len(rows) > 2 < len(columns)
    values = np.array([np.linalg.svd(m, compute_uv=False)[:3] for m in found])
    assert set(np.round(np.log10(values), 9).ravel()) == {-1.0, 0.0, 1.0}
    assert all(np.linalg.matrix_rank(m, rtol=1e-9) == 3 for m in found)
    found, rows, columns = shapes(strategies.matrices, spectrum=(3.0, 1e-3), most=1)
    assert rows == columns == {2}, "as many rows as singular values, at least"
    assert all(np.linalg.svd(m, compute_uv=False) == pytest.approx([3.0, 1e-3], rel=1e-9) for m in found)
    found, rows, _ = shapes(strategies.matrices, most=2)
    assert rows == {1, 2} and {int(np.linalg.matrix_rank(m)) for m in found} == {0, 1, 2}
