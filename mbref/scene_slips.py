"""Numbers of a scene that are valid and yet probably slips: degrees for radians, millimetres for metres."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from mbref.scene import GROUND, Scene

TURN = 2 * math.pi
QUARTER = 90  # of which round numbers of degrees are multiples
APART = 300.0  # times the next shorter length: one in millimetres is not always the longest
GYRATION = 30.0  # radius of gyration over the mechanism's length
STRONGEST = 100.0  # m/s², of gravity


def probable_slips(scene: Scene) -> list[str]:
    """One sentence for each, under the path of the field."""
    return [*_angles(scene), *_lengths(scene), *_inertias(scene), *_gravity(scene)]


def link_lengths(scene: Scene) -> dict[str, dict[str, float]]:
    """Distances (m) between the joints of each body, ``{"rod": {"A–B": 0.5}}``; the ground's too."""
    found: dict[str, dict[str, float]] = {}
    for name in [*(body.name for body in scene.body), GROUND]:
        ends = [
            (joint.name, joint.anchor_pair[joint.bodies.index(name)])
            for joint in scene.joint
            if name in joint.bodies
        ]
        found[name] = {f"{a}–{b}": math.dist(p, q) for k, (a, p) in enumerate(ends) for b, q in ends[k + 1 :]}
    return {name: lengths for name, lengths in found.items() if lengths}


def _angles(scene: Scene) -> Iterator[str]:
    for i, load in enumerate(scene.load):
        if load.type == "torsion_spring" and abs(load.natural_angle) > TURN:
            yield _degrees(f"load[{i}].natural_angle", load.natural_angle)
    for driver in scene.driver:
        path, sine = f"driver[{driver.joint}]", driver.sine
        turns = scene.joint_named(driver.joint).facts.driven == "angle"
        if sine and abs(sine.phase) > TURN:
            yield _degrees(f"{path}.sine.phase", sine.phase)
        if sine and turns and abs(sine.amplitude) > TURN:
            yield _degrees(f"{path}.sine.amplitude", sine.amplitude)
        rate = driver.polynomial[1] if len(driver.polynomial) > 1 else 0.0
        if turns and rate and rate % QUARTER == 0:
            yield f"{path}.polynomial: {rate:g} rad/s is {rate / TURN:.3g} turns a second; is it in degrees?"


def _degrees(path: str, angle: float) -> str:
    return f"{path}: {angle:g} rad is more than a turn; is it in degrees?"


def _lengths(scene: Scene) -> Iterator[str]:
    """A gap of a thousand between two neighbours among the lengths of links and guides."""
    every = sorted(
        (length, f"body[{body}]: {pair}")
        for body, lengths in link_lengths(scene).items()
        for pair, length in lengths.items()
        if length > 0
    )
    for (short, first), (long, second) in itertools.pairwise(every):
        if long >= APART * short:
            yield f"{second} is {long:g} m, {first.partition(': ')[2]} {short:g} m; is one in millimetres?"


def _inertias(scene: Scene) -> Iterator[str]:
    """Bodies whose radius of gyration is many times the mechanism."""
    size = _size(scene)
    for body in scene.body:
        if body.mass is None or body.inertia is None or size == 0:
            continue
        array = np.array(body.inertia)
        trace = float(array.sum() if array.ndim == 1 else np.trace(array))
        radius = math.sqrt(trace / 2 / body.mass)
        if radius > GYRATION * size:
            yield (
                f"body[{body.name}].inertia: suits a body {radius:.3g} m across, the mechanism measures "
                f"{size:.3g} m; is it in kg m²?"
            )


def _size(scene: Scene) -> float:
    """The extent of all anchors and centres of mass, m."""
    points = [body.position for body in scene.body]
    points += [anchor for joint in scene.joint for anchor in joint.anchor_pair]
    return float(np.ptp(np.array(points), axis=0).max())


def _gravity(scene: Scene) -> Iterator[str]:
    strength = math.hypot(*scene.gravity)
    if strength > STRONGEST:
        yield f"gravity: {strength:g} m/s² is {strength / 9.81:.3g} times the earth's; is it in mm/s²?"
