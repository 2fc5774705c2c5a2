"""Adapters with one planted defect / the reference.

The defects are the sign of a load, the frame of a reaction, the order of bodies, initial velocities, units.
"""

from __future__ import annotations

import functools
import importlib
import sys
import textwrap
import types
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import crosscheck.engines
from crosscheck.engine import Engine, Setting, engine
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import Truth, truth_for
from mbref.scene import Force, Moment, Scene, TorsionSpring
from mbref.scenes import SCENES
from mbref.trajectory import Outcome
from tests.crosscheck.tree_scenes import every_joint, ring

FOLDER = Path(crosscheck.engines.__path__[0])
# files that import models, in the order of their imports
USERS = ("equations", "ida", "dynamic", "simulation", "adapter")
TIMES = np.array([0.0, 0.05, 0.1])
TERMS = Setting("terms", {"rtol": 1e-9, "min_step": 1e-3})
# engine: its module, a setting, and the largest error of the adapter without defect
WAYS: dict[str, tuple[str, Setting, float]] = {
    "mujoco": (
        "mujoco",
        Setting("forward", {"rtol": 1e-9, "min_step": 1e-3, "beta": 100.0, "hard": 1e-7}),
        1e-6,
    ),
    "pinocchio": ("pinocchio", Setting("tuned", {"rtol": 1e-9, "min_step": 1e-3}), 1e-6),
    "exudyn": ("exudyn", Setting("trapezoidal", {"step": 1e-3}), 1e-3),
    "simbody": ("opensim", Setting("merson", {"accuracy": 1e-8}), 1e-4),
    "drake": ("pydrake", TERMS, 1e-6),
    "dart": ("dartpy", TERMS, 1e-6),
    "dart's steps": ("dartpy", Setting("balls", {"step": 1e-4, "erp": 0.5}), 5e-3),
    "drake's steps": ("pydrake", Setting("discrete", {"step": 1e-4}), 5e-3),
    "bullet's steps": ("pybullet", Setting("iterated", {"step": 1e-4, "iterations": 1000}), 5e-3),
    "sundials": ("sksundae", Setting("ggl", {"rtol": 1e-7}), 1e-4),
    "ondsel": ("pyondsel", Setting("kinematics", {"step": 1e-3}), 1e-6),
    "mjx": ("mujoco.mjx", Setting("stock", {"step": 1e-3}), 1e-3),
    "warp": ("mujoco_warp", Setting("stock", {"step": 1e-3}), 1e-3),
    "newton": ("newton", Setting("lox", {"step": 5e-4, "alpha": 0.01}), 5e-3),
}
SLOW = ("mjx", "warp", "newton")  # compile their code for minutes
DEFECTS = {  # engine: file, text, the text with a defect; each text occurs once
    "mujoco": [
        (
            "model",
            "np.concatenate([np.zeros(3), load.moment])",
            "-np.concatenate([np.zeros(3), load.moment])",
        ),
        ("model", "np.concatenate([load.force, np.zeros(3)])", "np.concatenate([np.zeros(3), load.force])"),
        ("model", "rates=initial_rates(scene, tree)", "rates=-initial_rates(scene, tree)"),
        ("model", "added * action.natural", "added * np.degrees(action.natural)"),
        (
            "model",
            "model.body_mass[b], model.body_ipos[b] = link.mass,",
            "model.body_mass[b], model.body_ipos[b] = 1e3 * link.mass,",
        ),
        ("simulation", "own = list(tree.own)", "own = list(tree.own)[::-1]"),
        ("simulation", "wrench(-data.efc_force[rows]", "wrench(data.efc_force[rows]"),
    ],
    "pinocchio": [
        ("model", "zip(ends, (1.0, -1.0), strict=True)", "zip(ends, (-1.0, 1.0), strict=True)"),
        ("model", "data.oMi[joint].rotation.T @ moment)", "moment)"),
        ("model", "self.v0 = initial_rates(scene, self.tree)", "self.v0 = -initial_rates(scene, self.tree)"),
        ("model", "q[iq] - spring.natural", "q[iq] - np.degrees(spring.natural)"),
        ("model", "self.origin[joint] = link.anchor", "self.origin[joint] = link.position"),
        ("simulation", "-place.act(force).vector", "-force.vector"),
    ],
    "exudyn": [
        ("model", "loadVector=load.moment, **over_time", "loadVector=[-x for x in load.moment], **over_time"),
        ("model", "*w[k] / 2]", "*w[k]]"),
        ("model", "initialVelocities=[*v[k], 0", "initialVelocities=[*v[-1 - k], 0"),
        ("model", "offset=load.natural_angle", "offset=np.degrees(load.natural_angle)"),
        ("model", "turn @ (np.diag(local) if local.ndim == 1 else local) @ turn.T", "turn.T @ local @ turn"),
        ("reactions", 'return -np.einsum("kij,kj->ki", axes[0], force), moment', "return -force, moment"),
    ],
    "simbody": [
        ("model", "*_constants(mechanism, load.moment)", "*_constants(mechanism, [-x for x in load.moment])"),
        ("model", "place = mechanism.place(link, load.point)", "place = mechanism.vector(load.point)"),
        ("model", "setSpeedValue(state, float(rate))", "setSpeedValue(state, -float(rate))"),
        (
            "model",
            "setRestLength(load.natural_angle)",
            "setRestLength(float(np.degrees(load.natural_angle)))",
        ),
        ("adapter", "found.append(-wrench(", "found.append(wrench("),
    ],
    "drake": [
        ("model", "- plant.CalcGravityGeneralizedForces", "+ plant.CalcGravityGeneralizedForces"),
        ("model", "CalcJacobianSpatialVelocity(*of)[ANGULAR_FIRST]", "CalcJacobianSpatialVelocity(*of)"),
        ("model", "np.eye(3) - np.outer(c, c)", "np.eye(3) + np.outer(c, c)"),
        ("model", "i = piece.inertia / piece.mass", "i = piece.inertia"),
    ],
    "dart": [
        (
            "model",
            "node.getLinearAcceleration(), node.getAngularAcceleration()",
            "node.getAngularAcceleration(), node.getLinearAcceleration()",
        ),
        ("model", "positions[at.single] = q[at.single_q]", "positions[at.single] = -q[at.single_q]"),
        ("model", "self._place(piece.anchor - piece.origin)", "self._place(piece.origin - piece.anchor)"),
    ],
    "dart's steps": [
        ("adapter", "node.addExtTorque(moment, False)", "node.addExtTorque(-moment, False)"),
        (
            "adapter",
            "node.addExtForce(force, np.zeros(3), False, True)",
            "node.addExtForce(force, np.zeros(3), False, False)",
        ),
        (
            "model",
            "self._in_order(initial_rates(scene, tree))",
            "-self._in_order(initial_rates(scene, tree))",
        ),
        ("model", "piece.mass, piece.offset, piece.inertia", "1e3 * piece.mass, piece.offset, piece.inertia"),
    ],
    "drake's steps": [
        ("adapter", "SpatialForce(tau=moment, f=force)", "SpatialForce(tau=-moment, f=force)"),
        ("adapter", "SpatialForce(tau=moment, f=force)", "SpatialForce(tau=moment, f=-force)"),
        ("model", "initial_rates(scene, tree))", "-initial_rates(scene, tree))"),
    ],
    "bullet's steps": [
        (
            "adapter",
            "p.applyExternalTorque(place.body, place.link, moment.tolist()",
            "p.applyExternalTorque(place.body, place.link, (-moment).tolist()",
        ),
        ("adapter", "at, self.p.WORLD_FRAME", "at, self.p.LINK_FRAME"),
        ("model", "self.rates = initial_rates(scene, tree)", "self.rates = -initial_rates(scene, tree)"),
        ("model", "range(len(self.tree.links))]", "reversed(range(len(self.tree.links)))]"),
        ("model", '"linkMasses": [piece.mass for', '"linkMasses": [1e3 * piece.mass for'),
    ],
    "sundials": [
        ("generalised_forces", "np.array(x.moment)[:, None]) for", "-np.array(x.moment)[:, None]) for"),
        ("generalised_forces", "cross(place[:, 0], local[..., 0])", "cross(place[:, 0], force[..., 0])"),
        ("generalised_forces", "(angle - load.natural_angle)", "(angle - np.degrees(load.natural_angle))"),
        ("ida", "rotations.rotate(rotations.conjugate(p), w)", "w"),
        ("ida", "velocity=s.v,", "velocity=s.v[::-1],"),
        ("ida", "(second, 1.0) if second >= 0", "(second, -1.0) if second >= 0"),
    ],
    "ondsel": [
        ("model", "body.mass or 1.0", "1e3 * (body.mass or 1.0)"),
        ("model", "return moments[order], axes", "return moments[order[::-1]], axes"),
        ("model", "({sign * c!r})", "({-sign * c!r})"),
        ("model", "parts[self.scene.body_index(name)]", "parts[-1 - self.scene.body_index(name)]"),
        ("adapter", 'self._vectors("VX", "VY", "VZ")', '-self._vectors("VX", "VY", "VZ")'),
        ("adapter", "= -np.concatenate([force, moment +", "= np.concatenate([force, moment +"),
    ],
    "mjx": [
        ("mujoco.ports", "self.data.qvel[:] = self.built.rates", "self.data.qvel[:] = -self.built.rates"),
        ("mujoco.ports", "self.built.apply(self.data, 0.0)", "self.data.xfrc_applied[:] = 0.0"),
        ("mujoco.ports", "data.xpos[links]", "data.xpos[links[::-1]]"),
        ("adapter", "self.model.opt.timestep * 0 + h", "self.model.opt.timestep * 0 + 1e3 * h"),
        ("adapter", "self.data.qpos, self.data.qvel)", "self.data.qpos, -self.data.qvel)"),
    ],
    "warp": [
        ("mujoco.ports", "self.data.qvel[:] = self.built.rates", "self.data.qvel[:] = -self.built.rates"),
        ("mujoco.ports", "twists[:, 3:],", "twists[:, :3],"),
        ("adapter", "timestep.fill_(h)", "timestep.fill_(1e3 * h)"),
        ("adapter", "self.data.qvel.numpy()[0]", "-self.data.qvel.numpy()[0]"),
    ],
    "newton": [
        ("model", "wrenches[link, :3] += force", "wrenches[link, :3] -= force"),
        ("model", "moment - cross(arms[link], force)", "moment + cross(arms[link], force)"),
        ("model", "of_joints[: self.tree.nv] = rates", "rates = of_joints[: self.tree.nv] = -rates"),
        ("model", "mass=link.mass", "mass=1e3 * link.mass"),
        ("model", "return rotation, poses[:, :3],", "return rotation, poses[::-1, :3],"),
    ],
}
MANY_STEPS = "node.getLinearAcceleration(), node.getAngularAcceleration()"  # this defect costs 40 s
CASES = [
    pytest.param(way, *defect, marks=[pytest.mark.slow] * (way in SLOW or defect[1] == MANY_STEPS))
    for way, found in DEFECTS.items()
    for defect in found
]


def package(way: str) -> str:
    return way.removesuffix("'s steps")


def is_installed(way: str) -> bool:
    name, _, part = WAYS[way][0].partition(".")
    return find_spec(name) is not None and (not part or find_spec(f"{name}.{part}") is not None)


@functools.cache
def case(way: str) -> tuple[Scene, Truth]:
    """A mechanism that turns, and its truth: every joint and most loads, with two loops, if the engine maps
    them. OndselSolver maps mechanisms whose whole motion is driven. The code of MJX and Warp is compiled for
    each model, so that theirs is small."""
    if way == "ondsel":
        scene = SCENES["spatial_slider_crank_driven"]().with_(duration=0.1)
    elif way in ("mjx", "warp"):
        pull = Force(body="c", point=(0.6, 0.4, 0.1), force=(9.0, 3.0, 0.0))
        moment = Moment(body="b", moment=(0.0, 0.0, 4.0))
        scene = ring("spherical").with_(duration=0.1, load=(pull, moment))
    else:
        scene = every_joint(duration=0.1)
    if way == "newton":
        scene = scene.with_(load=[load for load in scene.load if not isinstance(load, TorsionSpring)])
    return scene, truth_for(scene)


def place(name: str, file: str) -> str:
    """The dotted name of a file of an adapter, or of another file of the engines, in the folder of engines"""
    return f"{name}.{file}" if (FOLDER / name / f"{file}.py").exists() else file


def mutant(name: str, file: str, text: str, defect: str, patch: pytest.MonkeyPatch) -> Engine:
    """The engine of an adapter with a defect in a file: its modules are executed anew."""
    wrong = place(name, file)
    source = (FOLDER / f"{wrong.replace('.', '/')}.py").read_text()
    assert source.count(text) == 1, f"{wrong} has {source.count(text)} times {text!r}"
    users = [f"{name}.{part}" for part in USERS if (FOLDER / name / f"{part}.py").exists()]
    for part in dict.fromkeys((wrong, *users)):
        full = f"crosscheck.engines.{part}"
        own = importlib.import_module(full)
        fresh = types.ModuleType(full)
        fresh.__dict__.update(__file__=own.__file__, __package__=own.__package__)
        patch.setitem(sys.modules, full, fresh)
        code = Path(own.__file__).read_text()
        exec(
            compile(code.replace(text, defect) if part == wrong else code, own.__file__, "exec"),
            fresh.__dict__,
        )
    return sys.modules[f"crosscheck.engines.{name}.adapter"].ENGINE


def is_right(simulator: Engine, way: str) -> bool:
    scene, truth = case(way)
    _, setting, allowed = WAYS[way]
    run = simulator.run(scene, TIMES, setting)
    if run.outcome is not Outcome.COMPLETED:
        return False
    found = measure(scene, run, truth)
    others = (found[name] or 0.0 for name in ("velocity_error", "reaction_error"))
    return found["error"] <= allowed and max(others) <= 100 * allowed


@pytest.mark.parametrize(
    "way", [pytest.param(way, marks=pytest.mark.slow if way in SLOW else ()) for way in WAYS]
)
def test_adapters_without_defect_are_right(way):
    if not is_installed(way):
        pytest.skip(f"{WAYS[way][0]} is not installed")
    assert is_right(engine(package(way)), way)


@pytest.mark.parametrize(("way", "file", "text", "defect"), CASES)
def test_a_defect_of_an_adapter_is_seen(way, file, text, defect, monkeypatch):
    if not is_installed(way):
        pytest.skip(f"{WAYS[way][0]} is not installed")
    assert not is_right(mutant(package(way), file, text, defect, monkeypatch), way)


def test_the_example_of_the_documentation_is_the_adapter_of_bullet():
    page = (FOLDER.parents[1] / "docs" / "verify-your-engine.md").read_text()
    (example,) = [block for block in page.split("```python\n")[1:] if "stepSimulation" in block]
    source = textwrap.dedent((FOLDER / "bullet" / "adapter.py").read_text().partition("class _World")[2])
    methods = [part.strip() for part in example.partition("```")[0].split("\n\n") if part.strip()]
    assert len(methods) == 2
    for method in methods:
        assert textwrap.indent(method, "    ") in source
