"""Published problems / printed numbers of the Andrews mechanism, parts of each problem, and limits."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from crosscheck.judge import precision, push_difference
from crosscheck.judge.published import ANGLES, PUBLISHED, STARTS
from crosscheck.judge.richardson import _order
from crosscheck.judge.start import _up_to_turns
from mbref.scene import Body, Coupling, Cylindrical, Revolute, Scene

# Test Set for IVP Solvers, release 2.4: start and reference solution at 0.03 s, angles and then rates
START = (-0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885884, 0.487364979543842550)
START += (-0.222668390165885884, 1.23054744454982119)
END = (15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948, 0.5244099658805304)
END += (0.5347301163226948, 1.048080741042263)
RATES = (1139.920302151208, -1424.379294994111, 11.03291221937134, 19.29337464421385, 0.5735699284790808)
RATES += (-19.29337464421385, 0.3231791658026955)


def test_numbers_of_the_andrews_mechanism():
    assert list(STARTS) == list(ANGLES) and tuple(STARTS.values()) == START
    values = PUBLISHED["A03"].values
    assert [values[name] for name in ANGLES] == pytest.approx(END, rel=1e-14, abs=0.0)
    assert [values[f"{name}'"] for name in ANGLES] == pytest.approx(RATES, rel=1e-14, abs=0.0)
    assert len(values) == 14


@pytest.mark.parametrize("name", PUBLISHED)
def test_parts_of_a_problem(name):
    """Words end with a unit or speak of a relative error; a source names a publication or the reason."""
    problem = PUBLISHED[name]
    assert isinstance(problem.scene, str) and isinstance(problem.time, float) and problem.time < 11.0
    assert problem.samples in (301, 401) and isinstance(problem.values, dict)
    assert callable(problem.observe) and callable(problem.measure) and problem.observe is not problem.measure
    assert isinstance(problem.acceptance, float) and problem.acceptance <= 1e-3
    assert (
        "(J)" in problem.words
        or "(m)" in problem.words
        or "(rad)" in problem.words
        or ("relative error" in problem.words)
    )
    assert any(word in problem.source for word in ("IFToMM", "18", "19", "20", "Test Set", "not unique"))
    assert "IFToMM" not in problem.words and "error" not in problem.source


# --- limits -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("apart", [(1.0, math.nan), (math.inf, 1.0), (1.0, math.inf), (0.0, 1.0)])
def test_differences_that_are_not_finite_have_no_order(apart):
    assert _order((4.0, 2.0, 1.0), apart) is None


def test_numbers_are_single_relative_to_their_scale(monkeypatch):
    """A millimetre is small in a scene of a thousand kilometres, and large in one of a millimetre."""
    thirds = (np.array([1.0, 2.0, 4.0, 5.0, 7.0, 8.0]) / 3e3).astype(np.float32).astype(float)[:, None]
    monkeypatch.setattr(precision, "_of_joints", lambda scene, run: [])
    for scale, found in ((1e6, []), (1e-3, ["place"])):
        items = [("place", thirds, np.array([scale]))]
        monkeypatch.setattr(precision, "_of_bodies", lambda scene, run, items=items: items)
        assert precision.single_precision(None, None) == found


def test_reactions_are_compared_at_their_last_sample():
    """0.5 N of 5 N; earlier samples do not count."""
    body = Body(name="b", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))
    hinge = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    scene = Scene(name="s", body=(body,), joint=(hinge,))

    def run(*last: float) -> SimpleNamespace:
        wrenches = np.array([[90.0] * 6, [70.0] * 6, [*last, 0.0, 0.0, 0.0]])
        place, turn = np.tile([1.0, 0.0, 0.0], (3, 1, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (3, 1, 1))
        times = np.array([0.0, 0.5, 1.0])
        return SimpleNamespace(reactions={"A": wrenches}, position=place, orientation=turn, times=times)

    found, what = push_difference._reactions(scene, run(3.0, 4.0, 0.0), run(3.0, 4.5, 0.0), 1e-9)
    assert found == pytest.approx(0.1) and what == "reactions"


def turned(ratio: float, gap: float, first: str = "angle") -> float:
    body = Body(name="b", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))
    joints = [
        Cylindrical(name=name, bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        for name in "AB"
    ]
    coupling = Coupling(name="G", joints=("A", "B"), ratio=ratio, coordinates=(first, "angle"))
    return _up_to_turns(Scene(name="s", body=(body,), joint=joints, coupling=(coupling,)), coupling, gap)


@pytest.mark.parametrize(
    ("ratio", "turns", "first", "left"),
    [
        (2.5, 0.5, "angle", 0.0),
        (2.0, 0.5, "angle", 0.5),
        (2.5, 0.5, "displacement", 0.5),
        (0.3, 100.0, "displacement", 0.0),
        (0.3, 101.0, "displacement", 1.0),
        (0.3, -101.25, "displacement", 1.25),
        (3.0, 400.0, "angle", 0.0),
        (3.0, 401.0, "angle", 1.0),
    ],
)
def test_full_turns_of_both_joints_are_free(ratio, turns, first, left):
    """A hundred turns of the second joint, and the ratio times a hundred of the first one."""
    assert turned(ratio, 2 * math.pi * turns, first) == pytest.approx(2 * math.pi * left, abs=1e-9)
