"""Engines on seven types of joints, four of loads and drivers, against the judge."""

import functools

import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.joint_reactions import compare
from crosscheck.judge.metrics import error_series
from crosscheck.judge.reaction_balance import with_exact_reactions
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import (
    Scene,
)
from tests.helpers.measured import MARGIN
from tests.helpers.tree_scenes import BODIES, JOINTS, driven, every_joint, ring

# worst differences measured, parts of the largest value; Gauss's principle is integrated to 1.8e-9
MEASURED = {"pinocchio": 1.8e-9, "mujoco": 1.2e-7, "forward": 1.2e-8, "simbody": 1.3e-10, "sundials": 7.1e-6}
FINE = {
    "pinocchio": Setting("tuned", {"rtol": 1e-11, "min_step": 1e-4}),
    "mujoco": Setting("tuned", {"step": 2e-4, "beta": 100.0, "hard": 1e-8}),
    "forward": Setting("forward", {"rtol": 1e-10, "min_step": 1e-4, "beta": 100.0, "hard": 1e-7}),
    "simbody": Setting("merson", {"accuracy": 1e-10}),
    "sundials": Setting("ggl", {"rtol": 1e-7}),
}


def chain_scenes() -> dict[str, Scene]:
    """Seven types of joints between many bodies, and loops cut at joints of four types."""
    backwards = every_joint(name="backwards", body=tuple(reversed(BODIES)), joint=tuple(reversed(JOINTS)))
    rings = {f"ring {kind}": ring(kind) for kind in ("revolute", "cylindrical", "universal", "spherical")}
    return {"every joint": every_joint(), "driven": driven(), "backwards": backwards, **rings}


ALL = chain_scenes()


@functools.cache
def exact(name: str) -> Trajectory:
    """The motion of a scene by Gauss's principle, with its reactions."""
    scene = ALL[name]
    times = tuple(np.linspace(0.0, scene.duration / 2, 3).tolist())
    return with_exact_reactions(scene, gauss_motion(scene, times))


OPTIONAL = {"simbody": "opensim", "sundials": "sksundae.ida"}
CASES = [(setting, name) for setting in FINE if setting not in OPTIONAL for name in ALL]
CASES += [("simbody", name) for name in ALL if name == "every joint" or name.startswith("ring")]
CASES += [("sundials", name) for name in ("every joint", "driven", "ring universal", "ring revolute")]


@pytest.mark.parametrize(("setting", "name"), CASES)
def test_engines_move_and_react_by_gauss_s_principle(name: str, setting: str) -> None:
    """Poses, rates, accelerations, unique reactions and the resultants on each body, relative to the largest,
    over half the scene's time. Ten times the differences of MEASURED are allowed, 1.3e-10 to 7.1e-6."""
    pytest.importorskip(OPTIONAL.get(setting, setting if setting != "forward" else "mujoco"))
    scene, true = ALL[name], exact(name)
    simulator = engine("mujoco" if setting == "forward" else setting)
    run = simulator.run(scene, true.times, FINE[setting])
    assert run.outcome is Outcome.COMPLETED, f"{name}, {setting}: {run.outcome.label} {run.message}"
    off = {"pose": float(error_series(scene, run, true).max())}
    for field in ("velocity", "angular_velocity", "acceleration", "angular_acceleration"):
        found, wanted = getattr(run, field), getattr(true, field)
        off[field] = abs(found - wanted).max() / max(1.0, abs(wanted).max())
    compared = compare(scene, true, run)
    off["reactions"] = max(reaction.unique for reaction in compared.joints.values())
    off["resultants"] = compared.resultant
    assert max(off.values()) < MARGIN * MEASURED[setting], (name, setting, off)
