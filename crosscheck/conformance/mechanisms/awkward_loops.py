"""Random loops with numerical difficulties: skew cylindrical joints, rounded redundant rows, positions near
singular ones."""

from __future__ import annotations

import math

import numpy as np

from crosscheck.conformance.mechanisms.parts import (
    DOWN,
    Rng,
    direction,
    hinge,
    linkage,
    ring,
    rod,
    slider_crank,
    triple,
    turned,
    turning,
    turning_first,
)
from mbref.scene import (
    Driver,
    Force,
    Revolute,
    Scene,
)


# --- loops -------------------------------------------------------------------------------------------------
def rccc(rng: Rng) -> Scene:
    """Return a spatial four-link loop of a revolute and three cylindrical joints on skew axes."""
    points = np.array([(0, 0, 0), (0.1, 0.4, 0.1), (0.7, 0.6, -0.1), (0.8, 0.0, 0.0)])
    points += 0.05 * rng.normal(size=(4, 3))
    axes = [direction(rng) for _ in points]
    scene = ring(rng, "rccc", ("revolute", *("cylindrical",) * 3), axes, points)
    return turning_first(scene, 1.0 * axes[0])


def universal_loop(rng: Rng) -> Scene:
    """Return a spatial loop R-U-C-U-R of five links with two degrees of freedom."""
    points = np.array([(0, 0, 0), (0.1, 0.4, 0.1), (0.5, 0.6, -0.1), (0.9, 0.5, 0.1), (1.0, 0.0, 0.0)])
    points += 0.05 * rng.normal(size=(5, 3))
    axes = [direction(rng) for _ in points]
    kinds = ("revolute", "universal", "cylindrical", "universal", "revolute")
    return ring(rng, "universal_loop", kinds, axes, points).with_(duration=0.3)


def planar_loop(rng: Rng) -> Scene:
    """Return a loop of a revolute, a planar, a universal and a spherical joint, closed through the ground."""
    points = np.array([(0, 0, 0), (0.2, 0.4, 0.1), (0.7, 0.5, -0.1), (0.8, 0.0, 0.1)])
    points += 0.05 * rng.normal(size=(4, 3))
    axes = [direction(rng) for _ in points]
    scene = ring(rng, "planar_loop", ("revolute", "spherical", "universal", "planar"), axes, points)
    force = Force(body="link1", point=triple(points[2]), force=triple(5 * rng.normal(size=3)))
    return scene.with_(load=(force,), duration=0.3)


def rounded_door(rng: Rng) -> Scene:
    """Return a swinging door on five coaxial hinges whose axes are rounded, and a second door that hangs on
    the first door."""
    axis, out = direction(rng), direction(rng)
    frame = out - axis * (out @ axis)
    door = rod("door", 0 * frame, frame, rng)
    flap = rod("flap", frame, frame + 0.4 * direction(rng), rng)
    own = [triple(axis * s) for s in rng.uniform(-1, 1, 5)]
    other = [triple(frame + axis * s) for s in rng.uniform(-1, 1, 3)]
    hinges = [
        Revolute(name=f"H{k}", bodies=("ground", "door"), anchor=p, axis=triple(axis))
        for k, p in enumerate(own)
    ]
    hinges += [
        Revolute(name=f"F{k}", bodies=("door", "flap"), anchor=p, axis=triple(axis))
        for k, p in enumerate(other)
    ]
    base = Scene(name="rounded_door", gravity=DOWN, duration=2.0, body=(door, flap), joint=tuple(hinges))
    return turned(rng, turning_first(base, 3.0 * axis))


def rounded_platform(rng: Rng) -> Scene:
    """Return a platform on three parallel legs of equal length with hinges at both ends: planar loops with
    six or seven redundant rows, whose numbers are rounded."""
    up = np.array([math.sin(0.4), math.cos(0.4), 0.0]) * rng.uniform(0.4, 0.8)
    feet = [np.array([x, 0.0, z]) for x, z in zip((0.0, 0.5, 1.1), rng.uniform(-0.3, 0.3, 3), strict=True)]
    legs = [rod(f"leg{k}", foot, foot + up, rng) for k, foot in enumerate(feet)]
    top = rod("top", feet[0] + up, feet[2] + up, rng)
    pins = [hinge(f"L{k}", "ground", f"leg{k}", foot) for k, foot in enumerate(feet)]
    pins += [hinge(f"T{k}", f"leg{k}", "top", triple(foot + up)) for k, foot in enumerate(feet)]
    scene = Scene(
        name="rounded_platform", gravity=(0.0, -9.81, 0.0), duration=0.4, body=(*legs, top), joint=tuple(pins)
    )
    return turned(rng, scene)


# --- near singular positions ------------------------------------------------------------------------------
def pushed_dead_centre(rng: Rng) -> Scene:
    """Return a slider-crank that starts 1e-3 to 1e-6 rad from its dead centre with a given velocity of its
    slider."""
    angle = 10.0 ** rng.uniform(-6, -3)
    scene = slider_crank(angle, 0.3, 0.9).with_(name="pushed_dead_centre", duration=0.2)
    slider = scene.body[2].model_copy(update={"velocity": (-5.0 * angle, 0.0, 0.0)})
    return scene.with_(body=(*scene.body[:2], slider))


def nearly_folding(rng: Rng) -> Scene:
    """Return a slider-crank whose crank and rod differ in length by a fraction 1e-3 to 1e-5: the slider
    nearly stops at the crank's axis."""
    less = 1 - 10.0 ** rng.uniform(-5, -3)
    scene = slider_crank(1.2, 0.3 * less, 0.3).with_(name="nearly_folding", duration=0.4)
    return turning(scene, 6.0)


def nearly_parallel(rng: Rng) -> Scene:
    """Return a four-bar that passes its straight position at a distance of 1e-3 to 1e-5 of its size."""
    off = 10.0 ** rng.uniform(-5, -3)
    places = ((0.0, 0.0, 0.0), (0.3, 0.4, 0.0), (1.3, 0.4, 0.0), (1.0 + off, 0.0, 0.0))
    return turning(linkage("nearly_parallel", places), -4.0).with_(duration=0.6)


def two_straight(rng: Rng) -> Scene:
    """Return a parallelogram with sides in the ratio 5 : 3 : 4, exact in floating point, that turns through
    both straight positions."""
    base = linkage("two_straight", ((0, 0, 0), (0.375, 0.5, 0), (1.375, 0.5, 0), (1, 0, 0)))
    return turning(base, -float(rng.uniform(5.0, 9.0))).with_(duration=0.8)


def locking(rng: Rng) -> Scene:
    """Return a linkage with a driven crank that locks before the end of the simulation."""
    places = np.array([(0, 0, 0), (0.3, 0.4, 0), (0.8, 0.4, 0), (0.9, 0, 0)])
    places[:, :2] += 0.02 * rng.normal(size=(4, 2))
    scene = linkage("locking", [triple(p) for p in places])
    return scene.with_(driver=(Driver(joint="P0", polynomial=(0.0, -2.0)),), duration=3.0)
