"""Pictures of mechanisms in the report and the README: runs over the true motion, branches, and poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mbref.motions.drawing.labels import names
from mbref.motions.drawing.picture import Layer, Look, Panel, longest, picture, signs
from mbref.motions.drawing.svg import GREY
from mbref.motions.drawing.timeline import Timeline
from mbref.motions.drawing.view import Form
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

from . import figures
from .runs import Run, power

BEHIND = Look(GREY, 9.0, 0.45)  # look of the true motion behind a run
RUN = 3.5  # px, thickness of the bodies in a run
POSES = 8
FINE = 12  # points of a path between two samples
ACCURACY = ("rtol", "step")  # settings shown in a title
OPENING, BRANCH = Form(480.0, 34.0, 330.0), Form(420.0, 40.0, 300.0)


def motion_of(scene: Scene, record: Mapping[str, Any]) -> Trajectory:
    """Return positions and orientations of a record at its times; velocities are zero."""
    bodies = tuple(body.name for body in scene.body)
    position, orientation = (
        np.array([record["bodies"][name][key] for name in bodies]).transpose(1, 0, 2)
        for key in ("position", "orientation")
    )
    times, zeros = np.array(record["times"]), np.zeros_like(position)
    return Trajectory(scene.name, "", "", "", {}, times, bodies, position, orientation, zeros, zeros)


def over_truth(scene: Scene, exact: Trajectory, run: Trajectory | None, engine: str) -> str:
    """Return a picture of the true motion in grey, and of a run at equal times in front of it in its engine's
    colour."""
    layers = _run_over(exact, run, engine) if run else [Layer(exact, BEHIND, ())]
    words, timeline = f"The mechanism {scene.name} in motion", Timeline.of(exact.times)
    return picture(scene, [Panel(layers)], words, timeline, form=OPENING, shown=[exact])


def branches(scene: Scene, motions: Mapping[str, Trajectory], at: float, engine: str) -> dict[str, str]:
    """Return a picture by title of each motion in an engine's colour, over the first motion in grey.

    A line of time has a mark at the time ``at``, s.  All pictures show the same part of space.
    """
    first, *_ = every = list(motions.values())
    timeline = Timeline.of(longest(every), [at])
    return {
        title: picture(
            scene,
            [Panel(_run_over(first, motion, engine))],
            f"{scene.name}: {title}",
            timeline,
            form=BRANCH,
            shown=every,
        )
        for title, motion in motions.items()
    }


def compared(scene: Scene, exact: Trajectory, runs: Sequence[Run], marks: Sequence[float]) -> str:
    """Return the README's picture: runs side by side over the true motion, singular positions marked (s)."""
    panels = []
    for run in runs:
        accuracy = ", ".join(f"{k} {v:.2g}" for k, v in run.record["settings"].items() if k in ACCURACY)
        outcome = f"largest error {power(run.error)}" if run.completed else run.reason
        layers = [Layer(exact, BEHIND, ()), Layer(run.trajectory, Look(thickness=RUN), ())]
        panels.append(Panel(layers, [f"{run.label}, {accuracy}", outcome]))
    timeline = Timeline.of(exact.times, marks, "singular positions")
    form = Form(360.0, 30.0, 240.0, 13, len(panels))
    words = f"{scene.name} in {' and '.join(run.label for run in runs)}, over the true motion"
    return picture(scene, panels, words, timeline, form=form, shown=[exact])


def poses(scene: Scene, motion: Trajectory) -> str:
    """Return a picture of poses on top of each other, the last in full colour, with the paths of the centres
    of mass."""
    panel = Panel(_poses(motion, POSES, 5.0), paths=[path(motion, b) for b in range(len(scene.body))])
    return picture(scene, [panel], f"{scene.name}: poses", form=Form(), shown=[motion])


def poses_side_by_side(scene: Scene, motions: Mapping[str, tuple[str, Trajectory]], number: int) -> str:
    """Return a picture of ``number`` poses of several motions side by side; the first item of each motion is
    a subtitle."""
    panels = [
        Panel([layer._replace(more=()) for layer in _poses(motion, number, 4.0)], [title, line])
        for title, (line, motion) in motions.items()
    ]
    form = Form(900.0 / len(panels), 26.0, 420.0, 13, len(panels))
    return picture(scene, panels, f"{scene.name}: poses of {', '.join(motions)}", form=form)


def _run_over(exact: Trajectory, run: Trajectory, engine: str) -> list[Layer]:
    return [Layer(exact, BEHIND, ()), Layer(run, Look(figures.colour(engine), RUN), ())]


def _poses(motion: Trajectory, number: int, thickness: float) -> list[Layer]:
    """Return a layer for each of ``number`` samples, later ones darker; the last layer has joint signs and
    names."""
    samples = np.unique(np.linspace(0, len(motion.times) - 1, number).astype(int))
    layers = [
        Layer(sample(motion, k), Look(thickness=thickness / 2, opacity=0.15 + 0.4 * i / len(samples)), ())
        for i, k in enumerate(samples)
    ]
    return [*layers[:-1], Layer(sample(motion, samples[-1]), Look(thickness=thickness), (signs, names))]


def sample(motion: Trajectory, chosen: int | slice) -> Trajectory:
    """Return the selected samples of a motion; ``chosen`` is a sample number or a slice."""
    part = slice(chosen, chosen + 1) if not isinstance(chosen, slice) else chosen
    fields = ("times", "position", "orientation", "velocity", "angular_velocity")
    arrays = {name: getattr(motion, name)[part] for name in fields}
    return Trajectory(motion.scene, motion.engine, motion.version, "", {}, bodies=motion.bodies, **arrays)


def path(motion: Trajectory, body: int) -> np.ndarray:
    """Return points (n, 3), m, on the path of a centre of mass: cubic interpolation between samples with its
    velocities."""
    t, r, v = motion.times, motion.position[:, body], motion.velocity[:, body]
    return r if len(t) < 2 else CubicHermiteSpline(t, r, v)(np.linspace(t[0], t[-1], FINE * len(t)))
