"""Scenes as arrays / principal frames, numbers of loads and shared entries worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from mbref import rotations
from mbref.equations import packing
from mbref.equations.model import Model
from mbref.kernels.scene_layout import ABOUT_AXIS, ALONG_AXIS, FORCE, MOMENT, SPRING
from mbref.scene import (
    Body,
    Distance,
    Driver,
    Factor,
    Force,
    JointForce,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    SceneError,
    SlideSpring,
    Spring,
    TorsionSpring,
    Translational,
)

TURN = rotations.to_matrix(rotations.from_vector(np.array([0.3, -0.8, 0.5])))
MOMENTS = np.array([0.5, 0.7, 1.1])
TENSOR = tuple(map(tuple, (TURN @ np.diag(MOMENTS) @ TURN.T).tolist()))


def body(name: str = "a", **more: Any) -> Body:
    return Body(
        **{"name": name, "mass": 2.0, "inertia": (1.0, 2.0, 2.5), "position": (0.0, 0.0, 0.0), **more}
    )


# --- principal frames -------------------------------------------------------------------------------------
def test_quaternions_of_principal_frames():
    identity = [1.0, 0.0, 0.0, 0.0]
    assert packing._quaternions([None, None]).tolist() == [identity] * 2
    found = packing._quaternions([None, TURN])
    assert found[0] == pytest.approx(identity) and rotations.to_matrix(found[1]) == pytest.approx(TURN)
    assert rotations.to_matrix(packing._quaternions([TURN])[0]) == pytest.approx(TURN)


def test_principal_moments_and_axes():
    assert packing._principal_axes(None) == ((1.0, 1.0, 1.0), None)
    assert packing._principal_axes((1.0, 2.0, 3.0)) == ((1.0, 2.0, 3.0), None)
    moments, axes = packing._principal_axes(TENSOR)
    assert (
        axes is not None and moments == pytest.approx(MOMENTS) and np.linalg.det(axes) == pytest.approx(1.0)
    )
    assert axes @ np.diag(moments) @ axes.T == pytest.approx(np.array(TENSOR))
    flat, _ = packing._principal_axes(((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    assert min(flat) == 0.0


def test_numbers_of_bodies():
    """Position, orientation, mass and moments; 1 kg and 1 kg m² where the scene gives none."""
    bare = Body(name="a", position=(3.0, 4.0, 5.0), orientation=(0.0, 0.0, 1.0, 0.0))
    assert packing._of_body(bare) == ((3, 4, 5, 0, 0, 1, 0, 1, 1, 1, 1), None)
    assert packing._of_body(body(position=(3.0, 4.0, 5.0)))[0] == (3, 4, 5, 1, 0, 0, 0, 2, 1, 2, 2.5)


def test_bodies_with_and_without_a_tensor():
    """The second body's frame is turned to its principal axes; the fixed frame comes last."""
    p = rotations.from_vector(np.array([0.0, 0.0, 0.6]))
    bodies = (body(), body("b", inertia=TENSOR, orientation=tuple(p.tolist()), position=(1.0, 2.0, 3.0)))
    packs = packing.Packs([Scene(name="s", body=bodies)])
    assert packs.turns_frames and packs.mass.tolist()[0][:6] == [2.0, 2.0, 2.0, 1.0, 2.0, 2.5]
    assert packs.mass[0, 6:] == pytest.approx([2.0, 2.0, 2.0, *MOMENTS])
    assert packs.inverse_root[0, 6:] == pytest.approx(1 / np.sqrt([2.0, 2.0, 2.0, *MOMENTS]))
    own = rotations.to_matrix(packs.principal[0, 1])
    assert own @ np.diag(MOMENTS) @ own.T == pytest.approx(np.array(TENSOR))
    world = rotations.to_matrix(p) @ own
    assert rotations.to_matrix(packs.orientation[0, 1]) == pytest.approx(world)
    assert packs.to_local.shape == (1, 3, 3, 3) and packs.to_local[0, 1] == pytest.approx(world.T)
    assert packs.to_local[0, [0, 2]] == pytest.approx(np.stack([np.eye(3)] * 2))
    assert packs.start()[0, 7:10].tolist() == [1.0, 2.0, 3.0]
    assert packs.data.bodies.mass.tolist() == [[2.0, 2.0]]
    assert packs.data.bodies.inertia[0, 1] == pytest.approx(MOMENTS)
    index = np.array([1])
    found = packs.points(index, np.array([[2.0, 2.0, 3.0]]))[0, 0]
    assert found == pytest.approx(world.T @ [1.0, 0.0, 0.0])
    assert packs.directions(index, np.array([[0.0, 1.0, 0.0]]))[0, 0] == pytest.approx(
        world.T @ [0.0, 1.0, 0.0]
    )
    plain = packing.Packs([Scene(name="s", body=(body(),))])
    assert not plain.turns_frames and plain.principal.tolist() == [[[1.0, 0.0, 0.0, 0.0]]]


def test_a_scene_without_masses_has_units_instead_and_no_loads():
    bare = Body(name="a", position=(0.0, 0.0, 0.0))
    load = Force(body="a", point=(0.0, 0.0, 0.0), force=(1.0, 0.0, 0.0))
    packs = packing.Packs([Scene(name="s", gravity=(0.0, 0.0, -9.0), body=(bare,), load=(load,))])
    assert (
        packs.kinematic and packs.mass.tolist() == [[1.0] * 6] and packs.data.gravity.tolist() == [[0.0] * 3]
    )
    assert packs.data.loads.kind.shape == (1, 0) and packs.data.bodies.inertia.tolist() == [[[1.0, 1.0, 1.0]]]


def test_several_scenes_of_one_shape():
    """Numbers differ by scene; what belongs to the structure is shared."""
    hinge = Revolute(name="A", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    scenes = [
        Scene(name="s", gravity=(0.0, 0.0, -g), body=(body(position=(x, 0.0, 0.0), mass=m),), joint=(hinge,))
        for g, x, m in ((1.0, 0.5, 2.0), (2.0, 0.25, 3.0))
    ]
    packs = packing.Packs(scenes)
    assert packs.data.gravity.tolist() == [[0.0, 0.0, -1.0], [0.0, 0.0, -2.0]]
    assert packs.length.tolist() == [0.5, 0.25] and packs.mass[:, 0].tolist() == [2.0, 3.0]
    assert packs.data.primitives.kind.shape == (2, 3) and packs.data.row_bodies.shape == (2, 5, 2)
    assert packs.data.primitives.point_second[:, 0].tolist() == [[-0.5, 0.0, 0.0], [-0.25, 0.0, 0.0]]
    assert packs.data.lengths.tolist() == [[0.5], [0.25]]
    second = Model(scenes[0], packs, 1)
    assert second.length == 0.25 and second.mass[0] == 3.0 and second.scene is packs.scenes[1]
    assert second.data.gravity.tolist() == [0.0, 0.0, -2.0]


# --- numbers of loads and joints --------------------------------------------------------------------------
HINGE = Revolute(name="H", bodies=("a", "b"), anchor=(1.0, 2.0, 3.0), axis=(0.0, 0.0, 2.0))
SLIDE = Translational(name="S", bodies=("ground", "b"), anchor=(4.0, 5.0, 6.0), axis=(1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("load", "numbers"),
    [
        (Moment(body="a", moment=(1.0, 2.0, 3.0)), [1, 2, 3, *[0] * 21]),
        (Force(body="a", point=(4.0, 5.0, 6.0), force=(1.0, 2.0, 3.0)), [1, 2, 3, 4, 5, 6, *[0] * 18]),
        (
            Spring(
                bodies=("a", "b"),
                points=((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)),
                stiffness=7.0,
                damping=8.0,
                natural_length=9.0,
            ),
            [0, 0, 0, 1, 2, 3, 4, 5, 6, *[0] * 12, 7, 8, 9],
        ),
    ],
)
def test_numbers_of_loads_on_bodies(load, numbers):
    scene = Scene(name="s", body=(body(), body("b", position=(1.0, 0.0, 0.0))), load=(load,))
    assert [*packing._numbers_of(scene.load[0], scene)] == pytest.approx(numbers)


@pytest.mark.parametrize(
    ("load", "kind", "amount", "numbers"),
    [
        (JointTorque(joint="H", torque=5.0), ABOUT_AXIS, 5.0, (0.0, 0.0, 0.0)),
        (
            TorsionSpring(joint="H", stiffness=5.0, damping=6.0, natural_angle=0.5),
            ABOUT_AXIS,
            0.0,
            (5.0, 6.0, 0.5),
        ),
        (JointForce(joint="S", force=5.0), ALONG_AXIS, 5.0, (0.0, 0.0, 0.0)),
        (
            SlideSpring(joint="S", stiffness=5.0, damping=6.0, natural_displacement=0.5),
            ALONG_AXIS,
            0.0,
            (5.0, 6.0, 0.5),
        ),
    ],
)
def test_numbers_of_loads_of_joints(load, kind, amount, numbers):
    """The triad of the axis: x and y on the first body, x on the second."""
    scene = Scene(
        name="s", body=(body(), body("b", position=(1.0, 0.0, 0.0))), joint=(HINGE, SLIDE), load=(load,)
    )
    found = packing._numbers_of(load, scene)
    joint = scene.joint_named(load.joint)
    anchor, axis = np.array(joint.anchor_pair[0]), np.array(joint.directions[0])
    assert found[:3] == (amount, 0.0, 0.0) and found[3:9] == (*anchor, *anchor)
    z, x, y, u = np.array(found[9:21]).reshape(4, 3)
    assert z == pytest.approx(axis / np.linalg.norm(axis)) and np.cross(x, y) == pytest.approx(z)
    assert u.tolist() == x.tolist() and x @ z == pytest.approx(0.0) and found[21:] == numbers
    [place] = packing.Packs([scene]).structure.places.loads
    second = 1
    first = 0 if load.joint == "H" else 2
    assert place == (kind, first, second, -1)


def test_places_of_loads_and_their_functions():
    """The function of a load comes after the driver's."""
    factor = Factor(start=0.5)
    loads = (
        Moment(body="b", moment=(1.0, 0.0, 0.0)),
        Force(body="a", point=(0.0, 0.0, 0.0), force=(1.0, 0.0, 0.0), factor=factor),
        Spring(
            bodies=("b", "ground"),
            points=((1.0, 0.0, 0.0), (3.0, 0.0, 0.0)),
            stiffness=1.0,
            natural_length=1.0,
        ),
        Moment(body="a", moment=(1.0, 0.0, 0.0), factor=factor),
    )
    bodies = (body(), body("b", position=(1.0, 0.0, 0.0)))
    drivers = (Driver(joint="H", polynomial=(0.0, 1.0, 2.0)),)
    packs = packing.Packs([Scene(name="s", body=bodies, joint=(HINGE, SLIDE), driver=drivers, load=loads)])
    places = packs.structure.places
    assert places.loads == ((MOMENT, 1, 0, -1), (FORCE, 0, 0, 1), (SPRING, 1, 2, -1), (MOMENT, 0, 0, 2))
    assert places.functions == (1, 2, 2) and places.terms == 3 and places.anchored == (0, 1, 2, 1)
    functions = packs.data.functions
    assert functions.first.tolist() == [[0, 1, 3, 5]] and functions.polynomial[0, 0].tolist() == [
        0.0,
        1.0,
        2.0,
    ]
    assert functions.begin.tolist() == [[0.0, 0.0, 0.5, 0.0, 0.5]]
    assert functions.part.tolist() == [[1.0, 0.0, 1.0, 0.0, 1.0]]
    driven = [p.driver for p in places.primitives if p.joint == "H"]
    assert driven == [-1, -1, -1, 0] and packs.index == {"a": 0, "b": 1, "ground": 2, packing.FRAME: 2}


def test_a_load_of_an_unknown_type_is_refused():
    packs = packing.Packs([Scene(name="s", body=(body(),))])
    with pytest.raises(SceneError, match=r"load\[3\]: mbref has no equations for loads of type 'wind'"):
        packs._load_place(3, SimpleNamespace(type="wind"), -1)  # type: ignore[arg-type]


def test_lengths_of_a_scene_and_of_its_bodies():
    """The largest distance is between a centre and an anchor; anchors are 3 m and 4 m from the bodies."""
    joint = Distance(name="D", bodies=("a", "b"), anchors=((0.0, 3.0, 0.0), (2.0, 0.0, -4.0)))
    scene = Scene(name="s", body=(body(), body("b", position=(2.0, 0.0, 0.0))), joint=(joint,))
    packs = packing.Packs([scene])
    assert packs.length[0] == pytest.approx(np.sqrt(4 + 9 + 16)) and packs.data.lengths.tolist() == [
        [3.0, 4.0]
    ]
    alone = packing.Packs([Scene(name="s", body=(body(position=(5.0, 0.0, 0.0)),))])
    assert alone.length.tolist() == [1.0] and alone.data.lengths.tolist() == [[1.0]]


def test_rotors_of_armatures_do_not_count_in_the_length_of_a_scene():
    """The centre at 10 m and the hinge at 11 m are 1 m apart; the rotor is at the origin."""
    hinge = Revolute(
        name="A", bodies=("ground", "a"), anchor=(11.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), armature=0.5
    )
    scene = Scene(name="s", body=(body(position=(10.0, 0.0, 0.0)),), joint=(hinge,))
    packs = packing.Packs([scene])
    assert packs.nb == 2 and packs.length.tolist() == [1.0] and packs.data.lengths[0, 0] == 1.0
    assert packs.index == {"a": 0, "armature of A": 1, "ground": 2, packing.FRAME: 2}
    assert packing.Packs([scene, scene]).length.tolist() == [1.0, 1.0]


# --- shared entries ---------------------------------------------------------------------------------------
def test_a_function_is_called_once_for_each_entry():
    one, two = [1], [1]
    asked: list[Any] = []
    found = packing._once(lambda entry: asked.append(entry) or len(asked), [one, two, one, one])
    assert found == [1, 2, 1, 1] and asked[0] is one and asked[1] is two and len(asked) == 2


class Inner(NamedTuple):
    x: np.ndarray


class Outer(NamedTuple):
    inner: Inner
    y: np.ndarray


def test_arrays_of_one_scene():
    every = Outer(Inner(np.array([[1.0], [2.0]])), np.array([3.0, 4.0]))
    found = packing.row_of(every, 1)
    assert type(found) is Outer and type(found.inner) is Inner
    assert found.inner.x.tolist() == [2.0] and found.y == 4.0
