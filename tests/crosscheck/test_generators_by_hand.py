"""heyoka, CasADi and DART without their packages / what they are asked for and what is kept, by hand."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Owner, Setting
from crosscheck.engines import terms
from crosscheck.engines.casadi import adapter as casadi
from crosscheck.engines.casadi import library
from crosscheck.engines.compiler import NoLibrary
from crosscheck.engines.dart import adapter as dart
from crosscheck.engines.dart import model as of_dart
from crosscheck.engines.heyoka import adapter as heyoka
from mbref.scene import Body, Coupling, Revolute, Scene

BODY = Body(name="b", mass=4.0, inertia=(1.0, 2.0, 2.5), position=(1.0, 0.0, 0.0))
HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
SCENE = Scene(name="s", body=(BODY,), joint=(HINGE,), duration=2.0)


def clock(monkeypatch: pytest.MonkeyPatch, module: Any) -> None:
    """CPU times 1, 3, 7, 15 … s."""
    times = (2.0**k - 1 for k in itertools.count(1))
    monkeypatch.setattr(module.time, "process_time", lambda: next(times))


# --- heyoka -----------------------------------------------------------------------------------------------
def test_settings_of_heyoka() -> None:
    found = heyoka.ENGINE.settings(SCENE)
    assert {setting.family for setting in found} == {"taylor"}
    assert [setting.options for setting in found] == [
        {"rtol": r} for r in (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12)
    ]


def test_the_clock_of_a_run_of_heyoka(monkeypatch: pytest.MonkeyPatch) -> None:
    """The construction takes from 1 s to 3 s, the run from 7 s to 15 s."""
    clock(monkeypatch, heyoka)
    equations = SimpleNamespace(start=np.array([1.0, 2.0]))
    made = SimpleNamespace(time=5.0, state=np.zeros(2))
    monkeypatch.setattr(heyoka, "equations_of", lambda scene: equations)
    monkeypatch.setattr(heyoka, "_integrator", lambda scene, rtol: made)
    states = np.array([[1.0, 2.0], [3.0, 4.0]])
    given: list[Any] = []
    monkeypatch.setattr(
        heyoka, "_propagated", lambda *parts: given.append(parts[1:]) or (states, "success", 7)
    )
    monkeypatch.setattr(heyoka.Heyoka, "_trajectory", lambda self, *parts: parts)
    setting, times = Setting("taylor", {"rtol": 1e-6}), np.array([0.0, 1.0])
    scene, at, kept_setting, found, failure, cost = heyoka.ENGINE.run(SCENE, times, setting)  # type: ignore[misc]
    assert scene is SCENE and at is times and kept_setting is setting and failure is None
    assert found.tolist() == states.tolist() and (cost.seconds, cost.build_seconds, cost.steps) == (
        8.0,
        2.0,
        7,
    )
    assert made.time == 0.0 and made.state.tolist() == [1.0, 2.0] and given == [(times, equations.start)]


def test_an_integrator_of_heyoka_is_kept_by_everything_that_makes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "heyoka", SimpleNamespace(__version__="1.5"))
    monkeypatch.setattr(heyoka.platform, "node", lambda: "machine")
    seen: list[Any] = []
    monkeypatch.setattr(heyoka, "origin", lambda *parts: seen.append(parts) or "origin")

    def made_once(*parts: Any) -> Any:
        seen.append(parts[:3])
        return SimpleNamespace(read_bytes=lambda: heyoka.pickle.dumps("integrator"))

    monkeypatch.setattr(heyoka.kept, "made_once", made_once)
    heyoka._integrator.cache_clear()
    assert heyoka._integrator(SCENE, 1e-6) == "integrator"
    heyoka._integrator.cache_clear()
    source = Path(heyoka.__file__).read_text()
    assert seen == [(SCENE, "1e-06", "1.5", "machine", source), ("heyoka", "origin", ".pickle")]


# --- CasADi -----------------------------------------------------------------------------------------------
def test_refusals_of_casadi(monkeypatch: pytest.MonkeyPatch) -> None:
    """The refusals of the equations come first, and then a missing compiler."""
    monkeypatch.setattr(casadi.Generator, "refuses", lambda self, scene: None)
    monkeypatch.setattr(casadi, "why_not", lambda: "")
    assert casadi.ENGINE.refuses(SCENE) is None
    monkeypatch.setattr(casadi, "why_not", lambda: "no C compiler")
    found = casadi.ENGINE.refuses(SCENE)
    assert found is not None and found == casadi.Cannot(Owner.ADAPTER, "no C compiler")
    monkeypatch.setattr(casadi.Generator, "refuses", lambda self, scene: "equations")
    assert casadi.ENGINE.refuses(SCENE) == "equations"


def test_the_clock_of_a_run_of_casadi(monkeypatch: pytest.MonkeyPatch) -> None:
    """The construction takes from 1 s to 3 s, the run from 7 s to 15 s."""
    clock(monkeypatch, casadi)

    class Run:
        counts = np.array([7, 1, 2, 5])

        def __init__(self, times: Any, start: Any) -> None:
            assert start == "start"

        def advance(self, compiled: Any, setting: Setting) -> None:
            assert compiled == ("library", 0.25)

        def reached(self) -> str:
            return "reached"

        def failure(self) -> str:
            return "failure"

    monkeypatch.setattr(casadi, "equations_of", lambda scene: SimpleNamespace(start="start"))
    monkeypatch.setattr(casadi, "library", lambda scene, beta: ("library", beta))
    monkeypatch.setattr(casadi, "_Run", Run)
    monkeypatch.setattr(casadi.CasADi, "_trajectory", lambda self, *parts: parts)
    setting = Setting(casadi.PLAIN, {"rtol": 1e-6, "beta": 0.25})
    scene, _, _, found, failure, cost = casadi.ENGINE.run(SCENE, np.zeros(2), setting)  # type: ignore[misc]
    assert scene is SCENE and (found, failure) == ("reached", "failure")
    assert (cost.seconds, cost.build_seconds) == (8.0, 2.0)
    assert (cost.steps, cost.rejected, cost.rhs) == (7, 1, 2)


def test_the_origin_of_casadi_s_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "C", SimpleNamespace(path=lambda: "cc"))
    monkeypatch.setattr(library.platform, "node", lambda: "machine")
    monkeypatch.setattr(library.metadata, "version", lambda name: f"{name} 3")
    monkeypatch.setattr(library, "origin", lambda *parts: parts)
    found: Any = library._origin(SCENE, 0.5)
    assert found[:4] == (SCENE, "0.5", "casadi 3", "cc") and found[4:-3] == library.FLAGS
    sources = Path(library.__file__).read_text(), library.INTEGRATOR.read_text()
    assert found[-3:] == ("machine", *sources)


def test_casadi_s_code_is_compiled_from_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands: list[Any] = []

    def run(command: list[str]) -> None:
        commands.append((command, Path(command[-4]).read_text()))

    monkeypatch.setattr(library, "C", SimpleNamespace(path=lambda: "cc", run=run))
    library._compile("int x;", tmp_path / "lib.so")
    [(command, text)] = commands
    assert text == "int x;" and command[0] == "cc" and tuple(command[1:-4]) == library.FLAGS
    assert command[-3:] == ["-o", str(tmp_path / "lib.so"), "-lm"] and command[-4].endswith("code.c")
    assert library.why_not() == ""

    def missing() -> str:
        raise NoLibrary("no C compiler is installed")

    monkeypatch.setattr(library, "C", SimpleNamespace(path=missing))
    assert library.why_not() == "no C compiler is installed"


def test_functions_of_casadi_are_in_its_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rates and settled states, with common parts computed once; each has its wrapper and its memory."""
    added: list[Any] = []

    class Code:
        def __init__(self, name: str) -> None:
            assert name == "code.c"

        def add(self, function: Any) -> None:
            added.append(function)

        def dump(self) -> str:
            return "dumped\n"

    def function(name: str, given: Any, found: Any, options: Any) -> Any:
        return SimpleNamespace(name=name, given=given, found=found, options=options, sz_w=lambda: 5)

    equations = SimpleNamespace(
        n=1,
        accelerations=lambda q, v, arithmetic, beta: [("a", q, v, beta)],
        settled=lambda q, v, arithmetic: (["sq"], ["sv"]),
    )
    package = SimpleNamespace(
        sin="sin",
        cos="cos",
        SX=SimpleNamespace(sym=lambda name, count: (name, count)),
        vertsplit=lambda symbols: ["q", "v"],
        vertcat=lambda *parts: parts,
        Function=function,
        CodeGenerator=Code,
    )
    monkeypatch.setitem(sys.modules, "casadi", package)
    monkeypatch.setattr(library, "equations_of", lambda scene: equations)
    monkeypatch.setattr(library, "symbolic", lambda sin, cos: (sin, cos))
    monkeypatch.setattr(library, "Symbol", lambda entry: entry)
    monkeypatch.setattr(library, "bare", list)
    text = library._source(SCENE, 0.5)
    rates, settled = added
    assert (rates.name, settled.name) == ("rates", "settled") and rates.given == [("y", 2)] == settled.given
    assert rates.found == [("v", ("a", ["q"], ["v"], 0.5))] and settled.found == [("sq", "sv")]
    assert rates.options == settled.options == {"cse": True}
    assert text.startswith("dumped\n#define STAGES 12\n") and "#define N 2\n" in text
    for macro, name in (("RATES", "rates"), ("SETTLED", "settled")):
        assert library.WRAPPER.format(macro=macro, name=name, work=5) in text


# --- DART -------------------------------------------------------------------------------------------------
def test_settings_of_dart() -> None:
    """Chains of joints have auxiliary bodies of 1e-24 of the mass."""
    assert dart.DEFAULT_STEPS == {"defaults": 1e-3} and of_dart.NEGLIGIBLE == 1e-24
    assert dart.OWN_STEPS == {"defaults": {"erp": 0.01}, "balls": {"erp": 0.5}} and dart.ENGINE.finer == 2
    geared = SCENE.with_(
        body=(BODY, BODY.model_copy(update={"name": "c"})),
        joint=(HINGE, HINGE.model_copy(update={"name": "I", "bodies": ("ground", "c")})),
        coupling=(Coupling(name="G", joints=("H", "I"), ratio=2.0),),
    )
    rotor = SCENE.with_(joint=(HINGE.model_copy(update={"armature": 0.1}),))
    for family, plain, others in (
        (terms.FAMILY, True, True),
        ("defaults", True, False),
        ("balls", True, False),
        ("other", False, False),
    ):
        assert dart.ENGINE.serves(SCENE, family) is plain
        assert dart.ENGINE.serves(geared, family) is dart.ENGINE.serves(rotor, family) is others


@pytest.mark.parametrize(("family", "as_balls"), [("defaults", False), ("balls", True)])
def test_a_world_of_dart_closes_hinges_and_balls(
    family: str, as_balls: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dart, "spanning_tree", lambda scene, closes: ("tree", scene.name, closes))
    monkeypatch.setattr(dart, "Mechanism", lambda scene, tree: ("mechanism", scene.name, tree))
    monkeypatch.setattr(dart, "_World", lambda *parts: parts)
    found: Any = dart.ENGINE.world(SCENE, Setting(family, {"erp": 0.25}))
    tree = ("tree", "s", ("spherical", "revolute"))
    assert found == (("mechanism", "s", tree), as_balls, 0.25)
