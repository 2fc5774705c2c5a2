"""Initial velocities, parts of scenes and poses along a motion / small equations worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mbref import rotations
from mbref.equations import along_trajectory, initial_state, model, parts
from mbref.equations.couplings import coordinate_primitives, couplings_of, rotors_of
from mbref.kernels.scene_layout import COUPLED_ANGLE, COUPLED_SLIDE
from mbref.scene import (
    Body,
    Coupling,
    Distance,
    Driver,
    Factor,
    Force,
    Moment,
    Revolute,
    Scene,
    Translational,
)
from mbref.scene_joints import ANGLE, DISPLACEMENT


def test_velocities_that_bodies_give_in_their_own_axes():
    """The second scene turns its body by 90° about z: its x is Y."""
    still = Body(name="a", position=(0.0, 0.0, 0.0))
    moves = still.model_copy(update={"velocity": (1.0, 2.0, 3.0)})
    turns = still.model_copy(update={"angular_velocity": (4.0, 5.0, 6.0)})
    half = math.sqrt(0.5)
    q = np.zeros((2, 14))
    q[0, [3, 10]] = 1.0
    q[1, [3, 6]] = half
    q[1, 10] = 1.0
    v, given = initial_state.given_velocities([[still, moves], [turns, moves]], q)
    assert v.tolist()[0] == [0.0] * 6 + [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]
    assert v[1] == pytest.approx([0, 0, 0, 5, -4, 6, 1, 2, 3, 0, 0, 0])
    assert given.tolist() == [
        [False] * 6 + [True] * 3 + [False] * 3,
        [False] * 3 + [True] * 6 + [False] * 3,
    ]
    assert v.shape == given.shape == (2, 12)


def test_violations_that_are_rounding():
    """1e-14 m, times the length of a scene that is longer than 1 m."""
    assert initial_state.is_met(1e-14, 0.5) and not initial_state.is_met(1.01e-14, 0.5)
    found = initial_state.is_met(np.array([2.9e-14, 3.1e-14, 1e-14]), np.array([3.0, 3.0, 0.1]))
    assert found.tolist() == [True, False, True]


# --- parts of scenes --------------------------------------------------------------------------------------
Z = (0.0, 0.0, 1.0)


def body(name: str, **more: Any) -> Body:
    return Body(
        **{"name": name, "mass": 1.0, "inertia": (1.0, 1.0, 1.0), "position": (0.0, 0.0, 0.0), **more}
    )


def hinge(name: str, *bodies: str, **more: Any) -> Revolute:
    return Revolute(**{"name": name, "bodies": bodies, "anchor": (0.0, 0.0, 0.0), "axis": Z, **more})


def slide(name: str, *bodies: str, **more: Any) -> Translational:
    return Translational(**{"name": name, "bodies": bodies, "anchor": (0.0, 0.0, 0.0), "axis": Z, **more})


BASE: dict[str, Any] = {
    "name": "s",
    "body": (body("a"), body("b", position=(0.0, 3.0, 0.0))),
    "joint": (hinge("A", "ground", "a"), slide("B", "a", "b")),
    "coupling": (Coupling(name="C", joints=("A", "B"), ratio=2.0),),
    "driver": (Driver(joint="A", polynomial=(0.0, 1.0)),),
    "load": (Force(body="b", point=(0.0, 0.0, 0.0), force=(1.0, 0.0, 0.0)),),
}


@pytest.mark.parametrize(
    ("changes", "is_equal"),
    [
        ({"gravity": (0.0, 0.0, -1.0)}, True),
        ({"body": (body("a", mass=2.0), body("b"))}, True),
        ({"load": (Force(body="b", point=(1.0, 0.0, 0.0), force=(2.0, 0.0, 0.0)),)}, True),
        ({"driver": (Driver(joint="A", polynomial=(0.0, 2.0)),)}, True),
        ({"ground": "body"}, False),
        (
            {"body": (body("a", inertia=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))), body("b"))},
            False,
        ),
        ({"joint": (hinge("A", "ground", "a", armature=0.5), slide("B", "a", "b"))}, False),
        ({"joint": (hinge("A", "a", "ground"), slide("B", "a", "b"))}, False),
        ({"coupling": ()}, False),
        ({"driver": (Driver(joint="A", polynomial=(0.0, 1.0, 2.0)),)}, False),
        ({"driver": (Driver(joint="B", polynomial=(0.0, 1.0)),)}, False),
        ({"load": (Moment(body="b", moment=(1.0, 0.0, 0.0)),)}, False),
        ({"load": (Force(body="a", point=(0.0, 0.0, 0.0), force=(1.0, 0.0, 0.0)),)}, False),
        ({"load": (BASE["load"][0].model_copy(update={"factor": Factor(start=1.0)}),)}, False),
    ],
)
def test_scenes_that_differ_in_numbers_alone_are_of_one_shape(changes, is_equal):
    one, other = Scene(**BASE), Scene(**{**BASE, **changes})
    assert (parts.shape_of(one) == parts.shape_of(other)) is is_equal


def test_tensors_and_moments_of_inertia_are_two_shapes():
    without = Scene(name="s", body=(Body(name="a", position=(0.0, 0.0, 0.0)),))
    assert parts.shape_of(without) != parts.shape_of(Scene(name="s", body=(body("b"),)))


def test_a_modelled_ground_is_a_body_on_a_weld():
    scene = Scene(**{**BASE, "ground": "body"})
    found = parts.all_parts(scene)
    assert [each.name for each in found.bodies] == ["a", "b", "ground"]
    ground, weld = found.bodies[-1], found.joints[-1]
    assert (ground.mass, ground.inertia, ground.position) == (1.0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    assert (weld.type, weld.bodies, weld.anchor_pair) == ("fixed", (parts.FRAME, "ground"), ((0.0,) * 3,) * 2)
    bare = tuple(Body(name=each.name, position=each.position) for each in BASE["body"])
    ground = parts.all_parts(Scene(**{**BASE, "ground": "body", "body": bare, "load": ()})).bodies[-1]
    assert ground.mass is None and ground.inertia is None
    framed = parts.all_parts(Scene(**BASE))
    assert (
        framed.bodies == Scene(**BASE).body
        and framed.joints == Scene(**BASE).joint
        and framed.couplings == ()
    )


def test_rotors_of_armatures():
    """An inertia of 8 kg m² in a scene of 2 m weighs 2 kg; a mass of 8 kg on a slide has 32 kg m²."""
    joints = (
        hinge("A", "ground", "a", armature=8.0),
        slide("B", "a", "b", armature=8.0),
        hinge("D", "b", "ground"),
    )
    scene = Scene(name="s", body=BASE["body"], joint=joints)
    found = rotors_of(scene, "frame", 2.0)
    assert [each.name for each in found.bodies] == ["armature of A", "armature of B"]
    assert [(each.mass, each.inertia) for each in found.bodies] == [(2.0, (8.0,) * 3), (8.0, (32.0,) * 3)]
    assert [(each.type, each.bodies) for each in found.joints] == [
        ("revolute", ("frame", "armature of A")),
        ("translational", ("frame", "armature of B")),
    ]
    of_hinge, of_slide = found.couplings
    assert of_hinge.factors == of_slide.factors == (-1.0, 1.0)
    assert of_hinge.joints == (joints[0], found.joints[0]) and of_hinge.coordinates == (ANGLE, ANGLE)
    assert of_slide.coordinates == (DISPLACEMENT, DISPLACEMENT) and of_slide.name == "armature of B"
    bare = tuple(Body(name=each.name, position=each.position) for each in BASE["body"])
    assert rotors_of(scene.with_(body=bare), "frame", 2.0).bodies == ()
    assert rotors_of(Scene(**BASE), "frame", 2.0) == ((), (), ())


@pytest.mark.parametrize(("ratio", "factors"), [(2.0, (-1.0, 0.5)), (-0.25, (0.25, 1.0)), (1.0, (-1.0, 1.0))])
def test_factors_of_a_coupling(ratio, factors):
    scene = Scene(**{**BASE, "coupling": (Coupling(name="C", joints=("A", "B"), ratio=ratio),)})
    [found] = couplings_of(scene)
    assert found.factors == factors and found.name == "C" and [j.name for j in found.joints] == ["A", "B"]
    assert found.coordinates == (ANGLE, DISPLACEMENT)
    first, second = coordinate_primitives(found)
    assert (first.kind, first.length, second.kind, second.length) == (
        COUPLED_ANGLE,
        factors[0],
        COUPLED_SLIDE,
        factors[1],
    )


# --- poses and motions ------------------------------------------------------------------------------------
TURN = rotations.from_vector(np.array([0.3, -0.8, 0.5]))
PRINCIPAL = rotations.from_vector(np.array([-0.2, 0.4, 0.9]))


def test_motions_of_bodies_in_world_axes():
    """Two of three bodies; the principal frame of the first is turned."""
    q = np.zeros((1, 3, 7))
    q[0, :, :3] = np.arange(9.0).reshape(3, 3)
    q[0, :, 3] = 1.0
    q[0, 0, 3:] = rotations.multiply(TURN, PRINCIPAL)
    v, a = np.arange(18.0).reshape(1, 3, 6), -np.arange(18.0).reshape(1, 3, 6)
    principal = np.array([PRINCIPAL, [1.0, 0, 0, 0], [1.0, 0, 0, 0]])
    found = model.motion_of(q, v, a, principal, 2)
    turned = rotations.to_matrix(q[0, 0, 3:])
    assert found["position"].tolist() == [[[0.0, 1, 2], [3, 4, 5]]]
    assert found["velocity"].tolist() == [[[0.0, 1, 2], [6, 7, 8]]]
    assert found["acceleration"].tolist() == [[[0.0, -1, -2], [-6, -7, -8]]]
    assert found["orientation"][0] == pytest.approx(np.array([TURN, [1.0, 0, 0, 0]]))
    assert found["angular_velocity"][0] == pytest.approx(np.array([turned @ [3.0, 4, 5], [9.0, 10, 11]]))
    assert found["angular_acceleration"][0] == pytest.approx(-found["angular_velocity"][0])
    own = model.motion_of(q, v, a, None, 3)["orientation"]
    assert own.tolist() == q[..., 3:].tolist()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_small_displacements_of_coordinates(sign):
    """The displacement from q to q ⊕ x is x to first order, also where p changes its sign."""
    q = np.concatenate([[1.0, 2.0, 3.0], TURN, [4.0, 5.0, 6.0], PRINCIPAL])
    x = 1e-5 * np.arange(1.0, 13.0)
    moved = model.displaced(q, x)
    two = model.all_displaced(q, np.stack([x, 2 * x]))
    assert two[0].tolist() == moved.tolist() and two.shape == (2, 14)
    moved[3:7] *= sign
    assert model.displacement(q, moved) == pytest.approx(x, rel=1e-6)


def test_scenes_without_armatures():
    joints = (hinge("A", "ground", "a", armature=8.0), slide("B", "a", "b"))
    found = along_trajectory.without_armatures(Scene(name="s", body=BASE["body"], joint=joints))
    assert [joint.reflected_inertia for joint in found.joint] == [0.0, 0.0] and found.joint[1] == joints[1]


def test_anchors_on_second_bodies():
    """An anchor moves with the second body; on the ground it stays."""
    scene = Scene(
        name="s",
        body=BASE["body"],
        joint=(
            Distance(name="A", bodies=("a", "b"), anchors=((9.0, 9.0, 9.0), (0.0, 4.0, 2.0))),
            hinge("B", "a", "ground", anchor=(7.0, 8.0, 9.0)),
        ),
    )
    of = model.Model(scene)
    q = np.zeros((2, 2, 7))
    q[..., 3] = 1.0
    q[:, 1, :3] = [[0.0, 3.0, 0.0], [10.0, 20.0, 30.0]]
    q[1, 1, 3:] = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
    found = of.anchors(q)
    assert found[:, 1].tolist() == [[7.0, 8.0, 9.0]] * 2
    assert found[0, 0] == pytest.approx([0.0, 4.0, 2.0]) and found[1, 0] == pytest.approx([9.0, 20.0, 32.0])


def test_numbers_of_a_scene_in_memory_of_evaluations():
    first, second = (
        model.Model(Scene(name="s", gravity=(0.0, 0.0, g), body=(body("a", mass=m),)))
        for g, m in ((-1.0, 2.0), (-3.0, 4.0))
    )
    memory = first.equations()
    assert memory.frames.rotation.tolist() == [[1, 0, 0, 0, 1, 0, 0, 0, 1]] * 2
    assert (
        memory.scene.gravity.tolist() == [0.0, 0.0, -1.0] and memory.scene.gravity is not first.data.gravity
    )
    assert memory.system.mass[:3].tolist() == [2.0] * 3
    second.put_numbers(memory, second.data)
    assert memory.scene.gravity.tolist() == [0.0, 0.0, -3.0] and memory.scene.bodies.mass.tolist() == [4.0]
    assert memory.system.mass[:3].tolist() == [4.0] * 3
    assert memory.system.inverse_root[:3].tolist() == [0.5] * 3
    assert first.data.gravity.tolist() == [0.0, 0.0, -1.0]
    other = first.equations(data=second.data)
    assert other.scene.gravity.tolist() == [0.0, 0.0, -3.0] and other.system.mass[0] == 2.0
