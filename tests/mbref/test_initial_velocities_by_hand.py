"""Initial velocities, parts of scenes and poses along a motion / small equations worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array

from mbref import rotations
from mbref.equations import along_trajectory, initial_state, model, parts
from mbref.equations.couplings import coordinate_primitives, couplings_of, rotors_of
from mbref.equations.initial_state import Rates
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
    SceneError,
    Translational,
)
from mbref.scene_joints import ANGLE, DISPLACEMENT

# --- velocities of small equations ------------------------------------------------------------------------
SCALE = np.array([1.0, 2.0, 0.5])
MASS = np.array([1.0, 2.0, 5.0])
NAMES = ("first", "second", "third")


def solved(way: str, rows: Any, nu: Any, given: dict[int, float], drivers: tuple[str, ...] = ("A",)) -> Any:
    """Velocities of three coordinates for rows · v = ν and given velocities, by one of two ways."""
    matrix = np.array(rows, dtype=float)
    scenes: Any = SimpleNamespace(
        model=SimpleNamespace(
            n=3,
            row_joint=NAMES,
            scene=SimpleNamespace(driver=[SimpleNamespace(joint=name) for name in drivers]),
            structure=SimpleNamespace(sparse=csr_array),
        ),
        mass=[None, MASS],
    )
    v, mask = np.zeros(3), np.zeros(3, dtype=bool)
    for k, value in given.items():
        v[k], mask[k] = value, True
    dense = way == "_velocities"
    rates = Rates(v, mask, np.array(nu, dtype=float), SCALE, matrix * SCALE if dense else matrix)
    return getattr(initial_state, way)(scenes, 1, rates)


WAYS = pytest.mark.parametrize("way", ["_velocities", "_sparse_velocities"])


@WAYS
@pytest.mark.parametrize(
    ("rows", "nu", "given", "v", "residual", "is_open"),
    [
        ([[1, 1, 0]], [3], {}, (2, 1, 0), 0, True),
        ([[0, 1, 2]], [9], {}, (0, 4.5 / 1.3, 3.6 / 1.3), 0, True),
        ([[1, -1, 0]], [0], {0: 1, 1: 1}, (1, 1, 0), 0, True),
        ([[1, -1, 0]], [0], {0: 1}, (1, 1, 0), 0, True),
        ([[1, -1, 0]], [0], {0: 1, 1: 1.02}, (1.004, 1.004, 0), 0.02, True),
        ([[2, -2, 0]], [0], {0: 1, 1: 1.02, 2: -3}, (1.004, 1.004, -3), 0.04, False),
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [1, 2, 4], {}, (1, 2, 4), 0, None),
        ([[1, 1, 0], [1, 1, 0]], [3, 3], {2: 7}, (2, 1, 7), 0, True),
    ],
)
def test_nearest_velocities_and_then_the_least_energy(way, rows, nu, given, v, residual, is_open):
    """Given velocities are missed least in units of the scale; others have the least Σ m v², m = 1, 2 and 5.

    So v₂ + 2 v₃ = 9 gives v ∝ (0, 1/2, 2/5). As the second scale is 2, v₁ = v₂ = (1 + 1.02/4) / (1 + 1/4)
    is nearest to (1, 1.02).
    """
    found, off, still_open = solved(way, rows, nu, given)
    assert found == pytest.approx(v, abs=1e-6) and off == pytest.approx(residual, abs=1e-9)
    if is_open is not None:
        assert still_open is is_open
    elif way == "_velocities":
        assert not still_open, "nothing is open"


def test_nothing_moves_and_nothing_is_asked():
    found, off, still_open = solved("_velocities", [[1, 1, 0]], [0], {})
    assert found.tolist() == [0.0, 0.0, 0.0] and off == 0.0 and still_open
    assert solved("_velocities", [[1, 1, 0]], [0], {0: 0, 1: 0, 2: 0})[2] is False
    assert solved("_velocities", [[1, 1, 0]], [0], {0: 0})[2] is True


@WAYS
def test_given_velocities_that_miss_a_row_by_far_name_its_joint(way):
    """(1, 1.2) are 0.2 apart; the scaled miss (1.04 - 1.2) / 2 is more than 5 % of 1."""
    with pytest.raises(SceneError) as caught:
        solved(way, [[0, 0, 1], [1, -1, 0]], [0, 0], {0: 1, 1: 1.2})
    text = "joint[second]: velocities given to bodies violate it by 0.2 m/s or rad/s"
    assert text in str(caught.value)
    found, off, _ = solved(way, [[0, 0, 1], [1, -1, 0]], [0, 0], {0: 1, 1: 1.11})
    assert off == pytest.approx(0.11) and found[0] == pytest.approx(1.022)


@WAYS
@pytest.mark.parametrize(
    ("drivers", "who"),
    [(("A",), "contradicts the joints"), (("A", "B"), "the drivers of A, B contradict the joints")],
)
def test_drivers_that_contradict_each_other(way, drivers, who):
    """v₁ = 1, 1 and 4: the mean 2 misses the third row most."""
    with pytest.raises(SceneError) as caught:
        solved(way, [[1, 0, 0], [1, 0, 0], [1, 0, 0]], [1, 1, 4], {}, drivers)
    assert f"driver[A]: {who} at t = 0, most of all at joint 'third'" in str(caught.value)


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


@pytest.mark.parametrize(
    ("off", "best"),
    [((0.5e-13, 1e-14, 1e-13), 0), ((0.5e-13, 1e-14, 1.1e-13), 1), ((2e-13, 3e-13, 1e-13), 2), ((2e-13,), 0)],
)
def test_the_velocities_that_satisfy_the_rows_best(monkeypatch, off, best):
    """The first of several that satisfy them to 1e-13, otherwise the best; corrected in unit rows."""
    along = [np.array([1.0 + k, 2.0]) for k in range(len(off))]
    left = iter(off)
    monkeypatch.setattr(initial_state, "rate_violation", lambda model, q, v: next(left))
    terms = SimpleNamespace(jacobian=np.array([[0.0, 5.0]]), nu=np.array([10.5]))
    q = np.zeros(7)

    def terms_at(t: float, at: np.ndarray, v: np.ndarray) -> Any:
        assert t == 0.0 and at is q and v is along[best]
        return terms

    of: Any = SimpleNamespace(terms=terms_at)
    found = initial_state._best_met(of, q, along)
    assert found == pytest.approx([1.0 + best, 2.1])


def test_the_largest_violation_of_unit_rows_at_the_start():
    """Rows of lengths 5 and 2, which v misses by 11 - 6 and 4 - 5; its largest entry has the size 2."""
    terms = SimpleNamespace(jacobian=np.array([[3.0, -4.0], [0.0, -2.0]]), nu=np.array([6.0, 5.0]))
    q, v = np.zeros(7), np.array([1.0, -2.0])
    of: Any = SimpleNamespace(terms=lambda *given: terms if given == (0.0, q, v) else None)
    assert initial_state.rate_violation(of, q, v) == pytest.approx(max(5 / 5, 1 / 2) / 2.0)


def test_least_changes_in_the_metric_of_masses():
    """Masses 4 kg, 0.25 kg and none, which counts as 1 kg: the changes are as their inverses."""
    structure = SimpleNamespace(dense=lambda blocks: blocks)
    scenes: Any = SimpleNamespace(
        model=SimpleNamespace(m=1, structure=structure), mass=np.array([[9.0] * 3, [4.0, 0.25, 0.0]])
    )
    found = initial_state._least_changes(scenes, np.array([1]), np.ones((1, 1, 3)), np.array([[10.5]]))
    assert found == pytest.approx(np.array([[0.5, 8.0, 2.0]]))


def test_limits_of_corrected_positions(monkeypatch):
    """The limits are 0.05 m before the correction and 1e-10 m after it."""
    closed = initial_state.CLOSED
    before = np.array([[0.0, -0.05], [0.0, math.nextafter(0.05, 1.0)], [0.01, 0.0], [0.0, 0.0]])
    after = np.array([[2e-10, 0.0], [0.0, 2e-10], [closed, 0.0], [0.0, -math.nextafter(closed, 1.0)]])
    scenes: Any = SimpleNamespace(length=np.array([1.0, 0.5, 1.0, 1.0]))
    scenes.model = SimpleNamespace(row_joint=("A", "B"))
    terms = SimpleNamespace(phi=after)
    asked: list[Any] = []
    monkeypatch.setattr(
        initial_state, "_solved", lambda *given: asked.append(given) or ("moved", before, terms)
    )
    q, first, faults, found = initial_state._corrected(scenes, "q")  # type: ignore[arg-type]
    [(given, start, most)] = asked
    assert given is scenes and start == "q" and most.tolist() == [0.05] * 4
    assert q == "moved" and found is terms  # type: ignore[comparison-overlap]
    assert first.tolist() == [0.05, math.nextafter(0.05, 1.0), 0.01, 0.0]
    says = {k: str(fault) for k, fault in faults.items()}
    assert sorted(says) == [0, 1, 3]
    assert "joint[A]: no nearby positions satisfy it; 2e-10 m or rad remain" in says[0]
    assert "joint[B]: positions given to bodies violate it by 0.05 m or rad" in says[1]
    assert "joint[B]: no nearby positions satisfy it; 1e-10 m or rad remain" in says[3]
    after[[0, 1, 3]] = 0.0
    assert initial_state._corrected(scenes, "q")[2] == {}  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("loops", "rows", "along", "asks"),
    [(1, 120, True, True), (0, 5, True, False), (1, 121, True, False), (2, 5, False, True)],
)
def test_branches_are_asked_for_with_loops_and_few_rows(monkeypatch, loops, rows, along, asks):
    asked: list[Any] = []
    monkeypatch.setattr(
        initial_state, "velocities_along", lambda *given: asked.append(given) or (["w"] if along else [])
    )
    monkeypatch.setattr(initial_state, "_best_met", lambda model, q, found: found[0])
    of: Any = SimpleNamespace(closed_loops=loops, m=rows)
    q: Any = "q"
    v: Any = "v"
    found = initial_state._along_branch(of, q, v, "given")  # type: ignore[arg-type]
    assert found == ("w" if asks and along else None) and asked == [(of, "q", "v", "given")] * asks


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


@pytest.mark.parametrize(
    ("places", "anchor", "extent"),
    [
        (((0.0, 0.0, 0.0), (0.0, 3.0, 0.0)), (0.0, 0.0, 0.0), 3.0),
        (((1.0, 2.0, 0.0), (2.0, 3.0, -4.0)), (1.0, 2.0, 1.5), 5.5),
        (((1.0, 2.0, 3.0),), (1.0, 2.0, 3.0), 1.0),
        (((1.0, 2.0, 3.0),), (9.0, 2.0, 3.0), 8.0),
    ],
)
def test_the_extent_of_a_scene(places, anchor, extent):
    """The largest side of the box around centres and anchors; 1 m for a single point."""
    bodies = tuple(body(f"b{k}", position=place) for k, place in enumerate(places))
    scene = Scene(name="s", body=bodies, joint=(hinge("A", "ground", "b0", anchor=anchor),))
    assert parts._extent(scene) == extent


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


def test_terms_of_another_value_and_of_one_state():
    structure: Any = SimpleNamespace(dense=lambda blocks: 2 * blocks)
    terms = model.Terms(
        structure, np.ones(2), np.arange(4.0).reshape(2, 2), *(np.arange(2.0) + k for k in range(4))
    )
    less = terms.less(np.array([0.5, 0.25]))
    assert less.phi.tolist() == [-0.5, 0.75] and less.nu.tolist() == [1.0, 2.0] and less.mass is terms.mass
    one = terms[1]
    assert (one.phi, one.nu, one.gamma, one.force) == (1.0, 2.0, 3.0, 4.0) and one.blocks.tolist() == [
        2.0,
        3.0,
    ]
    assert terms.jacobian.tolist() == [[0.0, 2.0], [4.0, 6.0]]


def test_coordinates_of_a_motion_beside_a_modelled_ground():
    """Velocities turn to the principal frames, the ground stands still."""
    tensor = ((2.0, 0.5, 0.0), (0.5, 2.5, 0.2), (0.0, 0.2, 3.0))
    scene = Scene(name="s", ground="body", body=(body("a", inertia=tensor),))
    of = model.Model(scene)
    place, linear, angular = (
        np.array([[[1.0, 2.0, 3.0]]]),
        np.array([[[4.0, 5.0, 6.0]]]),
        np.array([[[7.0, 8.0, 9.0]]]),
    )
    motion: Any = SimpleNamespace(
        position=place,
        orientation=TURN[None, None],
        velocity=linear,
        angular_velocity=angular,
        acceleration=2 * linear,
        angular_acceleration=None,
        bodies=("a",),
    )
    q, v, a = along_trajectory.coordinates(of, motion)
    p = rotations.multiply(TURN, of.principal[0])
    assert q[0, :7] == pytest.approx([1.0, 2.0, 3.0, *p]) and q[0, 7:].tolist() == [0, 0, 0, 1, 0, 0, 0]
    turned = rotations.to_matrix(p).T
    assert v[0] == pytest.approx([4.0, 5, 6, *(turned @ [7.0, 8, 9]), 0, 0, 0, 0, 0, 0]) and a is None
    motion.angular_acceleration = -angular
    second = along_trajectory.coordinates(of, motion)[2]
    assert second is not None
    assert second[0] == pytest.approx([8.0, 10, 12, *(turned @ [-7.0, -8, -9]), 0, 0, 0, 0, 0, 0])
    motion.acceleration = None
    assert along_trajectory.coordinates(of, motion)[2] is None
    of.release()


def test_largest_rows_at_each_sample():
    rows = np.array([[1.0, -3.0, 2.0], [0.5, 0.25, -0.125]])
    assert along_trajectory._largest(rows).tolist() == [3.0, 0.5]
    assert along_trajectory._largest(np.zeros((2, 0))).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("accelerates", [True, False])
def test_violations_of_rows_at_each_sample(monkeypatch, accelerates):
    """Two samples, rows A and gear, three velocities; the gear's row is 2 · 5 - 3 · 7 = -11 and 2 - 3."""
    jacobian = np.array([[[1.0, 2.0, 0.0], [0.0, 1.0, 1.0]], [[1.0, 0.0, 0.0], [0.0, 0.0, 3.0]]])
    v, a = np.array([[1.0, 1.0, 1.0], [2.0, 0.0, 0.0]]), np.array([[4.0, 0.0, 0.0], [0.0, 0.0, 5.0]])
    terms = SimpleNamespace(
        phi=np.array([[-2.0, 99.0], [6.0, 99.0]]),
        nu=np.array([[1.0, 0.0], [0.5, 8.0]]),
        gamma=np.array([[0.0, 0.5], [0.0, 1.0]]),
        jacobian=jacobian,
    )
    released: list[int] = []
    motion: Any = SimpleNamespace(times="times")
    made: Any = SimpleNamespace(
        terms=lambda *given: terms if given == ("times", "q", v) else None,
        scene="bare scene",
        row_joint=("A", "gear"),
        release=lambda: released.append(1),
    )
    coupled = SimpleNamespace(
        name="gear",
        joints=(SimpleNamespace(name="A"), SimpleNamespace(name="B")),
        coordinates=("angle", "displacement"),
        factors=(2.0, -3.0),
    )
    places = {("A", "angle"): np.array([5.0, 1.0]), ("B", "displacement"): np.array([7.0, 1.0])}
    for name, stand_in in {
        "Model": lambda scene: made if scene == "bare scene" else None,
        "without_armatures": lambda scene: f"bare {scene}",
        "coordinates": lambda *given: given == (made, motion) and ("q", v, a if accelerates else None),
        "couplings_of": lambda scene: [coupled] if scene == "bare scene" else [],
        "joint_motion": lambda *given: given[2] if given[:2] == ("bare scene", motion) else None,
        "along": lambda moved, coordinate: (places[moved, coordinate], None),
    }.items():
        monkeypatch.setattr(along_trajectory, name, stand_in)
    found = along_trajectory.violations("scene", motion)  # type: ignore[arg-type]
    position, velocity, acceleration = found
    assert position.tolist() == [11.0, 6.0] and velocity.tolist() == [2.0, 8.0] and released == [1]
    assert (acceleration.tolist() == [4.0, 14.0]) if accelerates else (acceleration is None)


def test_determined_reactions_of_a_trajectory(monkeypatch):
    released: list[int] = []
    motion: Any = SimpleNamespace(times="times")
    made: Any = SimpleNamespace(nb=2, release=lambda: released.append(1))

    def terms(times: str, q: np.ndarray) -> Any:
        assert times == "times" and q.shape == (3, 2, 7)
        return SimpleNamespace(blocks="blocks")

    def determined(model: Any, q: np.ndarray, blocks: str) -> dict[str, Any]:
        assert model is made and q[1, 1].tolist() == list(range(21, 28)) and blocks == "blocks"
        return {"A": "mask"}

    made.terms = terms
    monkeypatch.setattr(along_trajectory, "Model", lambda scene: made if scene == "bare scene" else None)
    monkeypatch.setattr(along_trajectory, "without_armatures", lambda scene: f"bare {scene}")
    moved = np.arange(42.0).reshape(3, 14)
    monkeypatch.setattr(
        along_trajectory, "coordinates", lambda *given: given == (made, motion) and (moved, None, None)
    )
    monkeypatch.setattr(along_trajectory, "determined_components", determined)
    assert along_trajectory.determined_reactions("scene", motion) == {"A": "mask"}  # type: ignore[arg-type]
    assert released == [1]


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


@pytest.mark.parametrize(
    ("rows", "is_open", "speed", "branch", "asks"),
    [
        (40, True, 2.0, 5.0, True),
        (41, True, 2.0, 5.0, True),
        (40, True, 2.0, None, True),
        (40, False, 2.0, 5.0, False),
        (40, True, 0.0, 5.0, False),
    ],
)
def test_the_start_of_one_scene(monkeypatch, rows, is_open, speed, branch, asks):
    """Velocities of a branch replace open velocities; more than 40 rows are solved sparsely."""
    scenes: Any = SimpleNamespace(model=SimpleNamespace(m=rows), model_of=lambda k: f"model {k}")
    rates = Rates(*np.arange(10.0).reshape(5, 2))
    asked: list[Any] = []

    def way(name: str) -> Any:
        return lambda *given: asked.append((name, *given)) or (np.array([0.0, speed]), 0.25, is_open)

    def along(*given: Any) -> Any:
        asked.append(("branch", *given))
        return None if branch is None else np.array([0.0, branch])

    monkeypatch.setattr(initial_state, "_velocities", way("dense"))
    monkeypatch.setattr(initial_state, "_sparse_velocities", way("sparse"))
    monkeypatch.setattr(initial_state, "_along_branch", along)
    q = np.arange(7.0)
    found: Any = initial_state._start(scenes, 3, q, 0.75, rates)
    follows = asks and branch is not None
    assert asked[0][:3] == ("sparse" if rows > 40 else "dense", scenes, 3) and asked[0][3] is rates
    assert len(asked) == 1 + asks
    if asks:
        name, model_of, at, v, given = asked[1]
        assert (name, model_of) == ("branch", "model 3") and at is q and given is rates.given
        assert v.tolist() == [0.0, speed]
    assert found.q is q and found.v.tolist() == [0.0, branch if follows else speed] and found.given is rates.v
    assert (found.position_violation, found.velocity_violation) == (0.75, 0.25)
    assert found.follows_branch is follows


def test_a_fault_of_one_scene_is_returned(monkeypatch):
    fault = SceneError(["joint[A]: contradicts"])

    def fails(*given: Any) -> Any:
        raise fault

    monkeypatch.setattr(initial_state, "_velocities", fails)
    scenes: Any = SimpleNamespace(model=SimpleNamespace(m=1))
    assert initial_state._start(scenes, 0, None, 0.0, None) is fault  # type: ignore[arg-type]


def test_memory_of_a_model_is_acquired_once_and_released_once(monkeypatch):
    """Memory of another scene of equal structure gets the numbers of this scene."""
    asked: list[Any] = []
    pooled = SimpleNamespace(values="values")
    made = model.Model(Scene(name="s", body=(body("a"),)))

    def acquire(key: Any, make: Any) -> Any:
        assert key == (model.Equations, made.structure) and make == made.equations
        asked.append("acquired")
        return pooled

    monkeypatch.setattr(model, "acquire", acquire)
    monkeypatch.setattr(model, "release", lambda given: asked.append(("released", given)))
    monkeypatch.setattr(model.Model, "put_numbers", lambda self, *given: asked.append(given))
    made.release()
    for _ in range(2):
        assert made.memory is pooled  # type: ignore[comparison-overlap]
    assert asked == ["acquired", ("values", made.data)]
    made.release()
    made.release()
    assert asked[2:] == [("released", pooled)]
    assert made.memory is pooled and asked[3] == "acquired"  # type: ignore[comparison-overlap]


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
