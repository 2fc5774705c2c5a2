"""Adapters with one planted defect are off the judge's reference."""

import functools
import importlib
import math
import shutil
import textwrap
import tomllib
from pathlib import Path

import numpy as np
import pytest

import crosscheck.engines
from crosscheck.engine import Engine, Setting, engine, installed
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import Truth, truth_for
from mbref.motions.trajectory import Outcome
from mbref.scene import Force, Moment, Scene, TorsionSpring
from mbref.scenes import SCENES
from tests.helpers.tree_scenes import every_joint, ring

FOLDER = Path(crosscheck.engines.__path__[0])
GENERATORS = ("casadi", "heyoka")  # share the files of the folder symbolic, and keep compiled code
TIMES = np.array([0.0, 0.05, 0.1])
TERMS = Setting("terms", {"rtol": 1e-9, "min_step": 1e-3})
# engine: a setting, and the largest error of the adapter without defect
WAYS: dict[str, tuple[Setting, float]] = {
    "mujoco": (Setting("forward", {"rtol": 1e-9, "min_step": 1e-3, "beta": 100.0, "hard": 1e-7}), 1e-6),
    "pinocchio": (Setting("tuned", {"rtol": 1e-9, "min_step": 1e-3}), 1e-6),
    "exudyn": (Setting("trapezoidal", {"step": 1e-3}), 1e-3),
    "simbody": (Setting("merson", {"accuracy": 1e-8}), 1e-4),
    "drake": (TERMS, 1e-6),
    "dart": (TERMS, 1e-6),
    "dart's steps": (Setting("balls", {"step": 1e-4, "erp": 0.5}), 5e-3),
    "drake's steps": (Setting("discrete", {"step": 1e-4}), 5e-3),
    "bullet's steps": (Setting("iterated", {"step": 1e-4, "iterations": 1000}), 5e-3),
    "sundials": (Setting("ggl", {"rtol": 1e-7}), 1e-4),
    "ondsel": (Setting("kinematics", {"step": 1e-3}), 1e-6),
    "mjx": (Setting("stock", {"step": 1e-3}), 1e-3),
    "warp": (Setting("stock", {"step": 1e-3}), 1e-3),
    "casadi": (Setting("projected, compiled", {"rtol": 1e-9, "min_step": 1e-3}), 1e-6),
    "heyoka": (Setting("taylor", {"rtol": 1e-9}), 1e-6),
    "newton": (Setting("lox", {"step": 5e-4, "alpha": 0.01}), 5e-3),
}
LOAD, FRAME, START = "sign of a load", "frame or sign of a reaction", "initial velocities"
KINDS = (LOAD, FRAME, START, "order of bodies", "units")  # of defects, which each adapter could have
UNABLE = {  # an adapter and the kinds of defects that it cannot have
    "bullet": {FRAME: "Bullet's steps give no reactions"},
    "mjx": {FRAME: "MJX gives no reactions"},
    "warp": {FRAME: "MuJoCo Warp gives no reactions"},
    "newton": {FRAME: "Newton gives no reactions"},
    "ondsel": {LOAD: "OndselSolver receives no loads", START: "the drivers prescribe the initial velocities"},
}
DEFECTS: dict[str, list[dict[str, str]]] = {way: [] for way in WAYS}
for one in tomllib.loads(Path(__file__).with_name("defects_of_adapters.toml").read_text())["defect"]:
    DEFECTS[one.pop("way")].append(one)


QUICK = [  # the other defects are left to `make deep`
    next(one for one in DEFECTS[way] if one["kind"] == LOAD) for way in ("mujoco", "pinocchio", "exudyn")
]
CASES = [
    pytest.param(
        *(way, defect),
        marks=[pytest.mark.slow] * (defect not in QUICK),
        id=f"{way}: {defect['kind']}, {defect['text'][:30]}",
    )
    for way, found in DEFECTS.items()
    for defect in found
]


def package(way: str) -> str:
    return way.removesuffix("'s steps")


@functools.cache
def case(way: str) -> tuple[Scene, Truth]:
    """A mechanism that turns, and its truth: seven types of joints, four of loads and two loops, if they are
    mapped. OndselSolver maps mechanisms whose whole motion is driven. Code of MJX, Warp and generators is
    compiled for each model, so that theirs is small; generators map moments alone."""
    if way == "ondsel":
        scene = SCENES["spatial_slider_crank_driven"]().with_(duration=0.1)
    elif way in ("mjx", "warp", *GENERATORS):
        pull = Force(body="c", point=(0.6, 0.4, 0.1), force=(9.0, 3.0, 0.0))
        moment = Moment(body="b", moment=(0.0, 0.0, 4.0))
        load = (moment,) if way in GENERATORS else (pull, moment)
        scene = ring("spherical").with_(duration=0.1, load=load)
    else:
        scene = every_joint(duration=0.1)
    if way == "newton":
        scene = scene.with_(load=[load for load in scene.load if not isinstance(load, TorsionSpring)])
    return scene, truth_for(scene)


def error_over_limit(simulator: Engine, way: str) -> float:
    """Return the largest of three errors over the limit in WAYS: of poses, and hundredths of those of
    velocities and of reactions. A run that does not complete has an infinite error."""
    scene, truth = case(way)
    setting, allowed = WAYS[way]
    run = simulator.run(scene, TIMES, setting)
    if run.outcome is not Outcome.COMPLETED:
        return math.inf
    found = measure(scene, run, truth)
    others = (found[name] or 0.0 for name in ("velocity_error", "reaction_error"))
    return max(found["error"], *(other / 100 for other in others)) / allowed


@functools.cache
def sound(way: str) -> float:
    """Return `error_over_limit` of the adapter without defect."""
    return error_over_limit(engine(package(way)), way)


def place_of(name: str, defect: dict[str, str], adapters: Path) -> Path:
    """Return the file with a defect in a folder of adapters."""
    place = f"{defect['file'].replace('.', '/')}.py"
    places = adapters / name / place, adapters / "shared" / place, adapters / place
    return next(filter(Path.exists, places))


def planted(name: str, defect: dict[str, str], folder: Path) -> Engine:
    """Return the engine of an adapter with a defect, from a copy of all adapters under another name."""
    copy = folder / f"planted_{abs(hash((name, *defect.values())))}"
    shutil.copytree(FOLDER, copy, ignore=shutil.ignore_patterns("__pycache__"))
    for path in copy.rglob("*.py"):
        path.write_text(path.read_text().replace("crosscheck.engines", copy.name))
    path = place_of(name, defect, copy)
    path.write_text(path.read_text().replace(defect["text"], defect["instead"]))
    return importlib.import_module(f"{copy.name}.{name}.adapter").ENGINE


def test_each_text_that_a_defect_replaces_is_once_in_its_file():
    """A defect replaces its text, which has to be unique. `make deep` plants most of the over 90 defects."""
    planned = [(package(way), defect) for way, found in DEFECTS.items() for defect in found]
    counts = [place_of(name, defect, FOLDER).read_text().count(defect["text"]) for name, defect in planned]
    missing = [each for each, count in zip(planned, counts, strict=True) if count != 1]
    assert len(planned) > 90 and not missing, missing


@pytest.mark.parametrize(("way", "defect"), CASES)
def test_planted_defect_moves_an_adapter_off_the_reference(way, defect, monkeypatch, tmp_path):
    """One replaced text of the adapter makes the run fail, or puts poses off the judge's reference by more
    than the engine's limit in WAYS, or velocities or reactions by more than 100 times this limit. Without
    the defect all are within these limits."""
    if not installed(package(way)):
        pytest.skip(f"{package(way)} is not installed")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))  # code compiled from the true sources
    assert sound(way) <= 1 < error_over_limit(planted(package(way), defect, tmp_path), way)


@pytest.mark.parametrize("name", sorted({package(way) for way in WAYS}))
def test_each_adapter_is_tried_with_each_kind_of_defect(name):
    """The five kinds are signs of loads, frames, orders, starts and units (KINDS). DEFECTS has one of each
    for the adapter, or UNABLE says why it has none."""
    found = {one["kind"] for way, defects in DEFECTS.items() if package(way) == name for one in defects}
    assert set(KINDS) - found == set(UNABLE.get(name, {}))


def test_example_of_the_documentation_is_the_code_of_bullet_s_adapter():
    """The page shows four methods of the adapter word for word."""
    page = (FOLDER.parents[1] / "docs" / "verify-your-engine.md").read_text()
    (example,) = [block for block in page.split("```python\n")[1:] if "stepSimulation" in block]
    source = textwrap.dedent((FOLDER / "bullet" / "adapter.py").read_text().partition("class _World")[2])
    methods = [part.strip() for part in example.partition("```")[0].split("\n\n") if part.strip()]
    assert len(methods) == 4
    for method in methods:
        assert textwrap.indent(method, "    ") in source
