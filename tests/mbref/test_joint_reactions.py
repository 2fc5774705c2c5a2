"""Joint reactions / forces and moments of bodies at rest, worked out by hand. The multipliers λ balance the
forces that a test writes down: Φ_qᵀ λ = Q."""

import math
from typing import Any

import numpy as np
import pytest

from mbref import rotations
from mbref.equations import joint_reactions
from mbref.equations.joint_reactions import determined_components, open_dimensions, reactions
from mbref.equations.model import Model
from mbref.scene import (
    Body,
    Coupling,
    Cylindrical,
    Distance,
    Fixed,
    Revolute,
    Scene,
    Spherical,
    Translational,
)

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ORIGIN = (0.0, 0.0, 0.0)
ONE = (1.0, 0.0, 0.0, 0.0)
HALF = math.sqrt(0.5)
ROUNDING = 1e-12  # N, N m or the unit of a row, of values of about 1
TURNED = {"about x": (HALF, HALF, 0.0, 0.0), "about y": (HALF, 0.0, HALF, 0.0), "not at all": ONE}


def body(name: str, position: tuple[float, ...], orientation: tuple[float, ...] = ONE) -> Body:
    return Body(name=name, mass=2.0, inertia=(0.3, 0.4, 0.5), position=position, orientation=orientation)


def model(*bodies: Body, joint: tuple[Any, ...], **parts: Any) -> Model:
    return Model(Scene(name="s", body=bodies, joint=joint, **parts))


def poses(system: Model) -> np.ndarray:
    """Return the coordinates (1, nb, 7) of the scene as it is given."""
    return np.array([[[*b.position, *b.orientation] for b in system.scene.body]])


def balancing(system: Model, **loads: tuple[tuple[float, ...], tuple[float, ...]]) -> dict[str, list[float]]:
    """Return the reactions that balance a force and a moment (world axes) at the centre of each named
    body."""
    q = poses(system)
    forces = np.zeros((len(system.scene.body), 6))
    for name, (force, moment) in loads.items():
        b = system.scene.body_index(name)
        own = rotations.rotate(rotations.conjugate(q[0, b, 3:]), np.array(moment, dtype=float))
        forces[b] = [*force, *own]
    terms = system.terms(np.zeros(1), q)
    jacobian = system.structure.dense(terms.blocks)[0]
    multipliers = np.linalg.lstsq(jacobian.T, forces.ravel(), rcond=None)[0]
    assert np.abs(jacobian.T @ multipliers - forces.ravel()).max() < ROUNDING, "the loads are balanced"
    return {n: w[0].tolist() for n, w in reactions(system, q, terms.blocks, multipliers[None]).items()}


def near(*values: float) -> Any:
    return pytest.approx(list(values), abs=ROUNDING)


@pytest.mark.parametrize("orientation", TURNED.values(), ids=TURNED)
@pytest.mark.parametrize("frame", ["ground", "carrier"])
def test_reactions_of_coupled_shafts_include_the_tooth_torques(frame, orientation):
    """Shaft c turns 3 times as fast as shaft b: 6 N m on b balance -2 N m on c. The tooth forces are part of
    the reactions, as moments about the axes, which the carrier has in its own frame."""
    joints = (
        Fixed(name="base", bodies=("ground", "carrier"), anchor=ORIGIN),
        Revolute(name="B", bodies=(frame, "b"), anchor=X, axis=(0.0, 2.0, 0.0)),
        Revolute(name="C", bodies=(frame, "c"), anchor=Z, axis=(0.0, 2.0, 0.0)),
    )
    coupling = (Coupling(name="gear", joints=("B", "C"), ratio=3.0),)
    bodies = (body("carrier", ORIGIN, orientation), body("b", X, orientation), body("c", Z))
    wrenches = balancing(
        model(*bodies, joint=joints, coupling=coupling), b=(ORIGIN, (0, 6, 0)), c=(ORIGIN, (0, -2, 0))
    )
    assert wrenches["B"] == near(0, 0, 0, 0, -6, 0) and wrenches["C"] == near(0, 0, 0, 0, 2, 0)
    assert list(wrenches) == ["base", "B", "C"], "the gear is no joint"


@pytest.mark.parametrize("frame", ["ground", "carrier"])
def test_reactions_of_rack_and_pinion_include_the_tooth_force(frame):
    """The rack moves by 0.5 m/rad: 2 N along it balance -1 N m about the pinion."""
    joints = (
        Fixed(name="base", bodies=("ground", "carrier"), anchor=ORIGIN),
        Revolute(name="pinion", bodies=(frame, "b"), anchor=X, axis=Z),
        Translational(name="rack", bodies=(frame, "c"), anchor=Z, axis=(3.0, 0.0, 0.0)),
    )
    coupling = (Coupling(name="teeth", joints=("pinion", "rack"), ratio=0.5),)
    bodies = (body("carrier", ORIGIN, TURNED["about y"]), body("b", X), body("c", Z))
    wrenches = balancing(
        model(*bodies, joint=joints, coupling=coupling), b=(ORIGIN, (0, 0, -1)), c=((2, 0, 0), ORIGIN)
    )
    assert wrenches["pinion"] == near(0, 0, 0, 0, 0, 1) and wrenches["rack"] == near(-2, 0, 0, 0, 0, 0)


def test_screw_carries_an_axial_force_and_the_torque_that_balances_it():
    """5 N along the axis times 0.2 m/rad balance -1 N m about it."""
    screw = Cylindrical(name="screw", bodies=("ground", "b"), anchor=ORIGIN, axis=(0.0, 0.0, 4.0))
    coupling = (Coupling(name="thread", joints=("screw", "screw"), ratio=0.2),)
    system = model(body("b", Z), joint=(screw,), coupling=coupling)
    assert balancing(system, b=((0, 0, 5), (0, 0, -1)))["screw"] == near(0, 0, -5, 0, 0, 1)


def door(*heights: float) -> Model:
    """Return body b on hinges about z at these heights, and body c on a ball joint."""
    hinges = [
        Revolute(name=f"J{k}", bodies=("ground", "b"), anchor=(0.0, 0.0, z), axis=Z)
        for k, z in enumerate(heights)
    ]
    free = Spherical(name="free", bodies=("ground", "c"), anchor=ORIGIN)
    return model(body("b", X), body("c", Y), joint=(*hinges, free))


def test_two_hinges_on_one_axis_leave_five_components_open_each():
    """Ten rows of rank five: only the moment about z is determined, as zero; the ball joint of the other body
    is determined."""
    system = door(0.0, 2.0)
    q, blocks = poses(system), system.terms(np.zeros(1), poses(system)).blocks
    assert {n: k.tolist() for n, k in open_dimensions(system, blocks).items()} == {
        "J0": [5],
        "J1": [5],
        "free": [0],
    }
    shared = [False] * 5 + [True]
    assert {n: c.tolist() for n, c in determined_components(system, q, blocks).items()} == {
        "J0": [shared],
        "J1": [shared],
        "free": [[True] * 6],
    }


def test_vanishing_combinations_of_the_rows_of_two_hinges_are_five_and_orthonormal():
    """Columns N (13, 5) with Nᵀ U = 0 and Nᵀ N = 1, U the rows of length 1; the ball joint has three of the
    13."""
    system = door(0.0, 2.0)
    blocks = system.terms(np.zeros(1), poses(system)).blocks
    vanishing, lengths = joint_reactions.vanishing_combinations(system, blocks)
    assert vanishing.shape == (1, 13, 5) and lengths.shape == (1, 13)
    rows = system.structure.dense(blocks)[0] / lengths[0][:, None]
    assert np.abs(vanishing[0].T @ rows).max() < ROUNDING
    assert vanishing[0].T @ vanishing[0] == pytest.approx(np.eye(5), abs=ROUNDING)


def test_single_hinge_has_determined_reactions():
    system = door(0.0)
    blocks = system.terms(np.zeros(1), poses(system)).blocks
    assert {n: k.tolist() for n, k in open_dimensions(system, blocks).items()} == {"J0": [0], "free": [0]}
    assert all(c.all() for c in determined_components(system, poses(system), blocks).values())


def test_reactions_are_open_only_at_the_sample_of_the_singular_position():
    """A rod of 1 m along y stands across a slide along x at the second of three samples: the force along the
    rod, and its moment of 2 m at the slide, are open there."""
    slide = Translational(name="slide", bodies=("ground", "b"), anchor=ORIGIN, axis=X)
    rod = Distance(name="rod", bodies=("ground", "b"), anchors=((2.0, 1.0, 0.0), (2.0, 0.0, 0.0)))
    system = model(body("b", ORIGIN), joint=(slide, rod))
    q = np.array([[[x, 0.0, 0.0, *ONE]] for x in (-0.3, 0.0, 0.5)])
    blocks = system.terms(np.zeros(3), q).blocks
    found = open_dimensions(system, blocks)
    assert {name: k.tolist() for name, k in found.items()} == {"slide": [0, 1, 0], "rod": [0, 1, 0]}
    components = determined_components(system, q, blocks)
    assert components["slide"][1].tolist() == [True, False, True, True, True, False]
    assert components["rod"][1].tolist() == [True, False, True, True, True, True]
    assert all(c[[0, 2]].all() for c in components.values())


def test_body_without_joints_has_no_reactions():
    free = model(body("b", X), joint=())
    blocks = free.terms(np.zeros(1), poses(free)).blocks
    assert reactions(free, poses(free), blocks, np.zeros((1, 0))) == {}
    assert open_dimensions(free, blocks) == {} == determined_components(free, poses(free), blocks)
