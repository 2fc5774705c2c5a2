"""Mechanisms on which derivatives of engines are compared if no scene is given."""

from __future__ import annotations

from pathlib import Path

from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from mbref.scene import Scene
from mbref.scenes import find_scene

FINDINGS = Path(__file__).parents[1] / "findings"
FILES = ("ball_four_bar", "hinged_four_bar", "bennett")  # a point closure, planar and spatial welds
SEEDS = (0, 2)  # of spatial mechanisms with joints of several freedoms, and with a point closure


def mechanisms() -> list[Scene]:
    """Return moving mechanisms with loops that point closures and welds close, redundant ones included."""
    files = [find_scene(str(FINDINGS / f"{name}.toml")) for name in FILES]
    return [*files, *(random_mechanism(seed) for seed in SEEDS)]
