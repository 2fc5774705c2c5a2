"""Scenes the tests of the judge share: one for each family of truths, with every kind of load."""

import numpy as np

from crosscheck.judge.truth import closed_form
from mbref import rotations
from mbref.scene import Body, Driver, Force, Moment, Revolute, Scene, Sine, TorsionSpring, Translational
from mbref.scenes import SCENES
from tests.helpers.parts import Z, spring


def pendulum(**changes):
    """A bar of 1 m held at one end, its frame not along its principal axes."""
    inertia = ((0.05, 0.01, 0.0), (0.01, 0.06, 0.0), (0.0, 0.0, 0.1))
    bar = Body(name="bar", mass=1.2, inertia=inertia, position=(0.3, -0.4, 0.2))
    pivot = Revolute(name="pivot", bodies=("ground", "bar"), anchor=(0.0, 0.0, 0.0), axis=Z)
    return Scene(**({"name": "pendulum", "body": (bar,), "joint": (pivot,)} | changes))


def door(tilt: float, seed: int = 0) -> Scene:
    """Return a door on two hinges, the second tilted (rad), in a random orientation unless the seed is 0."""
    turn = rotations.from_vector(np.random.default_rng(seed).normal(size=3) if seed else np.zeros(3))
    turned = lambda *vector: tuple(map(float, rotations.rotate(turn, np.array(vector))))  # noqa: E731
    pose = {"position": turned(0.5, 0.0, 0.5), "orientation": tuple(turn)}
    body = Body(name="door", mass=1.0, inertia=(0.1, 0.2, 0.15), **pose)
    hinges = tuple(
        Revolute(name=name, bodies=("ground", "door"), anchor=turned(0.0, 0.0, z), axis=turned(x, 0.0, 1.0))
        for name, z, x in (("A", 0.0, 0.0), ("B", 1.0, tilt))
    )
    return Scene(name="door", gravity=turned(0.0, -9.81, 0.0), body=(body,), joint=hinges)


def block(**changes):
    """A body on an inclined line."""
    body = Body(name="block", mass=2.0, inertia=(0.1, 0.1, 0.1), position=(1.0, 2.0, 3.0))
    guide = Translational(name="line", bodies=("ground", "block"), anchor=(1, 2, 3), axis=(3, 4, 0))
    return Scene(**({"name": "block", "body": (body,), "joint": (guide,)} | changes))


def free(**changes):
    """A body with three different moments, spinning near its middle axis."""
    pose = {"position": (1.0, 0.0, 0.0), "orientation": rotations.from_vector(np.array([0.3, 0.2, 0.9]))}
    twist = {"velocity": (0.0, 2.0, 1.0), "angular_velocity": (0.3, 5.0, 0.2)}
    body = Body(name="body", mass=2.0, inertia=(0.2, 0.3, 0.4), **pose, **twist)
    return Scene(**({"name": "free", "body": (body,)} | changes))


def swing(**changes):
    return SCENES["planar_slider_crank_gravity"]().with_(**changes)


SPRUNG = {
    "pendulum_all": pendulum(
        gravity=(1.0, -9.0, 2.0),
        load=(
            Moment(body="bar", moment=(0.0, 0.0, 2.5)),
            Force(body="bar", point=(0.5, -0.8, 0.2), force=(1.0, 2.0, 3.0)),
            spring("bar", (0.6, -0.8, 0.0), "ground", (1.0, 1.0, 1.0), 7.0, 0.4),
            TorsionSpring(joint="pivot", stiffness=3.0, natural_angle=0.4),
        ),
    ),
    "crank_torsion": swing(load=(TorsionSpring(joint="B", stiffness=8.0, natural_angle=-0.3),)),
    "slider_spring": swing(
        load=(
            spring("crank", (0.1, 0.05, 0.0), "slider", (0.7, 0.0, 0.1), 90.0, 0.2),
            Force(body="rod", point=(0.5, 0.1, 0.0), force=(3.0, -4.0, 1.0)),
        )
    ),
    "block_spring": block(
        gravity=(0.0, -9.81, 0.0), load=(spring("ground", (0, 0, 0), "block", (1.5, 2, 3), 60.0, 2.0),)
    ),
    "free_spring": free(
        gravity=(0.0, 0.0, -9.81),
        load=(
            spring("body", (1.1, 0.2, 0.3), "ground", (0, 0, 1), 30.0, 0.5),
            Force(body="body", point=(1.0, 0.1, 0.0), force=(0.0, 1.0, 2.0)),
        ),
    ),
}
CLOSED = tuple(n for n in SCENES if closed_form(SCENES[n]()) is not None)  # others: test_published
ALL = (
    {n: SCENES[n]() for n in CLOSED}
    | SPRUNG
    | {
        "pendulum_driven": pendulum(driver=(Driver(joint="pivot", polynomial=(0, 2.0, -1.0)),)),
        "block_driven": block(driver=(Driver(joint="line", sine=Sine(amplitude=0.3, frequency=4.0)),)),
    }
)
