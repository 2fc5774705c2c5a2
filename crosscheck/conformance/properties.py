"""What is held against an engine: one property, one short function of a bench."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from crosscheck.conformance.relations import RELATIONS
from crosscheck.conformance.trial import Bench, Specimen, difference
from crosscheck.engine import Cannot, engine
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.energy import energy_series
from crosscheck.judge.metrics import in_scene_order, violation_series
from crosscheck.judge.tolerances import LIKE_TRUTH, SAME_MOTION, STAYS_CLOSED, UNIT_NORM
from mbref import rotations
from mbref.trajectory import Trajectory

STATE = ("position", "orientation", "velocity", "angular_velocity")
STEP = 1e-4  # of the duration: central differences of it are off by 1e-8 of what a motion does in its time


class Finding(NamedTuple):
    """``measured`` must not exceed ``allowed``; ``remark`` says more."""

    measured: float
    allowed: float
    remark: str = ""


Check = Callable[[Bench], Finding | Cannot | None]  # None: the property says nothing of this scene


class Property(NamedTuple):
    """``about`` is what is checked, against what; ``of`` tells which specimens it is checked on."""

    about: str
    check: Check
    of: Callable[[Specimen], bool]


def sample_times(bench: Bench) -> Finding:
    """The samples are at the times asked for, bit for bit, and the run ends at the last."""
    times = np.array([*bench.motion.times, bench.motion.t_end])
    wanted = np.array([*bench.times, bench.times[-1]])
    same = times.shape == wanted.shape
    return Finding(float(np.abs(times - wanted).max()) if same else np.inf, 0.0)


def unit_orientations(bench: Bench) -> Finding:
    """Orientations are unit quaternions."""
    norms = np.linalg.norm(bench.motion.orientation, axis=-1)
    return Finding(float(np.abs(norms - 1).max()), UNIT_NORM)


def closure(bench: Bench) -> Finding:
    """Joints and drivers hold at every sample: the judge's own joint equations."""
    return Finding(float(violation_series(bench.scene, bench.motion).max()), STAYS_CLOSED)


def velocities(bench: Bench) -> Finding:
    """Velocities and angular velocities (world) are the rates of the poses: central differences."""
    h, middle = STEP * bench.scene.duration, bench.scene.duration / 2
    run = bench.run(bench.scene, np.array([middle - h, middle, middle + h]))
    moved = (run.position[2] - run.position[0]) / (2 * h)
    turn = rotations.multiply(run.orientation[2], rotations.conjugate(run.orientation[0]))
    turn *= np.where(turn[:, :1] < 0, -1.0, 1.0)
    angle = 2 * np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), turn[:, 0])
    axis = turn[:, 1:] / np.maximum(np.linalg.norm(turn[:, 1:], axis=1), 1e-300)[:, None]
    turned = axis * angle[:, None] / (2 * h)
    length = scene_length(bench.scene)
    speeds = np.concatenate([run.velocity[1], length * run.angular_velocity[1]])
    off = speeds - np.concatenate([moved, length * turned])
    scale = max(np.linalg.norm(speeds, axis=1).max(), length / bench.scene.duration)
    return Finding(float(np.linalg.norm(off, axis=1).max() / scale), LIKE_TRUTH)


def truth(bench: Bench) -> Finding | None:
    """Poses against a closed form, or a truth of the judge."""
    if bench.exact is None:
        return None
    return Finding(difference(bench.scene, bench.motion, bench.exact), LIKE_TRUTH, bench.exact.engine)


def energy(bench: Bench) -> Finding | None:
    """Energy less the work of loads stays what it was, where something moves, nothing damps or drives."""
    moved = difference(bench.scene, bench.motion, _at(bench.motion, np.zeros(len(bench.times), dtype=int)))
    if moved < SAME_MOTION:
        return None
    drift = energy_series(bench.scene, bench.motion)
    return None if drift is None else Finding(float(drift.max()), LIKE_TRUTH)


def silence(bench: Bench) -> Finding:
    """A run prints nothing and leaves no file in its working directory."""
    seen = bench.finest
    if seen.printed or seen.files:  # once for a machine, as for a compilation, is forgiven
        seen = bench.observed(bench.scene, bench.times, bench.settings[-1])
    said = seen.printed.strip().splitlines()
    remark = "; ".join([*(f"printed {line!r}" for line in said[:1]), *seen.files[:3]])
    return Finding(float(len(said) + len(seen.files)), 0.0, remark)


def determinism(bench: Bench) -> Finding:
    """The same run again gives the same bits: in another process, and in one that has made runs before."""
    first = bench.motion
    others = [bench.run(bench.scene, bench.times), *bench.shared_runs]
    pairs = [(getattr(first, name), getattr(other, name)) for other in others for name in STATE]
    return Finding(max(float(np.abs(a - b).max()) for a, b in pairs), 0.0)


def other_times(bench: Bench) -> Finding:
    """Other sample times, the first of them not 0, leave the motion at common times what it was."""
    between = bench.times[:-1] + np.diff(bench.times) * np.resize([0.3, 0.7], len(bench.times) - 1)
    times = np.sort([*bench.times[1:], *between])
    common = _at(bench.run(bench.scene, times), np.isin(times, bench.times))
    return Finding(difference(bench.scene, _at(bench.motion, slice(1, None)), common), bench.own_accuracy)


def related(name: str, bench: Bench) -> Finding | Cannot:
    """The scene changed as the relation says moves as it says."""
    relation = RELATIONS[name]
    scene = relation.change(bench.scene)
    if cannot := engine(bench.engine).cannot(scene):
        return cannot
    expected = in_scene_order(scene, relation.expect(bench.motion))
    return Finding(difference(scene, expected, bench.run(scene, bench.times)), bench.own_accuracy)


def _at(run: Trajectory, samples: slice | np.ndarray) -> Trajectory:
    """Some samples of a run."""
    arrays = {name: getattr(run, name)[samples] for name in ("times", *STATE)}
    return replace(run, **arrays, acceleration=None, angular_acceleration=None, reactions=None)


def _every(specimen: Specimen) -> bool:
    return True


def _related(specimen: Specimen) -> bool:
    return specimen.related


def _property(check: Check, of: Callable[[Specimen], bool] = _every) -> Property:
    return Property((check.__doc__ or "").splitlines()[0], check, of)


PROPERTIES: Mapping[str, Property] = {
    "times": _property(sample_times),
    "unit": _property(unit_orientations),
    "closure": _property(closure),
    "velocities": _property(velocities),
    "truth": _property(truth),
    "energy": _property(energy),
    "silence": _property(silence),
    "repeated": _property(determinism, _related),
    "resampled": _property(other_times, _related),
    **{
        name: Property(f"The scene {name}: {relation.about}.", partial(related, name), _related)
        for name, relation in RELATIONS.items()
    },
}
