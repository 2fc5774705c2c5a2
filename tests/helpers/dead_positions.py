"""Slider-cranks whose drivers come to a dead position, with its time in closed form."""

import math

from mbref.scene import Scene
from tests.helpers.parts import Entry, Point, hinge, slide


def pushed(crank: float, rod: float, angle: float, speed: float, size: float = 1.0) -> tuple[Scene, float]:
    """Return a slider-crank whose slider is driven outwards, and the time (s) of crank and rod in line.
    ``crank`` and ``rod`` are lengths and ``speed`` a length per second in units of ``size`` (m); ``angle``
    (rad) is the crank's at the start."""
    a, b = crank * size, rod * size
    tilt = -math.asin(crank * math.sin(angle) / rod)
    pin = (a * math.cos(angle), a * math.sin(angle), 0.0)
    slider = (pin[0] + b * math.cos(tilt), 0.0, 0.0)
    bars = _link("crank", (0.0, 0.0, 0.0), pin, angle, size), _link("rod", pin, slider, tilt, size)
    bodies = [*bars, _link("slider", slider, slider, 0.0, size)]
    turns = hinge("O", "ground", "crank", (0.0, 0.0, 0.0)), hinge("P", "crank", "rod", pin)
    joints = [*turns, hinge("Q", "rod", "slider", slider), slide("S", "ground", "slider", slider)]
    duration = 4.0 * (a + b - slider[0]) / (speed * size)
    driver = {"joint": "S", "polynomial": [0.0, speed * size]}
    scene = Scene(name="pushed", duration=duration, body=bodies, joint=joints, driver=[driver])
    return scene, (a + b - slider[0]) / (speed * size)


def turned(crank: float, rod: float, angle: float, speed: float) -> tuple[Scene, float]:
    """Return a slider-crank whose crank is driven and longer than its rod, and its dead time (s). The rod is
    then perpendicular to the slider's line. Units are m, rad and rad/s."""
    scene, _ = pushed(crank, rod, angle, 1.0)
    time = (math.asin(rod / crank) - angle) / speed
    return scene.with_(driver=[{"joint": "O", "polynomial": [0.0, speed]}], duration=3.0 * time), time


def _link(name: str, begin: Point, end: Point, angle: float, size: float) -> Entry:
    return {
        "name": name,
        "mass": 1.0,
        "inertia": [0.01 * size**2] * 3,
        "position": [(p + q) / 2 for p, q in zip(begin, end, strict=True)],
        "orientation": [math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)],
    }
