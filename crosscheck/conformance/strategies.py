"""Hypothesis strategies for tests of engines and methods: mechanisms, the paper's parameters, matrices.

``mechanisms()`` draws closed-loop mechanisms of any graph: a tree of bodies, then joints that close loops.
Every joint is given in the pose at t = 0, so that poses satisfy the joints by construction; velocities are
projected onto the velocities that the joints allow. Numbers are taken from coarse grids, so that reduced
examples are readable: fewer bodies, fewer loops, joints of the simplest type, bodies at rest.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import cast

import numpy as np
from hypothesis import strategies as st

from crosscheck.conformance.mechanisms.moving import consistent
from crosscheck.conformance.mechanisms.random_mechanisms import null_space
from crosscheck.judge.gauss_principle import goes_on
from mbref import rotations
from mbref.scene import (
    GROUND,
    HOLONOMIC_JOINTS,
    JOINT_TYPES,
    Body,
    Cylindrical,
    Force,
    Joint,
    Load,
    Moment,
    Revolute,
    Scene,
    Spring,
)
from mbref.scenes import SCENES

KINDS = ("revolute", "spherical", "universal", "cylindrical", "translational", "distance", "fixed")
PAPER = ("four_bar", "five_bar", "planar_slider_crank", "spatial_slider_crank")


def is_direction(vector: tuple[float, float, float]) -> bool:
    """Return whether a vector is long enough for a direction."""
    return bool(np.linalg.norm(vector) > 0.2)


grid = st.integers(-8, 8).map(lambda k: k / 8)
vectors = st.tuples(grid, grid, grid)
directions = vectors.filter(is_direction)


@st.composite
def mechanisms(
    draw: st.DrawFn,
    most_bodies: int = 4,
    most_loops: int = 2,
    kinds: Sequence[str] = KINDS,
    redundant: bool = False,
) -> Scene:
    """Return a mechanism with masses, gravity, loads and consistent velocities.

    ``redundant`` adds a second hinge on the axis of a hinge; the rows of the second hinge are redundant.
    """
    bodies = [draw(_bodies(f"b{k}", k)) for k in range(draw(st.integers(1, most_bodies)))]
    names = [GROUND, *(body.name for body in bodies)]
    joints = [
        draw(_joints(f"J{k}", (names[draw(st.integers(0, k))], names[k + 1]), bodies, kinds))
        for k in range(len(bodies))
    ]
    pairs = list(itertools.combinations(names, 2))
    for loop in range(draw(st.integers(0, most_loops)) if len(bodies) > 1 else 0):
        closing = draw(_joints(f"L{loop}", draw(st.sampled_from(pairs)), bodies, kinds))
        if _freedoms(bodies, [*joints, closing]) > 0:
            joints.append(closing)
    if redundant:
        joints += draw(_two_hinges(bodies, joints))
    gravity = draw(vectors.map(lambda v: (8 * v[0], 8 * v[1], 8 * v[2])))
    scene = Scene(
        name="drawn",
        gravity=gravity,
        duration=0.05,
        body=tuple(bodies),
        joint=tuple(joints),
        load=tuple(draw(_loads(bodies))),
    )
    twists = np.array([[*draw(vectors), *draw(vectors)] for _ in bodies])
    moving = consistent(scene, twists)
    return moving if goes_on(moving) else consistent(scene, 0 * twists)


@st.composite
def paper_mechanisms(draw: st.DrawFn, names: Sequence[str] = PAPER) -> Scene:
    """Return one of the paper's mechanisms with masses and moments of inertia multiplied by factors of 1/4 to
    4."""
    scene = SCENES[draw(st.sampled_from(list(names)))]()
    factors = st.sampled_from((1.0, 0.25, 0.5, 2.0, 4.0))
    bodies = []
    for body in scene.body:
        mass, inertia = draw(factors), draw(factors)
        moments = (inertia * np.array(body.inertia)).tolist()
        bodies.append(Body(**{**dict(body), "mass": mass * cast(float, body.mass), "inertia": moments}))
    return scene.with_(body=bodies)


@st.composite
def matrices(
    draw: st.DrawFn, rank: int | None = None, spectrum: Sequence[float] | None = None, most: int = 8
) -> np.ndarray:
    """Return a matrix (m, n) of a given or random rank, with given singular values or values within two
    decades of 1."""
    least = max(rank or 0, len(spectrum or ()), 1)
    m, n = draw(st.integers(least, max(least, most))), draw(st.integers(least, max(least, most)))
    if spectrum is None:
        count = rank if rank is not None else draw(st.integers(0, min(m, n)))
        spectrum = [10.0 ** draw(st.integers(-1, 1)) for _ in range(count)]
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    left, right = (np.linalg.qr(rng.normal(size=(size, size)))[0] for size in (m, n))
    return left[:, : len(spectrum)] * np.array(spectrum) @ right[: len(spectrum)]


@st.composite
def _bodies(draw: st.DrawFn, name: str, k: int) -> Body:
    """Return a body within half a metre of its place in a row of bodies, with a full inertia matrix."""
    place = np.array(draw(vectors)) / 2 + np.array([0.6 * (k + 1), 0.0, 0.0])
    turn, principal = (rotations.from_vector(np.array(draw(vectors))) for _ in range(2))
    spread = np.array(draw(st.tuples(*[st.integers(1, 4)] * 3))) / 100
    axes = rotations.to_matrix(principal)
    inertia = axes @ np.diag(spread.sum() - spread) @ axes.T
    return Body(
        name=name,
        mass=draw(st.integers(1, 8)) / 2,
        inertia=(inertia + inertia.T) / 2,
        position=place.tolist(),
        orientation=turn.tolist(),
    )


@st.composite
def _joints(
    draw: st.DrawFn, name: str, pair: tuple[str, str], bodies: Sequence[Body], kinds: Sequence[str]
) -> Joint:
    """Return a joint of a random type between two bodies, near the middle of their centres."""
    places = {GROUND: np.zeros(3), **{body.name: np.array(body.position) for body in bodies}}
    anchor = ((places[pair[0]] + places[pair[1]]) / 2 + np.array(draw(vectors)) / 4).tolist()
    along = np.array(draw(directions), dtype=float)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    kind = JOINT_TYPES[draw(st.sampled_from([each for each in kinds if each in HOLONOMIC_JOINTS]))]
    anchors = anchor, (np.array(anchor) + along / 2).tolist()
    axes = along.tolist(), across.tolist()
    return kind.at(name, pair, anchor=anchor, anchors=anchors, axis=axes[0], axes=axes)


@st.composite
def _two_hinges(draw: st.DrawFn, bodies: Sequence[Body], joints: Sequence[Joint]) -> list[Joint]:
    """Return a second joint on the axis of a revolute joint; without a revolute joint, a new pair of coaxial
    hinges."""
    hinges = [joint for joint in joints if isinstance(joint, Revolute)]
    if not hinges:
        return [joints[-1].model_copy(update={"name": "R"})]  # a duplicate joint is redundant
    hinge = draw(st.sampled_from(hinges))
    axis = rotations.unit(hinge.axis)
    kinds: list[type[Revolute | Cylindrical]] = [Revolute, Cylindrical]
    kind = draw(st.sampled_from(kinds))
    return [kind(name="R", bodies=hinge.bodies, anchor=np.array(hinge.anchor) + 0.4 * axis, axis=axis)]


@st.composite
def _loads(draw: st.DrawFn, bodies: Sequence[Body]) -> list[Load]:
    """Return up to three loads of the last body: a moment, a force and a spring to the ground."""
    name, place = bodies[-1].name, np.array(bodies[-1].position)
    point = (place + np.array(draw(vectors)) / 4).tolist()
    known: list[Load] = [
        Moment(body=name, moment=draw(vectors)),
        Force(body=name, point=point, force=draw(vectors)),
        Spring(bodies=(GROUND, name), points=((0.0, 2.0, 0.0), point), stiffness=20.0, natural_length=0.5),
    ]
    return [load for load in known if draw(st.booleans())]


def _freedoms(bodies: Sequence[Body], joints: Sequence[Joint]) -> int:
    return null_space(Scene(name="trial", body=tuple(bodies), joint=tuple(joints))).shape[1]
