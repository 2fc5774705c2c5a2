"""Bodies, joints and couplings of a scene's equations: the scene's own, rotors for armatures, and a modelled
ground."""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

from mbref.equations.couplings import Coupled, rotors_of
from mbref.equations.joints import ORIGIN
from mbref.scene import GROUND, Body, Fixed, Joint, Scene, TimeFunction
from mbref.scene.structure import refuse_intervals

# name of the frame to which a modelled ground and the rotors of armatures are joined
FRAME = "the fixed frame"


def shape_of(scene: Scene) -> Hashable:
    """Return everything of a scene except its numbers: scenes of equal shape are packed together."""
    return (
        scene.ground,
        tuple((body.name, body.inertia and isinstance(body.inertia[0], tuple)) for body in scene.body),
        tuple((j.name, j.type, j.bodies, j.reflected_inertia > 0.0) for j in scene.joint),
        tuple((each.name, each.joints, each.coordinates, each.powers) for each in scene.coupling),
        tuple((driver.joint, *map(_shape_of_function, driver.functions)) for driver in scene.driver),
        tuple(
            (load.type, getattr(load, load.acts_on), *_shape_of_function(load.over_time))
            for load in scene.load
        ),
    )


def _shape_of_function(function: TimeFunction | None) -> tuple[int, ...]:
    """Return the numbers of coefficients and of pieces; an empty result without a function."""
    return (len(function.coefficients), len(function.pieces())) if function else ()


class Parts(NamedTuple):
    """Bodies, joints and couplings of a scene's equations, in the order of the scene."""

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    couplings: tuple[Coupled, ...]  # couplings of armatures, which the scene does not list


def all_parts(scene: Scene) -> Parts:
    """Return bodies and joints of a scene, with a rotor for each armature, and the ground as a body with six
    rows if the scene requests it. Raises SceneError for constraints with intervals."""
    refuse_intervals(scene)
    rotors = rotors_of(scene, FRAME)
    bodies, joints = (*scene.body, *rotors.bodies), (*scene.joint, *rotors.joints)
    if scene.ground == "frame":
        return Parts(bodies, joints, rotors.couplings)
    inertia = (1.0, 1.0, 1.0) if scene.has_mass() else None
    body = Body(name=GROUND, position=ORIGIN, mass=1.0 if inertia else None, inertia=inertia)
    hold = Fixed.model_construct(name=GROUND, bodies=(FRAME, GROUND), anchor=ORIGIN, type="fixed")
    return Parts((*bodies, body), (*joints, hold), rotors.couplings)
