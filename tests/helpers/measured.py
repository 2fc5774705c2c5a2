"""How far engines may be off in a test: MARGIN times the largest error that was measured where it runs. A
test states the measured errors; whoever makes them smaller writes the new ones down."""

import numpy as np
import pytest

from crosscheck.judge.arithmetic import EXTENDED, many_digits
from crosscheck.judge.metrics import measure
from crosscheck.judge.reference.motion import Motion
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

MARGIN = 10.0  # for other processors, and other versions of libraries
ROUNDING = 1e-14  # stands for measured errors that are smaller


def completed_error(run: Trajectory, scene: Scene) -> float:
    """Return `error_of_samples` of a run that must have completed."""
    assert run.outcome is Outcome.COMPLETED, f"{run.outcome.label} at {run.t_end} s: {run.message}"
    return error_of_samples(run, scene)


def relative_error(run: Trajectory, scene: Scene) -> float:
    """Return the judge's metric `error` (of the length, or rad) of a run that must have completed."""
    assert run.outcome is Outcome.COMPLETED, f"{run.outcome.label} at {run.t_end} s: {run.message}"
    return float(measure(scene, run, truth_for(scene))["error"])


def error_of_samples(run: Trajectory, scene: Scene) -> float:
    """Return the largest error of a position (m) or an orientation (rad) at the samples, by the truth."""
    truth = truth_for(scene).poses(run.times)
    turned = rotations.angle_between(run.orientation, truth.orientation).max()
    return max(abs(run.position - truth.position).max(), turned)


def in_many_digits(scene: Scene, times: np.ndarray, seconds: float) -> Motion:
    """Return the motion by formulation A in thirty digits, with other independent rows (seed 2)."""
    pytest.importorskip("flint", reason="python-flint is the extra `certify`")
    motion = natural_motion(scene, times, many_digits(30), order=34, tolerance=1e-24, seed=2, seconds=seconds)
    assert not motion.reason
    arrays = {}
    for name in ("position", "orientation"):
        digits = [EXTENDED.dtype(x.str(30, radius=False)) for x in getattr(motion, name).ravel()]
        arrays[name] = np.array(digits).reshape(getattr(motion, name).shape)
    return type(motion)(**vars(motion) | arrays)
