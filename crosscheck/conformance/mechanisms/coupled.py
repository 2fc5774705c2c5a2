"""Two bodies in motion, on joints that couplings relate, with an event (a stop, a latch, an interval), or
with a ball joint that a driver turns; a wheel."""

from __future__ import annotations

from crosscheck.conformance.changes.copies import replaced
from crosscheck.conformance.mechanisms.features import JOINTS
from crosscheck.conformance.mechanisms.moving import (
    BALL,
    BODY,
    DURATION,
    GRAVITY,
    HINGE,
    HUB,
    between,
    launched,
)
from mbref.scene import Body, Coupling, Distance, Driver, Rolling, Scene, Turn

TURNS = (
    Turn(axis=(0.3, -0.4, 1.0), polynomial=(0.0, 0.8, -0.5)),
    Turn(axis=(1.0, 0.2, 0.0), sine={"amplitude": 0.3, "frequency": 6.0}),
)


def coupled_probes() -> dict[str, Scene]:
    """Return two bodies on joints that couplings of each kind relate, between moving bodies, with armatures
    of angles and displacements."""
    hinge, turning, sliding = (
        replaced(joint, armature=armature)
        for joint, armature in (
            (HINGE, 0.05),
            (between(JOINTS["revolute"]), 0.03),
            (between(JOINTS["translational"]), 0.8),
        )
    )
    gears = Coupling(name="gears", joints=("H", "J"), ratio=-1.7)
    follower = Coupling(name="cam", joints=("H", "J"), polynomial=(0.1, 0.8, -0.5))
    three = ("angle", "angle", "displacement")
    total = Coupling(name="sum", joints=("H", "J", "J"), coordinates=three, ratios=(0.4, 1.0, 2.0))
    return {
        "gears in motion": launched("gears", (HUB, BODY), (hinge, turning), couplings=(gears,)),
        "cam in motion": launched("cam", (HUB, BODY), (hinge, sliding), couplings=(follower,)),
        "sum of coordinates": launched(
            "sum", (HUB, BODY), (HINGE, between(JOINTS["cylindrical"])), couplings=(total,)
        ),
    }


def driven_ball() -> Scene:
    """Return a body on a ball joint, whose driver turns it about two axes; a hinge carries both."""
    moving = launched("driven ball", (HUB, BODY), (HINGE, BALL), drivers=(Driver(joint="J", turn=TURNS),))
    hub, body = moving.body  # the driver determines the motion of the body relative to the hub
    return moving.with_(body=(hub, replaced(body, velocity=None, angular_velocity=None)))


def wheel() -> Scene:
    """Return a leaning disc that rolls down a plane without slip."""
    body = Body(name="disc", mass=1.5, inertia=(0.02, 0.01, 0.01), position=(0.0, 0.0, 0.2))
    anchor, axis, normal = body.position, (1.0, 0.2, 0.3), (0.0, 0.1, 1.0)
    floor = Rolling(name="J", bodies=("ground", "disc"), anchor=anchor, axis=axis, normal=normal, radius=0.2)
    return Scene(name="wheel", gravity=GRAVITY, duration=DURATION, body=(body,), joint=(floor,))


def event_probes() -> dict[str, Scene]:
    """Return two bodies that meet an end stop, an interval of a joint, a latch, and a rope that breaks."""
    stopped = replaced(HINGE, stop={"lower": -0.12, "restitution": 0.6})
    rod = Distance(name="rod", bodies=("hub", "body"), anchors=((-0.3, 0.6, 0.0), (0.4, -0.1, 0.1)))
    rope = Distance(name="rope", bodies=("ground", "body"), anchors=((0.9, -0.6, 0.4), (0.4, -0.1, 0.1)))
    # kinds of probes with the joints that hold at the start, and the joints with their events
    kinds = {
        "end stop": ((HINGE, BALL), (stopped, BALL)),
        "interval": ((HINGE,), (HINGE, replaced(BALL, active=[[0.06, 0.13]]))),
        "latch": (
            hung := (HINGE, between(JOINTS["revolute"])),
            (*hung, replaced(rod, when={"joint": "H", "reaches": -0.1})),
        ),
        "breaking rope": ((HINGE, BALL, rope), (HINGE, BALL, replaced(rope, release={"force": 30.0}))),
    }
    return {
        name: launched(name, (HUB, BODY), held).with_(joint=joints) for name, (held, joints) in kinds.items()
    }
