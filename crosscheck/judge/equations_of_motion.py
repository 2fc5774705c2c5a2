"""Terms of the equations of motion at a state by the judge's equations, each of which can be left out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from crosscheck.judge.constraints import (
    closure_accelerations,
    inertia_matrices,
    jacobian,
    joint_coordinates,
    scene_length,
)
from crosscheck.judge.coupling_laws import unwound
from crosscheck.judge.gauss_principle import of_least_constraint
from crosscheck.judge.joint_coordinates import Reflected, reflected
from crosscheck.judge.joint_loads import State, applied, turning_loads
from crosscheck.judge.loads import mass_matrix, world_inertia
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Load, Scene

GYRATION = "the gyroscopic moments ω × Jω"
GRAVITY = "gravity"


class Terms(NamedTuple):
    """The terms of a scene's equations at a state: M a = Σ f + Jᵀ λ, J a = γ.

    Mass matrix (6 nb, 6 nb) of the bodies, armatures, which add to M and f, forces (6 nb,) by name, rows
    (m, 6 nb) with the joint of each, and the parts of γ (m,) that velocities and drivers cause. By name of a
    spring, the field of its natural length or coordinate, and the part of its force that this causes.
    """

    mass: np.ndarray
    armatures: Reflected
    forces: Mapping[str, np.ndarray]
    rows: np.ndarray
    joints: tuple[str, ...]
    of_velocities: np.ndarray
    of_drivers: np.ndarray
    naturals: Mapping[str, tuple[str, np.ndarray]]


class Scaled(NamedTuple):
    """A term of the equations of motion, the part of an engine that computes it, and the terms with a
    multiple of it. An armature may be much larger than the inertia that it adds to: accelerations are then
    far from linear in its multiple."""

    part: str
    name: str
    times: Callable[[float], Terms]
    is_armature: bool = False


class Variant(NamedTuple):
    """Terms of the equations of motion of which one is changed, with the part of an engine that computes this
    term, and the change."""

    part: str
    change: str
    terms: Terms


# in order of dependence
PARTS = ("mass matrix", "gravity", "velocity terms", "loads", "constraints", "drivers")


def terms_at(scene: Scene, motion: Trajectory, sample: int) -> Terms:
    """Return the terms at a sample of a motion, whose first sample is less than half a turn from t = 0."""
    t, state = float(motion.times[sample]), _state(scene, motion, sample)
    position, orientation, velocity, spin, _ = state
    scene = unwound(scene, motion)[sample]
    rows, _ = jacobian(scene, t, position, orientation)
    still = np.zeros_like(position)
    driven = _residuals(scene, t, position, orientation, still, still)
    moved = _residuals(scene, t, position, orientation, velocity, spin)
    names = tuple(
        name
        for name, found in closure_accelerations(scene, t, position, orientation, *[still] * 4).items()
        for _ in found
    )
    mass = mass_matrix(scene, world_inertia(scene, rotations.to_matrix(orientation)))
    forces, naturals = _forces(scene, t, state)
    geared = reflected(scene, *state[:4])
    return Terms(mass, geared, forces, rows, names, driven - moved, -driven, naturals)


def accelerations(scene: Scene, terms: Terms) -> np.ndarray:
    """Return the accelerations (6 nb,) that the terms give, by Gauss's principle; angular accelerations times
    the scene's length."""
    weights = np.tile(np.repeat([1.0, 1 / scene_length(scene)], 3), len(scene.body))
    force = np.sum(list(terms.forces.values()), axis=0) + terms.armatures.force
    gamma = terms.of_velocities + terms.of_drivers
    return of_least_constraint(terms.mass + terms.armatures.mass, force, terms.rows, -gamma, weights)


def variants(scene: Scene, orientation: np.ndarray, terms: Terms) -> Iterator[Variant]:
    """Yield variants of the terms at orientations (nb, 4): inertias about other axes, or without a joint's
    rows."""
    own, turn = inertia_matrices(scene), rotations.to_matrix(orientation)
    diagonal = np.array([np.diag(np.diag(matrix)) for matrix in own])
    back = np.swapaxes(turn, 1, 2)
    others = {
        "inertias not turned from body to world axes": own,
        "inertias turned the wrong way, Rᵀ J R for R J Rᵀ": back @ own @ turn,
        "products of inertia left out": turn @ diagonal @ back,
    }
    for change, inertia in others.items():
        yield Variant(PARTS[0], change, terms._replace(mass=mass_matrix(scene, inertia)))
    for joint in dict.fromkeys(terms.joints):
        kept = np.array([name != joint for name in terms.joints])
        rows = {key: getattr(terms, key)[kept] for key in ("rows", "of_velocities", "of_drivers")}
        names = tuple(name for name in terms.joints if name != joint)
        kind = "coupling" if any(coupling.name == joint for coupling in scene.coupling) else "joint"
        yield Variant(PARTS[4], f"{kind} {joint!r} left out", terms._replace(joints=names, **rows))


def scaled_terms(scene: Scene, terms: Terms) -> Iterator[Scaled]:
    """Yield each term for multiples of it: forces, parts of γ, armatures, and mass and inertia of a body,
    with the gravity and gyroscopic moment that they cause."""
    for name in terms.forces:
        part = {GRAVITY: PARTS[1], GYRATION: PARTS[2]}.get(name, PARTS[3])
        yield Scaled(part, name, partial(_with_forces, terms, {name}))
    for kind in dict.fromkeys(load.type for load in scene.load):
        names = {_name(k, load) for k, load in enumerate(scene.load) if load.type == kind}
        yield Scaled(PARTS[3], f"every {kind}", partial(_with_forces, terms, names))
    for load, (field, _) in terms.naturals.items():
        yield Scaled(
            PARTS[3], f"the {field.replace('_', ' ')} of {load}", partial(_with_natural, terms, load)
        )
    for part, name, field in (
        (PARTS[2], "the velocity part of γ in J a = γ", "of_velocities"),
        (PARTS[5], "the drivers' accelerations in γ", "of_drivers"),
    ):
        yield Scaled(part, name, partial(_with_multiple, terms, field, True))
    for coupling in scene.coupling:
        rows = np.array([name == coupling.name for name in terms.joints])
        name = f"the velocity part of γ of coupling {coupling.name!r}"
        yield Scaled(PARTS[2], name, partial(_with_multiple, terms, "of_velocities", rows))
    for k, joint in enumerate(terms.armatures.joints):
        times = partial(_with_armature, terms, k)
        yield Scaled(PARTS[0], f"the armature of joint {joint!r}", times, is_armature=True)
    places = [(f"body {body.name!r}", slice(b, b + 1)) for b, body in enumerate(scene.body)]
    for whose, bodies in [*places, ("every body", slice(None))]:
        for name, half, force in (("mass", slice(0, 3), GRAVITY), ("inertia", slice(3, 6), GYRATION)):
            chosen = np.zeros((len(scene.body), 6), dtype=bool)
            chosen[bodies, half] = True
            yield Scaled(
                PARTS[0], f"the {name} of {whose}", partial(_with_inertia, terms, chosen.ravel(), force)
            )


def _with_forces(terms: Terms, names: Collection[str], factor: float) -> Terms:
    multiples = {name: factor * terms.forces[name] for name in names}
    return terms._replace(forces={**terms.forces, **multiples})


def _with_multiple(terms: Terms, field: str, rows: np.ndarray | bool, factor: float) -> Terms:
    return terms._replace(**{field: np.where(rows, factor, 1.0) * getattr(terms, field)})


def _with_natural(terms: Terms, load: str, factor: float) -> Terms:
    _, part = terms.naturals[load]
    return terms._replace(forces={**terms.forces, load: terms.forces[load] + (factor - 1.0) * part})


def _with_armature(terms: Terms, place: int, factor: float) -> Terms:
    inertia = terms.armatures.inertia.copy()
    inertia[place] *= factor
    return terms._replace(armatures=replace(terms.armatures, inertia=inertia))


def _with_inertia(terms: Terms, chosen: np.ndarray, name: str, factor: float) -> Terms:
    """Return the terms with a multiple of chosen rows of the mass matrix and of a force that it causes."""
    multiple = np.where(chosen, factor, 1.0)
    forces = {**terms.forces, name: multiple * terms.forces[name]}
    return terms._replace(mass=multiple[:, None] * terms.mass, forces=forces)


def _state(scene: Scene, motion: Trajectory, sample: int) -> State:
    """Return the state at a sample, with the angles of loads about joints' axes."""
    place = motion.position[sample], motion.orientation[sample]
    whole = motion.times, motion.position, motion.orientation, motion.angular_velocity
    coordinates = joint_coordinates(scene, *whole, motion.angles)
    angles = [coordinates[load.joint][sample, 0] for load in turning_loads(scene)]
    return *place, motion.velocity[sample], motion.angular_velocity[sample], np.array(angles)


def _residuals(
    scene: Scene,
    t: float,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    spin: np.ndarray,
) -> np.ndarray:
    """Return the acceleration residuals (m,) of bodies without acceleration."""
    still = np.zeros_like(position)
    found = closure_accelerations(scene, t, position, orientation, velocity, spin, still, still)
    return np.concatenate([np.zeros(0), *found.values()])


def _forces(
    scene: Scene, t: float, state: State
) -> tuple[dict[str, np.ndarray], dict[str, tuple[str, np.ndarray]]]:
    """Return forces and moments (6 nb,) by name: gravity, gyroscopic moments, each load and each damper; and
    the ``naturals`` of the terms."""
    bare = scene.with_(load=[], gravity=(0.0, 0.0, 0.0))
    plain = (*state[:4], np.zeros(0))
    gyroscopic = applied(bare, t, plain).ravel()
    found = {GRAVITY: applied(scene.with_(load=[]), t, plain).ravel() - gyroscopic, GYRATION: gyroscopic}
    naturals: dict[str, tuple[str, np.ndarray]] = {}
    springs = 0
    for k, load in enumerate(scene.load):
        turns = len(turning_loads(bare.with_(load=[load])))
        angles = state[4][springs : springs + turns]
        springs += turns
        own = (*state[:4], angles)
        name = _name(k, load)
        force = applied(bare.with_(load=[load]), t, own).ravel() - gyroscopic
        found[name] = force  # before its damping, which one state may not tell from it
        undamped = load.model_copy(update={"damping": 0.0}) if load.is_damped else load
        if load.is_damped:
            elastic = applied(bare.with_(load=[undamped]), t, own).ravel() - gyroscopic
            found |= {name: elastic, f"the damping of {name}": force - elastic}
        for field in (field for field in type(load).model_fields if field.startswith("natural_")):
            natural = undamped.model_copy(update={field: 0.0})
            without = applied(bare.with_(load=[natural]), t, own).ravel() - gyroscopic
            naturals[name] = field, found[name] - without
    return found, naturals


def _name(place: int, load: Load) -> str:
    """Return the name of a load, such as ``load[0] (moment on 'rod')``."""
    acting = getattr(load, load.acts_on)
    where = {
        "body": f"on {acting!r}",
        "joint": f"at {acting!r}",
        "bodies": f"between {' and '.join(map(repr, acting))}",
    }
    return f"load[{place}] ({load.type} {where[load.acts_on]})"
