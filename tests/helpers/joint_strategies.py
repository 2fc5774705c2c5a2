"""Strategies of the property tests: directions, poses, and joints between two bodies."""

import numpy as np
from hypothesis import strategies as st

from mbref.scene import JOINT_TYPES, Body, Distance, Driver, Scene, Sine, Universal

coordinate = st.floats(-1, 1, allow_subnormal=False)
vectors = st.tuples(coordinate, coordinate, coordinate)
directions = vectors.filter(lambda v: np.linalg.norm(v) > 0.1)
quaternions = (
    st.tuples(coordinate, coordinate, coordinate, coordinate)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: tuple((np.array(q) / np.linalg.norm(q)).tolist()))
)
DRIVABLE = tuple(kind for kind in JOINT_TYPES.values() if kind.facts.driven)


@st.composite
def bodies(draw, name: str) -> Body:
    """A body with mass, anywhere."""
    moments = np.array(draw(st.tuples(*[st.floats(0.1, 1)] * 3)))
    inertia = tuple((moments + moments.sum()).tolist())  # meets the triangle inequality
    mass = draw(st.floats(0.1, 10))
    position, orientation = draw(vectors), draw(quaternions)
    return Body(name=name, mass=mass, inertia=inertia, position=position, orientation=orientation)


@st.composite
def joints(draw, kind: type, pair: tuple[str, str]):
    """A joint of that kind between two bodies."""
    common = {"name": "J", "bodies": pair}
    if kind is Distance:
        first = draw(vectors)
        second = tuple((np.array(first) + np.array(draw(directions))).tolist())
        return Distance(**common, anchors=(first, second))
    if kind is Universal:
        axis, other = np.array(draw(directions)), np.array(draw(directions))
        across = np.cross(axis, other)
        if np.linalg.norm(across) < 0.05:
            across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        return Universal(**common, anchor=draw(vectors), axes=(tuple(axis.tolist()), tuple(across.tolist())))
    if "axis" not in kind.model_fields:
        return kind(**common, anchor=draw(vectors))
    return kind(**common, anchor=draw(vectors), axis=draw(directions))


@st.composite
def one_joint_scenes(draw, kind: type, driven: bool) -> Scene:
    """Two bodies, or a body and the ground, with one joint and perhaps its driver."""
    pair = draw(st.sampled_from([("ground", "b"), ("b", "ground"), ("b", "c")]))
    names = [name for name in pair if name != "ground"]
    joint = draw(joints(kind, pair))
    rates = draw(st.tuples(coordinate, coordinate))
    sine = Sine(amplitude=draw(coordinate), frequency=draw(st.floats(0.5, 3)))
    driver = Driver(joint="J", polynomial=(0.0, *rates), sine=sine)
    drawn = tuple(draw(bodies(name)) for name in names)
    return Scene(name="one joint", body=drawn, joint=(joint,), driver=(driver,) if driven else ())
