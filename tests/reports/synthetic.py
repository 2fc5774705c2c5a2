"""Records made without any engine: exact motions with errors of known size, and runs that fail."""

import dataclasses
import functools
import hashlib
from typing import Any

import numpy as np

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from crosscheck.study.truths import truth_record
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.scene import Scene
from mbref.scenes import SCENES
from reports.runs import SceneRuns, by_scene

MADE_OF = {
    "schema": 1,
    "time_limit": 60.0,
    "seed": 0,
    "versions": {"python": "3.x", "numpy": "2.x", "numba": None},
    "machine": {"cpu": "a processor", "cores": 2, "system": "a system"},
}


@functools.cache
def scene(name: str = "spatial_slider_crank") -> Scene:
    return SCENES[name]().with_(duration=0.02)


def exact(a_scene: Scene, samples: int = 13, share: float = 1.0) -> Trajectory:
    """The true motion up to a share of the duration."""
    times = np.linspace(0.0, a_scene.duration, samples)
    return truth_for(a_scene).poses(times[times <= share * a_scene.duration])


def record(
    engine: str,
    family: str,
    error: float,
    seconds: float,
    steps: int = 100,
    a_scene: Scene | None = None,
    outcome: Outcome = Outcome.COMPLETED,
    share: float = 1.0,
    **settings: Any,
) -> dict[str, Any]:
    """The record of a run that is shifted from the truth by ``error``, in scene lengths, at every sample."""
    a_scene = a_scene or scene()
    true = exact(a_scene, share=share)
    shift = np.array([error * scene_length(a_scene), 0.0, 0.0])
    said = "" if outcome is Outcome.COMPLETED else f"{outcome.sentence} | early\nindeed"
    run = {"engine": engine, "version": "1.0", "method": family, "settings": settings, "scene": a_scene.name}
    run |= {"outcome": outcome, "message": said, "t_end": share * a_scene.duration}
    run |= {"position": true.position + shift, "cost": Cost(seconds=seconds, steps=steps, rhs=4 * steps)}
    shifted = dataclasses.replace(true, **run)
    key = hashlib.sha256(f"{a_scene.name} {engine} {family} {settings} {error}".encode()).hexdigest()
    return stored(shifted, a_scene, asked(a_scene, engine, settings), key)


def stored(run: Trajectory, a_scene: Scene, asked: dict[str, Any], key: str) -> dict[str, Any]:
    """The record of a run as a study stores it, with its metrics."""
    known = {"scene": a_scene.name, "family": run.method, "asked": asked, "key": key}
    return {**MADE_OF, **run.to_record(), **known, "metrics": measure(a_scene, run, truth_for(a_scene))}


def asked(a_scene: Scene, engine: str, options: dict[str, Any]) -> dict[str, Any]:
    return {"engine": engine, "options": options, "samples": 13, "end": a_scene.duration}


def nothing(engine: str, family: str, a_scene: Scene | None = None) -> dict[str, Any]:
    """The record of a run that crashed without a state."""
    a_scene = a_scene or scene()
    run = {"scene": a_scene.name, "engine": engine, "version": "", "method": family, "settings": {}}
    end = {"outcome": Outcome.CRASHED, "message": "the process was ended by SIGSEGV"}
    lost = Trajectory.failed(**run, **end, bodies=tuple(b.name for b in a_scene.body))
    return stored(lost, a_scene, asked(a_scene, engine, {}), f"{engine} {family}")


@functools.cache
def records() -> tuple[dict[str, Any], ...]:
    """Two scenes: a method of order 3, a faster one of order 1, a wrong one, and three kinds of failure."""
    spatial, planar = scene(), scene("planar_slider_crank")
    orders = [
        *(
            record("mbref", "mpi-svd+projection", 1e-3 / 8**k, 0.01 * 2**k, 100 * 2**k, step=0.1 / 2**k)
            for k in range(3)
        ),
        *(record("mujoco", "tuned", 8e-3 / 2**k, 0.001 * 2**k, 50 * 2**k, step=0.1 / 2**k) for k in range(3)),
        record("mujoco", "defaults", 0.5, 0.0005, step=0.1),
    ]
    failures = [
        record("exudyn", "tuned", 1e-6, 0.02, outcome=Outcome.NOT_CONVERGED, share=0.5, step=0.1),
        record("exudyn", "tuned", 1e-7, 0.04, outcome=Outcome.NOT_CONVERGED, share=0.6, step=0.01),
        nothing("pinocchio", "defaults"),
    ]
    others = [record("mbref", "lm1+none", 1e-5, 0.01, a_scene=planar), nothing("exudyn", "defaults", planar)]
    assert spatial.name != planar.name
    return (*orders, *failures, *others)


@functools.cache
def truths() -> tuple[dict[str, Any], ...]:
    return tuple(truth_record(s, exact(s).times, 20.0) for s in (scene(), scene("planar_slider_crank")))


def motion() -> dict[str, Any]:
    """The true motion of the first scene at the instants shown, moved, as the wrong run's."""
    shown = truths()[0]["motion"]
    moved = {name: (np.array(body["position"]) + 0.1).tolist() for name, body in shown["bodies"].items()}
    bodies = {name: {**body, "position": moved[name]} for name, body in shown["bodies"].items()}
    return {**shown, "scene": scene().name, "engine": "mujoco", "family": "defaults", "bodies": bodies}


def groups() -> list[SceneRuns]:
    scenes = {s.name: s for s in (scene(), scene("planar_slider_crank"))}
    return by_scene(records(), scenes, (), truths(), [motion()])
