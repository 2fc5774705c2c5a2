"""Stability ladders: a difficulty of a mechanism, such as a mass ratio, grows rung by rung. Each method and
engine runs on each rung of a ladder.

The exact motion of every rung is known in closed form.  Methods of mbref run at one tolerance, engines at a
fine setting of the family that suits singular positions best.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from crosscheck.engine import Setting
from crosscheck.judge.truth import Truth, closed_form
from crosscheck.study.grid import Case, Record, study
from crosscheck.study.progress import counted, shown
from crosscheck.study.search.offers import scout, settings, unasked
from mbref.scene import GROUND, Body, Driver, Revolute, Scene, Spring
from mbref.scenes.four_bar import four_bar, four_bar_gravity
from mbref.scenes.links import CRANK_RATE
from mbref.scenes.planar_slider_crank import slider_crank

FILE = "stability.jsonl"  # name of the file of records in a report's folder
RTOL = 1e-9
MOST_STEPS = 200_000  # allowed steps of a run for every 30 s of its time limit
SAMPLES = 21
TIME_LIMIT = 20.0  # CPU seconds of a run
METHODS = (
    "alf-dual+projection",
    "taylor",
    "mpi-svd+projection",
    "mpi-svd+partitioning",
    "mpi-svd+baumgarte",
    "mpi-svd+none",
    "mpi-gs+none",
    "alf+baumgarte",
    "lm1+baumgarte",
)
RANK_TOLERANCE = "rank_tolerance"  # name of the ladder whose rungs change an option of mbref's methods
FAMILIES = {"mujoco": "projected", "pinocchio": "tuned", "exudyn": "tuned"}
MBREF = "mbref"

Rung = tuple[float, Scene]  # difficulty and scene; the run ends at the scene's duration


class Ladder(NamedTuple):
    """A difficulty that grows: its name, a sentence, the label of its axis, and the rungs from easy to
    hard."""

    name: str
    words: str
    label: str
    rungs: Sequence[Rung]


def scene_name(ladder: str, difficulty: float) -> str:
    """Return the name of a rung's scene, such as ``gap[1e-05]``, by which its records are found."""
    return f"{ladder}[{difficulty:g}]"


def place(name: str) -> tuple[str, float]:
    """Return ladder and difficulty from the name of a rung's scene."""
    ladder, _, difficulty = name.removesuffix("]").partition("[")
    return ladder, float(difficulty)


def ladders() -> tuple[Ladder, ...]:
    """Return all ladders."""
    return (
        Ladder(
            "start",
            "A driven rhombus begins at a given distance before its flat position.",
            "distance, rad",
            [(d, four_bar(math.pi + d, "start").with_(duration=0.05)) for d in powers(-1, -14, 9)],
        ),
        Ladder(
            "turning_back",
            "A rhombus swings up, turns back at a given distance below its flat position, and falls.",
            "distance, rad",
            [(d, four_bar_gravity(-d, "turning_back").with_(duration=1.5)) for d in powers(-1, -9, 9)],
        ),
        Ladder(
            "gap",
            "The rod of a slider-crank is longer than its crank by a small gap, which separates the two "
            "branches.",
            "gap, m",
            [(g, _gap(g)) for g in powers(-1, -13, 9)],
        ),
        Ladder(
            "mass_ratio",
            "The slider of a slider-crank is heavier than its crank by a given ratio.",
            "ratio",
            [(r, _heavy_slider(r)) for r in powers(0, 12, 9)],
        ),
        Ladder(
            "length_ratio",
            "The rod of a slider-crank is longer than its crank by a given ratio.",
            "ratio",
            [(r, _long_rod(r)) for r in (1.5, *powers(1, 6, 6))],
        ),
        Ladder(
            "units",
            "A slider-crank is scaled by a unit of length; Froude's scaling keeps the motion similar.",
            "unit",
            [(s, _scaled(s)) for s in powers(-6, 4, 9)],
        ),
        Ladder(
            "speed",
            "The crank of a rhombus is driven at a given speed for two turns.",
            "rad/s",
            [(w, _driven_at(w)) for w in powers(-6, 7, 9)],
        ),
        Ladder(
            "stiffness",
            "A spring of given stiffness acts on the slider of a slider-crank for two periods.",
            "N/m",
            [(k, _sprung(k)) for k in powers(0, 12, 9)],
        ),
        Ladder(
            "tilt",
            "The second of two hinges of a door is tilted so much: it holds the door unless the tilt "
            "is rounding. Between 1e-7 and 1e-9 the judge cannot tell, so that no rung lies there.",
            "rad",
            [(a, _door(a)) for a in (1e-1, 1e-3, 1e-5, 1e-6, 1e-10, 1e-11, 1e-13, 1e-15)],
        ),
        Ladder(
            "initial_violation",
            "The velocities given to a slider-crank miss its joints by so much of the crank pin's speed; the "
            "nearest velocities that meet the joints are the start.",
            "violation over speed",
            [(v, _missing(v)) for v in powers(-14, -2, 9)],
        ),
        Ladder(
            RANK_TOLERANCE,
            "A slider-crank with three redundant rows turns under gravity, and singular "
            "values or pivots below so much of the largest count as zero.",
            "rank tolerance",
            [(r, _turning().with_(duration=0.5)) for r in powers(-16, -1, 9)],
        ),
        Ladder(
            "duration",
            "A slider-crank turns under gravity for so long.",
            "s",
            [(t, _turning().with_(duration=t)) for t in (0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3)],
        ),
    )


def powers(first: float, last: float, count: int) -> Iterator[float]:
    """Return ``count`` powers of ten between two exponents."""
    return (float(f"{10**e:.0e}") for e in np.linspace(first, last, count))


def _gap(gap: float) -> Scene:
    return slider_crank(0.308, 0.308 + gap, 0.3, "gap", rate=30.0).with_(duration=0.25)


def _turning() -> Scene:
    return slider_crank(0.304, 0.4048, 0.3, "duration", rate=30.0).with_(gravity=(0.0, -9.81, 0.0))


def _missing(violation: float) -> Scene:
    """Return the turning slider-crank with all velocities given; the slider's velocity along its guide is
    wrong by ``violation``."""
    scene = _turning().with_(duration=0.5)
    start = cast(Truth, closed_form(scene)).poses(np.zeros(1))
    velocities, spins = start.velocity[0].copy(), start.angular_velocity[0]
    velocities[2, 0] += violation * 2.0 * np.linalg.norm(velocities[0])
    bodies = (
        body.model_copy(update={"velocity": _times(v, 1.0), "angular_velocity": _times(w, 1.0)})
        for body, v, w in zip(scene.body, velocities, spins, strict=True)
    )
    return scene.with_(body=tuple(bodies))


def _heavy_slider(ratio: float) -> Scene:
    scene = slider_crank(0.304, 0.4048, 0.3, "mass_ratio", rate=30.0)
    crank, rod, slider = scene.body
    mass = ratio * 0.304  # kg; 0.304 kg is the mass of the crank
    heavy = slider.model_copy(update={"mass": mass, "inertia": (1e-2 * mass,) * 3})
    return scene.with_(body=(crank, rod, heavy), duration=0.5)


def _long_rod(ratio: float) -> Scene:
    return slider_crank(0.4 / ratio, 0.4, 0.3, "length_ratio", rate=30.0).with_(duration=0.5)


def _door(tilt: float) -> Scene:
    door = Body(name="door", position=(0.5, 0.0, 0.5), mass=1.0, inertia=(0.1, 0.2, 0.15))
    hinges = tuple(
        Revolute(name=name, bodies=(GROUND, "door"), anchor=(0.0, 0.0, z), axis=axis)
        for name, z, axis in (("A", 0.0, (0.0, 0.0, 1.0)), ("B", 1.0, (tilt, 0.0, 1.0)))
    )
    return Scene(name="tilt", gravity=(0.0, -9.81, 0.0), body=(door,), joint=hinges, duration=0.5)


def _scaled(unit: float) -> Scene:
    """Return the turning slider-crank with lengths times ``unit``, times √unit, and unchanged masses."""
    scene, time = _turning(), math.sqrt(unit)
    moved = slider_crank(0.304 * unit, 0.4048 * unit, 0.3, "units", rate=30.0 / time)
    bodies = tuple(
        placed.model_copy(update={"mass": body.mass, "inertia": _times(body.inertia, unit**2)})
        for placed, body in zip(moved.body, scene.body, strict=True)
    )
    return moved.with_(body=bodies, gravity=(0.0, -9.81, 0.0), duration=0.5 * time)


def _times(numbers: Any, factor: float) -> tuple[float, ...]:
    return tuple(float(number) * factor for number in numbers)


def _driven_at(rate: float) -> Scene:
    scene = four_bar(math.pi / 2, "speed")
    factor = rate / CRANK_RATE
    bodies = tuple(
        body.model_copy(update={"angular_velocity": _times(body.angular_velocity, factor)})
        for body in scene.body
    )
    driver = Driver(joint="A", polynomial=(0.0, -rate))
    return scene.with_(body=bodies, driver=(driver,), duration=4 * math.pi / rate)


def _sprung(stiffness: float) -> Scene:
    """Return a slider-crank that starts at rest with a spring stretched by a tenth; the slider has nearly all
    of the mass."""
    scene = slider_crank(0.304, 0.4048, 0.3, "stiffness")
    at = scene.body[2].position
    spring = Spring(
        bodies=("ground", "slider"),
        points=((1.0, 0.0, 0.0), at),
        stiffness=stiffness,
        natural_length=0.9 * (1.0 - at[0]),
    )
    return scene.with_(load=(spring,), duration=4 * math.pi / math.sqrt(stiffness))


def scenes() -> list[Scene]:
    """Return the scene of every rung by its name."""
    return [
        scene.with_(name=scene_name(ladder.name, difficulty))
        for ladder in ladders()
        for difficulty, scene in ladder.rungs
    ]


def cases(engines: Sequence[str]) -> list[Case]:
    """Return runs of every rung by mbref's methods, and by the engines that can run it."""
    return [
        Case(scene, np.linspace(0.0, scene.duration, SAMPLES), name, setting, TIME_LIMIT)
        for scene in scenes()
        for name, setting in _settings(scene, engines)
    ]


def _settings(scene: Scene, engines: Sequence[str]) -> Iterator[tuple[str, Setting]]:
    for method in METHODS:
        yield MBREF, Setting(method, _options(scene))
    if place(scene.name)[0] == RANK_TOLERANCE:
        return
    for name in engines:
        offered = [s for s in settings(name, scene) if s.family == FAMILIES[name]]
        if offered:
            yield name, offered[max(0, len(offered) - 2)]


def _options(scene: Scene) -> dict[str, float]:
    ladder, difficulty = place(scene.name)
    swept = {"rank_tolerance": difficulty} if ladder == RANK_TOLERANCE else {}
    most = MOST_STEPS * max(1, round(scene.duration / 30.0))
    return {"rtol": RTOL, "most_steps": most, **swept}


def run(path: str | Path, engines: Sequence[str]) -> list[Record]:
    """Return the record of every rung, stored at ``path`` as its run ends; stored records are not
    repeated."""
    able, rungs = [name for name in FAMILIES if name in engines], scenes()
    with counted("finding out settings", unasked(able, rungs)) as advance:
        scout(able, rungs, advance)
    planned = cases(able)
    with shown("the stability ladders", len(planned)) as progress:
        return study(planned, None, path, progress)
