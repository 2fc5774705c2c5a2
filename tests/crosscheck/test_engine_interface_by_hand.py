"""Engines, settings and refusals / names, defaults and sentences worked out by hand."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from crosscheck import engine as module
from crosscheck.engine import Engine
from crosscheck.refusals import Cannot, Owner, Supports
from crosscheck.setting import Setting, best_family
from mbref.scene import (
    Body,
    Coupling,
    Cylindrical,
    Driver,
    Factor,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    Translational,
)

X, Z, O = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


class Made(Engine):
    """An engine with two families; it records what it is asked to import."""

    name = "made"
    package = "numpy"

    def settings(self, scene: Any) -> list[Setting]:
        return [Setting("a", {"step": 0.1}), Setting("b"), Setting("a", {"step": 0.01})]

    def run(self, scene: Any, times: Any, setting: Setting) -> Any:
        raise NotImplementedError


# --- settings ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("setting", "text"),
    [
        (Setting("tuned"), "tuned"),
        (Setting("a", {"step": 1e-3}), "a step=0.001"),
        (
            Setting("a", {"step": 1 / 3, "stages": 12345678, "by": "x.y"}),
            "a step=0.333333 stages=12345678 by=x.y",
        ),
        (Setting("a", {"on": True, "rtol": 1e-12}), "a on=True rtol=1e-12"),
    ],
)
def test_settings_as_texts(setting, text):
    assert str(setting) == text


@pytest.mark.parametrize(
    ("families", "best"),
    [
        (["a", "tuned", "b", "tuned"], [1, 3]),
        (["a", "b", "a"], [0, 2]),
        (["tuned"], [0]),
        ([], []),
    ],
)
def test_the_best_family_of_settings(families, best):
    settings = [Setting(family, {"k": k}) for k, family in enumerate(families)]
    assert best_family(settings) == [settings[k] for k in best]


# --- refusals ---------------------------------------------------------------------------------------------
def body(name: str, **parts: Any) -> Body:
    return Body(**{"name": name, "mass": 1.0, "inertia": (1.0, 1.0, 1.0), "position": X, **parts})


HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=O, axis=Z)
SCENE = Scene(name="s", body=(body("b"),), joint=(HINGE,))
TABLE = ((0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 4.0))
ALL = Supports(
    joints=("revolute", "translational", "cylindrical"),
    drivers=("angle",),
    loads=("moment",),
    couplings=("angle",),
    armatures=("angle",),
    over_time=("table", "factor"),
    massless_links=True,
)
LINK = body("link", mass=0.0, inertia=(0.0, 0.0, 0.0))
RAIL = Translational(name="R", bodies=("ground", "b"), anchor=O, axis=X)
GEARED = HINGE.model_copy(update={"armature": 0.5})
PAIR = (HINGE, Cylindrical(name="C", bodies=("ground", "b"), anchor=O, axis=Z))
GEAR = Coupling(name="G", joints=("H", "C"), ratio=2.0)
FADING = Moment(body="b", moment=Z, factor=Factor(start=0.5))


def without(**parts: Any) -> Supports:
    return Supports(**{**{name: getattr(ALL, name) for name in Supports.__dataclass_fields__}, **parts})


CASES: dict[str, tuple[Scene, dict[str, Any], str]] = {
    "a massless link": (
        SCENE.with_(body=(LINK, *SCENE.body)),
        {"massless_links": False},
        "body 'link' is a massless link",
    ),
    "a joint": (SCENE, {"joints": ("spherical",)}, "joint 'H' is of type 'revolute'"),
    "an armature": (
        SCENE.with_(joint=(GEARED,)),
        {"armatures": ("displacement",)},
        "joint 'H' has an armature",
    ),
    "a coupling": (
        SCENE.with_(joint=PAIR, coupling=(GEAR,)),
        {"couplings": ()},
        "coupling 'G' couples the angle of joint 'H'",
    ),
    "a driver": (
        SCENE.with_(driver=(Driver(joint="H", polynomial=(0.0, 1.0)),)),
        {"drivers": ("displacement",)},
        "the driver of joint 'H' prescribes its angle",
    ),
    "a table": (
        SCENE.with_(driver=(Driver(joint="H", table=TABLE),)),
        {"over_time": ("factor",)},
        "the driver of joint 'H' follows a table",
    ),
    "a load": (
        SCENE.with_(load=(FADING.model_copy(update={"factor": None}), JointTorque(joint="H", torque=1.0))),
        {},
        "load[1] is of type 'joint_torque'",
    ),
    "a factor": (SCENE.with_(load=(FADING,)), {"over_time": ("table",)}, "load[0] changes with time"),
}


@pytest.mark.parametrize("name", CASES)
def test_the_first_feature_that_is_missing(name):
    scene, parts, says = CASES[name]
    found = without(**parts).missing(scene)
    assert found == Cannot(Owner.ADAPTER, f"{says}, which the adapter does not map")
    assert str(found) == f"{says}, which the adapter does not map (missing in the adapter)"
    if parts:
        assert ALL.missing(scene) is None


def test_features_that_scenes_do_not_use_need_no_support():
    """Drivers without a table, loads without a factor, and joints without an armature."""
    driven = SCENE.with_(
        driver=(Driver(joint="H", polynomial=(0.0, 1.0)),), load=(Moment(body="b", moment=Z),)
    )
    assert without(over_time=(), couplings=(), armatures=(), massless_links=False).missing(driven) is None
    assert Supports().missing(SCENE.with_(joint=())) is None and not Supports().massless_links
    offset = SCENE.with_(joint=PAIR, coupling=(GEAR.model_copy(update={"offset": 0.1}),))
    assert ALL.missing(offset).reason.startswith("coupling 'G' has an offset (scene.assembled() has none)")
    bare = SCENE.with_(body=(Body(name="b", position=X),))
    assert without(massless_links=False).missing(bare) is None, "without any mass no link is massless"


# --- the interface ----------------------------------------------------------------------------------------
def test_what_an_engine_does_unless_it_says_otherwise(monkeypatch):
    made = Made()
    assert (made.rounding, made.compile_seconds) == (2.0**-52, 0.0) and made.supports == Supports()
    assert [setting.options for setting in made.settings_of(SCENE, "a")] == [{"step": 0.1}, {"step": 0.01}]
    assert (
        made.settings_of(SCENE, "c") == [] and not made.serves(SCENE, "c") and made.serves(SCENE, "b") is True
    )
    assert [setting.family for setting in made.best_settings(SCENE)] == ["a", "a"]
    assert (
        made.has_family("a") is False
        and made.family_parts() == {}
        and made.own_code(SCENE, Setting("a")) == ""
    )
    assert made.refuses(SCENE) is None and made.version() == module.metadata.version("numpy")
    assert made.cannot(SCENE).reason.startswith("joint 'H'")
    made.supports = ALL
    assert made.cannot(SCENE) is None
    monkeypatch.setattr(Made, "refuses", lambda self, scene: Cannot(Owner.ENGINE, f"no {scene.name}"))
    assert made.cannot(SCENE) == Cannot(Owner.ENGINE, "no s")
    seen: list[str] = []
    monkeypatch.setattr(module, "import_module", seen.append)
    made.prepare(["a"])
    made.modules = ("one", "two")
    made.prepare(["a"])
    assert seen == ["one", "two"]


# --- names of engines -------------------------------------------------------------------------------------
@pytest.fixture
def points(monkeypatch) -> None:
    """Two installed engines that packages register; mujoco and simbody are installed of the others."""
    made = Made()
    entries = [
        SimpleNamespace(name="other", load=lambda: made),
        SimpleNamespace(name="wrong", load=lambda: "no engine"),
    ]
    monkeypatch.setattr(
        module.metadata, "entry_points", lambda group: entries if group == "crosscheck.engines" else []
    )


def test_names_of_engines(points, monkeypatch):
    names = module.engine_names()
    assert names[:4] == ("mbref", "mujoco", "pinocchio", "exudyn") and names[4:7] == (
        "simbody",
        "sundials",
        "ondsel",
    )
    assert names[7:9] == ("casadi", "heyoka") and names[9:15] == (
        "drake",
        "dart",
        "bullet",
        "mjx",
        "warp",
        "newton",
    )
    assert names[15:] == ("other", "wrong")
    monkeypatch.setattr(module, "installed", lambda name: name in ("mbref", "simbody", "drake", "wrong"))
    assert module.default_engines() == ("mbref", "mujoco", "pinocchio", "exudyn", "simbody", "other", "wrong")
    assert module.all_engines() == ("mbref", "simbody", "drake", "wrong")


def test_engines_by_name(points, monkeypatch, tmp_path: Path):
    assert module.engine("mbref").name == "mbref" and isinstance(module.engine("other"), Made)
    with pytest.raises(LookupError, match=r"^'wrong' is not an engine: the object does not implement"):
        module.engine("wrong")
    with pytest.raises(
        LookupError, match=r"^unknown engine 'mujocu'; known: mbref, mujoco, .*, wrong.*mujoco"
    ):
        module.engine("mujocu")
    (tmp_path / "engine_of_my_own.py").write_text(
        "from tests.crosscheck.test_engine_interface_by_hand import Made\nMINE = {'a': 1}\nENGINE = Made()\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    for _ in range(2):
        assert type(module.engine("engine_of_my_own:ENGINE")).__name__ == "Made"
    assert sys.path.count(str(tmp_path)) == 1
    with pytest.raises(LookupError, match=r"^'engine_of_my_own:MINE' is not an engine"):
        module.engine("engine_of_my_own:MINE")
    with pytest.raises(AttributeError, match="A:B"):
        module.engine("engine_of_my_own:A:B")
    del sys.modules["engine_of_my_own"]


def test_engines_that_are_installed(monkeypatch):
    made = Made()
    monkeypatch.setattr(module, "engine", lambda name: made)
    assert module.installed("made") is True
    made.package = "a-package-that-nobody-has"
    assert module.installed("made") is False
