"""Couplings as primitive equations between joint coordinates; rotors that represent armatures.

The armature I of a joint coordinate q has the kinetic energy ½ I q'².  An additional body (rotor) that
rotates about its centre of mass in the fixed frame models the armature; the coordinate of the rotor is
coupled with q with ratio 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from mbref.equations.joints import AXES, ORIGIN, Primitive, of_coordinate
from mbref.kernels.scene_layout import COUPLED_ANGLE, COUPLED_SLIDE
from mbref.scene import Body, Coupling, Joint, Revolute, Scene, Translational
from mbref.scene.joints import ANGLE, Coordinate


class Coupled(NamedTuple):
    """A row: the sum of polynomials of joint coordinates is zero; ``laws`` are coefficients of q, q², …"""

    name: str
    joints: tuple[Joint, ...]
    coordinates: tuple[Coordinate, ...]
    laws: tuple[tuple[float, ...], ...]


class Rotors(NamedTuple):
    """The bodies that represent armatures, the joints that carry them, and their couplings."""

    bodies: tuple[Body, ...] = ()
    joints: tuple[Joint, ...] = ()
    couplings: tuple[Coupled, ...] = ()


def rotors_of(scene: Scene, frame: str) -> Rotors:
    """Return the rotors of a scene, joined to the fixed frame with the given name; none without masses."""
    geared = [joint for joint in scene.joint if joint.reflected_inertia] if scene.has_mass() else []
    if not geared:
        return Rotors()
    names, length = _free_names(scene, geared), _extent(scene)
    found = [_rotor(*pair, frame, length) for pair in zip(geared, names, strict=True)]
    bodies, joints, couplings = zip(*found, strict=True)
    return Rotors(bodies, joints, couplings)


def _extent(scene: Scene) -> float:
    """Return the largest side of a box around all centres of mass and anchors (m), or 1."""
    points = [body.position for body in scene.body]
    points += [anchor for joint in scene.joint for anchor in joint.anchor_pair]
    return max(max(side) - min(side) for side in zip(*points, strict=True)) or 1.0


def _free_names(scene: Scene, joints: list[Joint]) -> Iterator[str]:
    """Return an unused name for the rotor of each joint."""
    taken = {entry.name for entries in (scene.body, scene.joint, scene.coupling) for entry in entries}
    for joint in joints:
        name = f"armature of {joint.name}"
        for _ in taken:
            if name in taken:
                name += "'"
        yield name


def _rotor(joint: Joint, name: str, frame: str, length: float) -> tuple[Body, Joint, Coupled]:
    """Return the rotor of a joint, the joint that carries it, and the row that couples both."""
    inertia, axis = joint.reflected_inertia, AXES[0]
    places: dict[str, Any] = {"bodies": (frame, name), "anchor": ORIGIN, "axis": axis}
    turns = joint.facts.driven == ANGLE
    mass = inertia / length**2 if turns else inertia
    moment = inertia if turns else inertia * length**2
    body = Body.model_construct(name=name, position=ORIGIN, mass=mass, inertia=(moment, moment, moment))
    kind = Revolute if turns else Translational
    held = kind.model_construct(name=name, type=kind.model_fields["type"].default, **places)
    coordinate = joint.facts.driven or ANGLE
    return body, held, Coupled(name, (joint, held), (coordinate, coordinate), ((-1.0,), (1.0,)))


def couplings_of(scene: Scene) -> tuple[Coupled, ...]:
    """Return the couplings of a scene, scaled such that the largest factor of a coordinate is one in size."""
    if not scene.coupling:
        return ()
    found, joints = [], {joint.name: joint for joint in scene.joint}
    for coupling in scene.coupling:
        ends = coupling.ends(tuple(joints[name] for name in coupling.joints))
        size = largest_factor(coupling)
        named, coordinates = zip(*ends, strict=True)
        laws = tuple(tuple(each / size for each in law) for law in coupling.laws)
        found.append(Coupled(coupling.name, named, coordinates, laws))
    return tuple(found)


def largest_factor(coupling: Coupling) -> float:
    """Return the size of the largest factor of a coupling, by which its row is divided."""
    return max(map(abs, coupling.factors))


def coordinate_primitives(coupled: Coupled) -> tuple[Primitive, ...]:
    """Return the primitives of a coupling, which share one row."""
    kinds, ends = (COUPLED_ANGLE, COUPLED_SLIDE), zip(*coupled[1:], strict=True)
    return tuple(of_coordinate(joint, name, kinds, law) for joint, name, law in ends)
