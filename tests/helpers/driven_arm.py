"""A mechanism that two drivers move, and the settings with which every engine runs it."""

import math
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest

from crosscheck.engine import BUILT_IN, ON_REQUEST, OPTIONAL, Setting, engine, installed
from mbref.scene import Body, Driver, Revolute, Scene, Sine, Translational

END = 0.1  # s
COMPILING = ("mjx", "warp", "newton")  # compile code for each scene
WHOLE, PYTHON, CXX = "all families", "families in Python", "families in C++"
ENGINES = [  # names and parts; Pinocchio's C++ library takes a minute to compile
    pytest.param(name, part, marks=[pytest.mark.slow] * (name in COMPILING or part == CXX))
    for name in BUILT_IN + OPTIONAL + ON_REQUEST
    if installed(name)
    for part in ((PYTHON, CXX) if name == "pinocchio" else (WHOLE,))
]


class Wave(NamedTuple):
    """amplitude · (sin(frequency t + phase) - sin(phase))"""

    amplitude: float
    frequency: float
    phase: float

    def driver(self, joint: str) -> Driver:
        """The driver of a joint with this motion."""
        sine = Sine(amplitude=self.amplitude, frequency=self.frequency, phase=self.phase)
        return Driver(joint=joint, polynomial=(-self.amplitude * math.sin(self.phase),), sine=sine)

    def value(self, t: np.ndarray) -> np.ndarray:
        """The prescribed coordinate."""
        return self.amplitude * (np.sin(self.frequency * t + self.phase) - math.sin(self.phase))

    def rate(self, t: np.ndarray) -> np.ndarray:
        """Its first derivative."""
        return self.amplitude * self.frequency * np.cos(self.frequency * t + self.phase)


TURN, SLIDE = Wave(0.3, 5.0, 0.4), Wave(0.08, 9.0, -1.1)


def driven_arm(**parts: Any) -> Scene:
    """An arm that turns about z at the origin, and a block that slides along the arm from x = 1 m."""
    arm = Body(name="arm", mass=1.0, inertia=(0.01, 0.09, 0.09), position=(0.5, 0.0, 0.0))
    block = Body(name="block", mass=0.4, inertia=(0.02, 0.03, 0.04), position=(1.0, 0.0, 0.0))
    hinge = Revolute(name="hinge", bodies=("ground", "arm"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    rail = Translational(name="rail", bodies=("arm", "block"), anchor=(1.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    given = {"driver": (TURN.driver("hinge"), SLIDE.driver("rail")), **parts}
    given |= {"body": (arm, block), "joint": (hinge, rail)}
    return Scene(name="arm", gravity=(0.0, -9.81, 0.0), duration=END, **given)


def able(name: str, *scenes: Scene) -> Scene:
    """The first scene that an engine can simulate; the test is skipped if there is none."""
    if name == "casadi" and "opensim" in sys.modules:
        pytest.skip("OpenSim has loaded a CasADi library of its own into this process")
    reasons = [engine(name).cannot(scene) for scene in scenes]
    if None not in reasons:
        pytest.skip("; ".join(map(str, reasons)))
    return scenes[reasons.index(None)]


def coarsest(name: str, scene: Scene, part: str) -> list[Setting]:
    """The first setting of each family of an engine's part."""
    return [settings[0] for settings in _families(name, scene, part)]


def middle(name: str, scene: Scene, part: str) -> list[Setting]:
    """The middle setting of each family of an engine's part."""
    return [settings[len(settings) // 2] for settings in _families(name, scene, part)]


def _families(name: str, scene: Scene, part: str) -> list[list[Setting]]:
    families: dict[str, list[Setting]] = {}
    for setting in engine(name).settings(scene):
        if part == WHOLE or (part == CXX) == setting.family.endswith("compiled"):
            families.setdefault(setting.family, []).append(setting)
    assert families, "no family is tested"
    engine(name).prepare(list(families))
    return list(families.values())
