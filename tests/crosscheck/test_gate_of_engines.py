"""The model-identity gate / engines on one scene with all kinds of loads, several joints and velocities."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from crosscheck.engine import Setting, engine, installed
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import in_scene_order
from crosscheck.judge.model_identity import _differences, gate_times
from crosscheck.processes.serve import run_once
from crosscheck.setting import best_family
from mbref.scene import (
    Body,
    Cylindrical,
    Force,
    JointForce,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    SlideSpring,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
)
from mbref.trajectory import Outcome, Trajectory

ENGINES = pytest.mark.parametrize("name", ["drake", "dart", "bullet", "mjx", "warp", "newton"])
pytestmark = pytest.mark.slow  # engines load for seconds, and the last three compile their code
INERTIA = ((0.02, 0.002, -0.001), (0.002, 0.03, 0.003), (-0.001, 0.003, 0.025))
BODIES = (
    Body(
        name="arm",
        mass=1.3,
        inertia=INERTIA,
        position=(0.5, 0.1, 0.0),
        velocity=(-0.2, 1.0, 0.0),
        angular_velocity=(0.0, 0.0, 2.0),
    ),
    Body(name="bob", mass=0.4, inertia=INERTIA, position=(1.0, -0.4, 0.1), velocity=(0.0, 2.0, 0.0)),
    Body(name="slider", mass=0.8, inertia=INERTIA, position=(0.0, 1.0, 0.3)),
    Body(name="wheel", mass=0.5, inertia=INERTIA, position=(0.2, 1.4, 0.2)),
    Body(
        name="free",
        mass=0.7,
        inertia=INERTIA,
        position=(-0.6, 0.3, 0.2),
        velocity=(0.3, -0.2, 0.5),
        angular_velocity=(1.0, 2.0, -1.5),
    ),
)
JOINTS = (
    Revolute(name="A", bodies=("ground", "arm"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),
    Spherical(name="B", bodies=("arm", "bob"), anchor=(1.0, 0.0, 0.0)),
    Translational(name="C", bodies=("ground", "slider"), anchor=(0.0, 1.0, 0.3), axis=(0.6, 0.8, 0.0)),
    Cylindrical(name="D", bodies=("slider", "wheel"), anchor=(0.1, 1.2, 0.2), axis=(0.0, 0.6, 0.8)),
)
ON_BODIES = (
    Moment(body="arm", moment=(0.3, 0.2, -0.4)),
    Force(body="bob", point=(1.0, -0.5, 0.2), force=(1.0, -2.0, 3.0)),
    Spring(
        bodies=("wheel", "free"),
        points=((0.3, 1.4, 0.1), (-0.5, 0.3, 0.2)),
        stiffness=30.0,
        damping=0.5,
        natural_length=1.0,
    ),
)
IN_JOINTS = (
    TorsionSpring(joint="A", stiffness=4.0, damping=0.3, natural_angle=0.4),
    JointTorque(joint="D", torque=0.7),
    SlideSpring(joint="D", stiffness=40.0, damping=0.8, natural_displacement=-0.1),
    JointForce(joint="C", force=-5.0),
)
# 2 s, so that velocities change by more than the rounding of single precision over the gate's 2 ms
SCENE = Scene(
    name="busy",
    gravity=(0.5, -9.81, 1.0),
    duration=2.0,
    body=BODIES,
    joint=JOINTS,
    load=ON_BODIES + IN_JOINTS,
)
START, CHANGE = 1e-7, 3e-4  # largest relative differences that single precision leaves
NEWTON = [Setting("lox, moreau", {"step": h, "alpha": 0.1}) for h in (2e-4, 1e-4)]


def scene_of(name: str) -> Scene:
    """The scene, without loads in joints for Newton, which refuses them."""
    return SCENE.with_(load=ON_BODIES) if name == "newton" else SCENE


@functools.cache
def short_run(name: str) -> Trajectory:
    """The run at the finest setting. Newton's velocities are off by a part of a step: two steps remove it."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    scene = scene_of(name)
    settings = NEWTON if name == "newton" else best_family(engine(name).settings(scene))[-1:]
    runs = [run_once(name, scene, gate_times(scene), setting) for setting in settings]
    assert all(run.outcome is Outcome.COMPLETED for run in runs), runs[-1].message
    if name != "newton":
        return runs[-1]
    velocities = ("velocity", "angular_velocity")
    return replace(runs[1], **{v: 2 * getattr(runs[1], v) - getattr(runs[0], v) for v in velocities})


def first_difference(name: str, scene: Scene) -> str:
    """The first quantity in which an engine's run differs from the exact motion of a scene."""
    exact = in_scene_order(scene, gauss_motion(scene, tuple(gate_times(scene))))
    for field, by, _ in _differences(scene, exact, in_scene_order(scene, short_run(name))):
        changes = "change" in field or "acceleration" in field
        if by > (CHANGE if changes else START):
            return field
    return ""


@ENGINES
def test_an_engine_has_the_model_the_start_and_the_loads_of_the_scene(name: str) -> None:
    assert first_difference(name, scene_of(name)) == ""


@ENGINES
def test_each_load_mass_and_velocity_counts(name: str) -> None:
    """The run differs from motions without a load, and with another mass, inertia or velocity."""
    scene = scene_of(name)
    for k in range(len(scene.load)):
        field = first_difference(name, scene.with_(load=scene.load[:k] + scene.load[k + 1 :]))
        assert field.startswith("change of"), (scene.load[k], field)
    for k, body in enumerate(scene.body):
        changes = [{"mass": 1.05 * body.mass}, {"inertia": 1.05 * np.array(body.inertia)}]
        for change in changes[:1] if body.name == "slider" else changes:  # which does not turn
            other = Body(**{**dict(body), **change})
            changed = scene.with_(body=(*scene.body[:k], other, *scene.body[k + 1 :]))
            assert first_difference(name, changed), (body.name, change)
    faster = Body(**{**dict(scene.body[-1]), "angular_velocity": (1.0, 2.0, -1.4)})
    assert "angular velocity" in first_difference(name, scene.with_(body=(*scene.body[:-1], faster)))
