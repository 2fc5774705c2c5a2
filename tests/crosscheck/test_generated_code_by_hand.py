"""Code that engines generate / plain numbers: symbols, ends of runs, compiler commands and tables."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio
import pytest

from crosscheck.engines.casadi import adapter as casadi_adapter
from crosscheck.engines.compiler import NoLibrary
from crosscheck.engines.pinocchio import compiled_run, library
from crosscheck.engines.symbolic.symbols import Symbol, bare, symbolic
from mbref.scene import Driver, Sine
from mbref.trajectory import Outcome


def value(result: object) -> float:
    assert isinstance(result, Symbol)
    return result.value


def test_symbols_follow_the_rules_of_numbers():
    x, y = Symbol(3.0), Symbol(0.5)
    assert [value(r) for r in (x + y, x - y, x * y, x / y, -x)] == [3.5, 2.5, 1.5, 6.0, -3.0]
    assert [value(r) for r in (x + 2, 2 + x, x - 2, 2 - x, x * 2, 2 * x, x / 2, 6 / x)] == [
        5.0,
        5.0,
        1.0,
        -1.0,
        6.0,
        6.0,
        1.5,
        2.0,
    ]


def test_zeros_and_ones_leave_no_trace_in_the_code():
    x = Symbol(3.0)
    assert x + 0 is x and 0 + x is x and x - 0.0 is x and x * 1 is x and 1.0 * x is x and x / 1 is x
    assert (x * 0, 0 * x, 0 / x) == (0.0, 0.0, 0.0) and value(0 - x) == -3.0
    zero, one = Symbol(0.0), Symbol(1.0)
    assert x + zero is not x and isinstance(x * zero, Symbol) and x * one is not x and x / one is not x
    assert bare([x, 2, 0.5]) == [3.0, 2.0, 0.5]
    arithmetic = symbolic(math.sin, math.cos)
    assert value(arithmetic.sin(x)) == math.sin(3.0) and value(arithmetic.cos(x)) == math.cos(3.0)
    assert np.array([x, 1.0]) @ np.array([2.0, zero]) is not None


# --- CasADi -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("status", "outcome", "says"),
    [
        (1, Outcome.NOT_FINITE, "the motion is not finite after 0.25 s"),
        (2, Outcome.STEP_FAILED, "no step after 0.25 s is short enough for the tolerance"),
        (3, Outcome.STEP_FAILED, "7 steps have only reached 0.25 s"),
    ],
)
def test_ends_of_integrations_in_c(status, outcome, says):
    run = casadi_adapter._Run(np.array([0.0, 0.5, 1.0]), np.array([1.0, 2.0]))
    assert run.failure() is None and run.reached().shape == (0, 2) and run.samples.shape == (3, 2)
    run.status, run.clock[0], run.counts[:] = status, 0.25, (7, 1, 2, 2)
    failure = run.failure()
    assert (failure.outcome, failure.t, str(failure)) == (outcome, 0.25, says)
    assert run.reached().shape == (2, 2)


# --- the library of Pinocchio -----------------------------------------------------------------------------
@pytest.fixture
def prefix(tmp_path, monkeypatch) -> Path:
    """A folder with headers and library of Pinocchio and of Eigen, and the package below."""
    for name in ("include/pinocchio", "include/eigen3/Eigen", "lib/python/site-packages/pinocchio"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "lib" / "libpinocchio_default.so").touch()
    monkeypatch.setattr(
        pinocchio, "__file__", str(tmp_path / "lib/python/site-packages/pinocchio/__init__.py")
    )
    monkeypatch.setattr(library, "CXX", SimpleNamespace(path=lambda: "c++", run=None))
    library._origin.cache_clear()
    yield tmp_path
    library._origin.cache_clear()


def test_the_compiler_s_command(prefix):
    command = library._command(Path("x.so"))
    assert command == [
        "c++",
        *library.FLAGS,
        f"-isystem{prefix / 'include'}",
        f"-isystem{prefix / 'include' / 'eigen3'}",
        str(library.SOURCE),
        "-o",
        "x.so",
        str(prefix / "lib" / "libpinocchio_default.so"),
        f"-Wl,-rpath,{prefix / 'lib'}",
    ]
    assert library.why_not() == ""


def test_what_is_missing_for_the_library(prefix, monkeypatch):
    (prefix / "lib" / "libpinocchio_default.so").unlink()
    assert library.why_not() == "the library of Pinocchio is not installed beside its headers"
    monkeypatch.setattr(library, "EIGEN", prefix / "nowhere")
    (prefix / "include" / "eigen3" / "Eigen").rmdir()
    assert library.why_not() == "the headers of Eigen are not installed (package cmeel-eigen)"
    (prefix / "system" / "Eigen").mkdir(parents=True)
    monkeypatch.setattr(library, "EIGEN", prefix / "system")
    assert library._eigen(prefix) == prefix / "system"
    (prefix / "include" / "pinocchio").rmdir()
    assert library.why_not() == "the headers of Pinocchio are not installed beside its Python package"


def test_the_library_is_compiled_once(prefix, monkeypatch):
    asked = []
    kept = SimpleNamespace(
        hashed=lambda *parts: asked.append(parts) or "hash",
        kept=lambda *given: asked.append(given) or None,
        keep=lambda folder, origin, suffix, make: (
            asked.append((folder, origin, suffix)) or prefix / "made.so"
        ),
    )
    monkeypatch.setattr(library, "kept", kept)
    library.library.cache_clear()
    with pytest.raises(NoLibrary, match=r"^the compiled library cannot be loaded: .*made\.so"):
        library.library()
    (version, *command, source), *places = asked
    assert version == pinocchio.__version__ and command == library._command(Path("library"))
    assert source == library.SOURCE.read_text() and places == [(library.FOLDER, "hash", ".so")] * 2
    library.library.cache_clear()


def test_rows_of_joints_for_the_library():
    """Kind, parent, axis, place, mass, lever and moments of inertia of each joint."""
    inertia = np.arange(9.0).reshape(3, 3)
    joint = SimpleNamespace(mass=2.0, lever=np.array([0.1, 0.2, 0.3]), inertia=inertia)
    model = SimpleNamespace(
        inertias=[None, joint],
        parents=[0, 0],
        jointPlacements=[None, SimpleNamespace(translation=np.array([4.0, 5.0, 6.0]))],
    )
    [kind, *_] = compiled_run.KINDS
    motion = SimpleNamespace(kind=kind, axis=(0.0, 0.0, 1.0))
    [row] = compiled_run._joints(SimpleNamespace(model=model, motions=[motion]))
    numbers = [compiled_run.KINDS[kind], 0.0, 0.0, 0.0, 1.0, 4.0, 5.0, 6.0, 2.0, 0.1, 0.2, 0.3, *range(9)]
    assert row.tolist() == numbers
    assert compiled_run._joints(SimpleNamespace(model=model, motions=[])).shape == (0, 21)


def test_rows_of_closures_and_drivers():
    place, other = (SimpleNamespace(translation=np.arange(3.0) + k) for k in (1, 4))
    kinds = SimpleNamespace(CONTACT_6D="six", CONTACT_3D="three")
    closures = [
        SimpleNamespace(type=kind, joint1_id=2, joint2_id=5, joint1_placement=place, joint2_placement=other)
        for kind in ("six", "three")
    ]
    mechanism = SimpleNamespace(pin=SimpleNamespace(ContactType=kinds), closures=closures)
    numbers = [2.0, 5.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert compiled_run._closures(mechanism).tolist() == [[6.0, *numbers], [3.0, *numbers]]
    mechanism.closures = []
    assert compiled_run._closures(mechanism).shape == (0, 9)
    sine = Sine(amplitude=0.5, frequency=2.0, phase=0.25)
    driven = compiled_run._drive(3, 4, Driver(joint="A", polynomial=(-0.5 * math.sin(0.25), 2.0), sine=sine))
    assert driven.tolist() == [3.0, 4.0, compiled_run.DRIVEN_ARMATURE, 0.5, 2.0, 0.25]
    assert compiled_run._drive(3, 4, Driver(joint="A", polynomial=(0.0, 1.0))).tolist()[3:] == [0.0] * 3
