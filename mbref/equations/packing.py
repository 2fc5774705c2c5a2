"""Joints, drivers and loads of a scene as the arrays that kernels read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref.equations.joints import driver_primitive, primitives_of
from mbref.equations.joints.base import Primitive, Vector, frame
from mbref.equations.structure import Structure, structure_of
from mbref.kernels.named_memory import stacked
from mbref.kernels.scene_layout import FORCE, MOMENT, SPRING, TORSION_SPRING, Drivers, Loads, Primitives
from mbref.scene import Driver, Force, Joint, Load, Moment, SceneError, Sine, Spring, TorsionSpring

if TYPE_CHECKING:
    from mbref.equations.model import Model

AT_REST = Sine(amplitude=0.0, frequency=0.0, phase=0.0)


def packed_primitives(model: Model) -> tuple[Structure, Primitives]:
    """The structure of the constraint rows, and the primitives of all joints and drivers."""
    driven = {driver.joint: k for k, driver in enumerate(model.scene.driver)}
    listed = [(joint, primitive) for joint in model.joints for primitive in _of_joint(joint, driven)]
    structure = structure_of(
        model.nb,
        tuple(
            (p.kind, joint.name, *map(model.index, joint.bodies), driven[joint.name] if p.driven else -1)
            for joint, p in listed
        ),
    )
    vectors = np.array([_vectors(p) for _, p in listed], dtype=float).reshape(-1, 5, 3).swapaxes(0, 1)
    directions = model.directions(structure.of_directions, vectors[2:].reshape(-1, 3)).reshape(3, -1, 3)
    return structure, Primitives(
        kind=structure.kind,
        first=structure.first,
        second=structure.second,
        driver=structure.driver,
        row=structure.row,
        point_first=model.points(structure.first, vectors[0]),
        point_second=model.points(structure.second, vectors[1]),
        direction_first=directions[0],
        turning_first=directions[1],
        direction_second=directions[2],
        length=np.array([p.length for _, p in listed], dtype=float),
    )


def _vectors(p: Primitive) -> tuple[Vector, ...]:
    """Two points, then three directions, in the order of ``Structure.of_directions``."""
    return p.point_first, p.point_second, p.first, p.turning, p.second


def _of_joint(joint: Joint, driven: Mapping[str, int]) -> list[Primitive]:
    return [*primitives_of(joint), *([driver_primitive(joint)] if joint.name in driven else [])]


def packed_drivers(drivers: Sequence[Driver]) -> Drivers:
    """All drivers, their polynomials filled up with zeros to the highest degree."""
    terms = max((len(driver.polynomial) for driver in drivers), default=1)
    return stacked(Drivers, [_driver(driver, terms) for driver in drivers], {"terms": terms})


def _driver(driver: Driver, terms: int) -> Drivers:
    sine, polynomial = driver.sine or AT_REST, np.zeros(terms)
    polynomial[: len(driver.polynomial)] = driver.polynomial
    return Drivers(sine.amplitude, sine.frequency, sine.phase, polynomial)


def packed_loads(model: Model) -> Loads:
    """All loads of the model's scene; none where it has no masses."""
    loads, slots = [], 0
    for place, load in enumerate(() if model.kinematic else model.scene.load):
        fields = _fields(place, load, model)
        if isinstance(load, TorsionSpring):
            fields["angle"] = slots
            slots += 1
        loads.append(Loads(**{**_no_load(), **fields}))
    return stacked(Loads, loads)


def _fields(place: int, load: Load, model: Model) -> dict[str, Any]:
    """The fields of ``Loads`` that load[place] uses; SceneError for a type without equations."""
    if isinstance(load, Moment):
        return {"kind": MOMENT, "first": model.index(load.body), "force": load.moment}
    if isinstance(load, Force):
        acts_at = {"first": model.index(load.body), "point_first": model.point(load.body, load.point)}
        return {"kind": FORCE, "force": load.force, **acts_at}
    if isinstance(load, Spring):
        first, second = load.bodies
        return {
            **_constants(load, load.natural_length), "kind": SPRING,
            "first": model.index(first), "second": model.index(second),
            "point_first": model.point(first, load.points[0]),
            "point_second": model.point(second, load.points[1]),
        }  # fmt: skip
    if not isinstance(load, TorsionSpring):
        raise SceneError([f"load[{place}]: mbref has no equations for loads of type {load.type!r}"])
    joint = next(joint for joint in model.joints if joint.name == load.joint)
    first, second = joint.bodies
    x, y, z = frame(joint.axis)
    return {
        **_constants(load, load.natural_angle), "kind": TORSION_SPRING,
        "first": model.index(first), "second": model.index(second),
        "axis": model.direction(first, z), "x_first": model.direction(first, x),
        "y_first": model.direction(first, y), "x_second": model.direction(second, x),
    }  # fmt: skip


def _constants(load: Spring | TorsionSpring, natural: float) -> dict[str, float]:
    return {"stiffness": load.stiffness, "damping": load.damping, "natural": natural}


def _no_load() -> dict[str, Any]:
    """Zero for every field of ``Loads``, and no unwrapped angle."""
    numbers = dict.fromkeys(("kind", "first", "second", "stiffness", "damping", "natural"), 0)
    vectors = ("force", "point_first", "point_second", "axis", "x_first", "y_first", "x_second")
    return {**numbers, "angle": -1, **dict.fromkeys(vectors, (0.0, 0.0, 0.0))}
