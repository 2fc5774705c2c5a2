"""Valid numbers of a scene that are probably mistakes: other units, a misdirected axis, missing joints."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from mbref import rotations
from mbref.scene.fields import COINCIDENT
from mbref.scene.functions import TimeFunction
from mbref.scene.references import GROUND
from mbref.scene.scene import Scene

TURN = 2 * math.pi
QUARTER = 90  # degrees; likely angles are multiples of it
# ratio of neighbouring lengths in a sorted list above which one of them is probably in millimetres
OTHER_UNIT = 300.0
GYRATION = 30.0  # largest plausible radius of gyration / length of the mechanism
STRONGEST = 100.0  # m/s²; largest plausible gravity
FURTHEST = 100.0  # rad; largest plausible angle of a driver (16 turns; an angle in degrees is usually larger)
DECIMALS = 3  # of an angle in degrees that a user writes
DEGREE_ROUNDING = 1e-15  # relative error of an angle in degrees after the change to radians and back
INSTANTS = 101  # number of times at which a driver's value is computed
# distance of a point from a plane / size of the mechanism that counts as zero; also cosine of a right angle
FLAT_MECHANISM = 1e-6


def probable_slips(scene: Scene) -> list[str]:
    """Return one sentence for each probable mistake, under the path of the field."""
    found = (_angles, _lengths, _inertias, _gravity, _axes, _no_joints, _far_drivers)
    return [sentence for each in found for sentence in each(scene)]


def link_lengths(scene: Scene) -> dict[str, dict[str, float]]:
    """Return distances (m) between the joints of each body and of the ground: ``{"rod": {"A–B": 0.5}}``."""
    ends: dict[str, list[tuple[str, Sequence[float]]]]
    ends = {name: [] for name in (*(body.name for body in scene.body), GROUND)}
    for joint in scene.joint:
        for name, anchor in zip(joint.bodies, joint.anchor_pair, strict=True):
            ends[name].append((joint.name, anchor))
    found = {
        name: {f"{a}–{b}": math.dist(p, q) for (a, p), (b, q) in itertools.combinations(of_body, 2)}
        for name, of_body in ends.items()
    }
    return {name: lengths for name, lengths in found.items() if lengths}


def _prescribed(scene: Scene) -> Iterator[tuple[str, TimeFunction, bool]]:
    """Yield path and function of each driver and turn, and whether the function is an angle."""
    for driver in scene.driver:
        turns = scene.joint_named(driver.joint).facts.driven != "displacement"
        path = f"driver[{driver.joint}]"
        for k, function in enumerate(driver.turn or (driver,)):
            yield f"{path}.turn[{k}]" if driver.turn else path, function, turns


def _angles(scene: Scene) -> Iterator[str]:
    for i, load in enumerate(scene.load):
        if load.type == "torsion_spring" and _may_be_degrees(load.natural_angle):
            yield _degrees(f"load[{i}].natural_angle", load.natural_angle)
    for path, function, turns in _prescribed(scene):
        sine = function.sine
        if sine and _may_be_degrees(sine.phase):
            yield _degrees(f"{path}.sine.phase", sine.phase)
        if sine and turns and _may_be_degrees(sine.amplitude):
            yield _degrees(f"{path}.sine.amplitude", sine.amplitude)
        rate = function.coefficients[1] if len(function.coefficients) > 1 else 0.0
        if turns and rate and rate % QUARTER == 0:
            yield f"{path}.polynomial: {rate:g} rad/s is {rate / TURN:.3g} turns a second; is it in degrees?"


def _may_be_degrees(angle: float) -> bool:
    """Return whether an angle (rad) is more than a turn, and was not given with the unit deg or rev."""
    return abs(angle) > TURN and not _is_round(math.degrees(angle))


def _is_round(angle: float) -> bool:
    """Return whether an angle (degrees) has few decimals."""
    return abs(angle - round(angle, DECIMALS)) <= DEGREE_ROUNDING * abs(angle)


def _degrees(path: str, angle: float) -> str:
    return f"{path}: {angle:g} rad is more than a turn; is it in degrees?"


def _lengths(scene: Scene) -> Iterator[str]:
    """Yield lengths of links and guides that are 300 times as large as the next smaller one."""
    every = sorted(
        (length, f"body[{body}]: {pair}")
        for body, lengths in link_lengths(scene).items()
        for pair, length in lengths.items()
        if length > 0
    )
    for (short, first), (long, second) in itertools.pairwise(every):
        if long >= OTHER_UNIT * short:
            yield f"{second} is {long:g} m, {first.partition(': ')[2]} {short:g} m; is one in millimetres?"


def _inertias(scene: Scene) -> Iterator[str]:
    """Yield bodies whose radius of gyration is many times the size of the mechanism."""
    size, coincident = _size(scene), COINCIDENT * np.abs(_points(scene)).max()
    for body in scene.body:
        if not body.mass or body.inertia is None or size <= coincident:
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
    """Return the extent of all anchors and centres of mass, m."""
    return float(np.ptp(np.array(_points(scene)), axis=0).max())


def _points(scene: Scene) -> list[tuple[float, float, float]]:
    """Return all anchors and centres of mass."""
    points = [body.position for body in scene.body]
    return points + [anchor for joint in scene.joint for anchor in joint.anchor_pair]


def _gravity(scene: Scene) -> Iterator[str]:
    strength = math.hypot(*scene.gravity)
    if strength > STRONGEST:
        yield f"gravity: {strength:g} m/s² is {strength / 9.81:.3g} times the earth's; is it in mm/s²?"


def _axes(scene: Scene) -> Iterator[str]:
    """Yield hinges in loops with axes in the plane of a mechanism, if most hinges have axes normal to it."""
    hinges = [
        (joint.name, rotations.unit(joint.directions[0])) for joint in scene.joint if joint.type == "revolute"
    ]
    for normal in [axis for _, axis in hinges[:2]]:
        turned = [abs(float(axis @ normal)) for _, axis in hinges]
        across, inside = (sum(map(test, turned)) for test in (_is_one, _is_zero))
        if inside and across > inside and across + inside == len(hinges) and _is_flat(scene, normal):
            for (name, _), cosine in zip(hinges, turned, strict=True):
                if _is_zero(cosine) and _is_in_loop(scene, name):
                    yield f"joint[{name}].axis: lies in the plane of the mechanism; other axes are across it"
            return


def _is_in_loop(scene: Scene, name: str) -> bool:
    """Return whether other joints also connect the bodies of a joint."""
    others = [joint.bodies for joint in scene.joint if joint.name != name]
    reached, last = {scene.joint_named(name).bodies[0]}, 0
    while len(reached) > last:
        last = len(reached)
        reached |= {body for pair in others if reached & set(pair) for body in pair}
    return scene.joint_named(name).bodies[1] in reached


def _is_one(cosine: float) -> bool:
    return cosine > 1 - FLAT_MECHANISM


def _is_zero(cosine: float) -> bool:
    return cosine < FLAT_MECHANISM


def _is_flat(scene: Scene, normal: np.ndarray) -> bool:
    """Return whether anchors and centres of mass lie in one plane normal to a direction."""
    heights = np.array(_points(scene)) @ normal
    return float(np.ptp(heights)) <= FLAT_MECHANISM * _size(scene)


def _no_joints(scene: Scene) -> Iterator[str]:
    if not scene.joint:
        names = ", ".join(body.name for body in scene.body)
        yield f"joint: there is none, so nothing connects {names}"


def _far_drivers(scene: Scene) -> Iterator[str]:
    """Yield drivers that turn a joint by many turns before the end of the motion."""
    times = np.linspace(0.0, scene.duration, INSTANTS)
    for path, function, turns in _prescribed(scene):
        furthest = float(np.abs(function.values(times)).max())
        terms = function.coefficients
        has_unit = any(terms) and all(_is_round(math.degrees(c)) for c in terms)
        if turns and furthest > FURTHEST and not has_unit:
            yield (
                f"{path}.polynomial: turns the joint by {furthest:.4g} rad, "
                f"{furthest / TURN:.3g} turns, within {scene.duration:g} s; is it in degrees?"
            )
