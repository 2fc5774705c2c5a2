"""Scenes in other units of length, time and mass; their motions are the converted ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from crosscheck.conformance.changes.copies import mapped, replaced
from mbref.scene import Coupling, Scene, TimeFunction
from mbref.scene.joints import DISPLACEMENT

Function = TypeVar("Function", bound=TimeFunction)


def times(factor: float) -> Callable[[Any], Any]:
    """Return the function that multiplies by a factor."""
    return lambda value: factor * np.asarray(value)


def scaled(scene: Scene, factor: float) -> Scene:
    """Return the scene with masses, inertias, armatures, forces, stiffnesses and dampings times a factor; its
    motion is unchanged."""

    fields = dict.fromkeys(
        ("mass", "inertia", "armature", "force", "moment", "torque", "stiffness", "damping"), times(factor)
    )
    return scene.with_(
        body=tuple(mapped(body, fields) for body in scene.body),
        joint=tuple(mapped(joint, fields) for joint in scene.joint),
        load=tuple(mapped(load, fields) for load in scene.load),
    )


def in_other_units(scene: Scene, length: float, time: float) -> Scene:
    """Return the scene with lengths and times multiplied, and all other numbers converted according to their
    units; masses are unchanged."""
    speed, push = length / time, length / time**2

    places = dict.fromkeys(
        ("position", "anchor", "anchors", "point", "points", "natural_length", "natural_displacement"),
        times(length),
    )
    bodies = {
        **places,
        "velocity": times(speed),
        "angular_velocity": times(1 / time),
        "inertia": times(length**2),
    }
    moments = dict.fromkeys(("moment", "torque"), times(length * push))
    loads = {**places, **moments, "force": times(push), "factor": lambda factor: _slower(factor, 1.0, time)}
    linear = {"stiffness": times(1 / time**2), "damping": times(1 / time)}
    turning = {"stiffness": times(length * push), "damping": times(length * speed)}
    sliding = {**places, "stop": lambda stop: mapped(stop, dict.fromkeys(("lower", "upper"), times(length)))}
    slides = {joint.name for joint in scene.joint if joint.facts.driven == "displacement"}
    return scene.with_(
        gravity=times(push)(scene.gravity).tolist(),
        duration=scene.duration * time,
        body=tuple(mapped(body, bodies) for body in scene.body),
        joint=tuple(
            mapped(joint, sliding if joint.name in slides else {**places, "armature": times(length**2)})
            for joint in scene.joint
        ),
        coupling=tuple(_coupled_in_lengths(scene, coupling, length) for coupling in scene.coupling),
        driver=tuple(_slower(d, length if d.joint in slides else 1.0, time) for d in scene.driver),
        load=tuple(
            mapped(x, {**loads, **(turning if x.type in ("torsion_spring", "rotational_damper") else linear)})
            for x in scene.load
        ),
    )


def _coupled_in_lengths(scene: Scene, coupling: Coupling, length: float) -> Coupling:
    """Return a coupling whose displacements are multiplied by a length."""
    ends = scene.coupled(coupling)
    return with_coordinates_times(coupling, [length if kind == DISPLACEMENT else 1.0 for _, kind in ends])


def with_coordinates_times(coupling: Coupling, sizes: Sequence[float]) -> Coupling:
    """Return a coupling whose coordinates are multiplied by factors."""
    last = sizes[-1]
    if coupling.polynomial is not None:
        law = tuple(last / sizes[0] ** k * each for k, each in enumerate(coupling.polynomial, 1))
        return mapped(coupling, {"polynomial": lambda _: law, "offset": times(last)})
    if coupling.ratios is None:
        return mapped(coupling, {"ratio": times(last / sizes[0]), "offset": times(last)})
    ratios = tuple(last / size * ratio for size, ratio in zip(sizes, coupling.ratios, strict=True))
    return mapped(coupling, {"ratios": lambda _: ratios, "offset": times(last)})


def _slower(function: Function, amount: float, time: float) -> Function:
    """Return a function of time with its values and its times multiplied by factors."""
    fields = {
        "polynomial": lambda c: tuple(amount * x / time**k for k, x in enumerate(c)),
        "sine": lambda sine: replaced(
            sine, amplitude=amount * sine.amplitude, frequency=sine.frequency / time
        ),
        "table": lambda rows: tuple((time * t, amount * x) for t, x in rows),
        "start": times(time),
        "stop": times(time),
    }
    return mapped(function, fields)
