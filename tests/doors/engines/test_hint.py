"""The hint for a failing engine, the example engine with one known defect, names the wrong term."""

import importlib.util
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.conformance import suite, trial
from crosscheck.conformance.hint import Failure, hint
from crosscheck.conformance.mechanisms.specimens import specimens
from crosscheck.conformance.runners import InProcess
from crosscheck.conformance.suite import held_against
from crosscheck.engine import Setting, engine

PATH = Path(__file__).parents[3] / "examples" / "spatial_engine" / "spatial_engine.py"
SPEC = importlib.util.spec_from_file_location("spatial_engine_with_defects", PATH)
example = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(example)
KNOWN = {specimen.scene.name: specimen for specimen in specimens()}


class Defective(example.Mechanism):
    """Equations of the example engine with one ``defect``: "gravity" is left out or has 102 %, "gyroscopic"
    moments ω × Jω, accelerations of a "driver" or a "moment" have the opposite sign, "gamma" (of J a = γ)
    lacks its velocity terms, the last body's "inertia" has 101 %."""

    defect = ""

    def __init__(self, scene):
        factor = {"gravity": 0.0, "gravity of 102 %": 1.02}.get(self.defect, 1.0)
        super().__init__(scene.with_(gravity=tuple(factor * g for g in scene.gravity)))
        if self.defect == "inertia of 101 %":
            self.inertia[-1] *= 1.01

    def loads(self, state):
        force, moment = super().loads(state)
        if self.defect == "moment":
            for load in self.scene.load:
                if load.type == "moment":
                    moment[self.scene.body_index(load.body)] -= 2 * np.array(load.moment)
        if self.defect == "gyroscopic":
            for b in range(self.count):
                inertia = state.turn[b] @ self.inertia[b] @ state.turn[b].T
                moment[b] += 2 * np.cross(state.spin[b], inertia @ state.spin[b])
        return force, moment

    def rows(self, mate, t, state):
        if self.defect == "gamma":
            still = state._replace(velocity=0 * state.velocity, spin=0 * state.spin)
            return super().rows(mate, t, state)[0], super().rows(mate, t, still)[1]
        if self.defect == "driver" and mate.driver:
            rows, gamma = super().rows(mate, t, state)
            return rows, np.append(gamma[:-1], gamma[-1] - 2 * example.driven(mate.driver, t))
        return super().rows(mate, t, state)


def runner_with(defect, monkeypatch):
    """Return a runner of the example engine with a defect, or with none ("")."""
    monkeypatch.setattr(example, "Mechanism", type("Mechanism", (Defective,), {"defect": defect}))
    return InProcess(example.ENGINE, "spatial")


@pytest.mark.parametrize(
    ("defect", "names", "says"),
    [
        ("gravity", ("pendulum",), "look at the gravity: gravity left out explains"),
        ("gyroscopic", ("tumbling body",), "velocity terms: the gyroscopic moments ω × Jω of opposite"),
        ("gamma", ("spinning loop",), "velocity terms: the velocity part of γ in J a = γ left out"),
        ("driver", ("driven", "cylindrical driver"), "drivers: the drivers' accelerations in γ of opposite"),
        ("gravity of 102 %", ("free_fall", "revolute joint"), "look at the gravity: gravity times 1.02"),
        ("moment", ("moment load", "pushed body"), "loads: every moment of opposite sign explains 2 of 2"),
        ("inertia of 101 %", ("several springs",), "mass matrix: the inertia of body 'body' times 1.01"),
    ],
)
def test_hint_names_the_term_of_the_equations_that_is_wrong(defect, names, says, monkeypatch):
    """The engine has the ``defect`` that `Defective` describes. It is said to have failed the check `truth`
    on the scenes ``names``; the hint has the words ``says``."""
    runner = runner_with(defect, monkeypatch)
    found = hint(runner, [Failure(KNOWN[name], "truth") for name in names])
    assert says in found, found


def test_hint_for_an_engine_with_right_accelerations_points_at_its_integration(monkeypatch):
    """The example engine without a defect (""), and the tiny one at steps so long that it violates joints by
    1.6e-3, where its rows differ from the judge's, are said to have failed a check."""
    tiny = runpy.run_path(str(PATH.parents[1] / "tiny_engine" / "tiny_engine.py"))["Tiny"]
    steps = {"settings": lambda _, scene: [Setting("rk4", {"step": scene.duration / n}) for n in (40, 80)]}
    coarse = InProcess(type("Coarse", (tiny,), steps)())
    for name, runner in (("pendulum", runner_with("", monkeypatch)), ("whirling crank", coarse)):
        found = hint(runner, [Failure(KNOWN[name], "truth")])
        assert f"begin with the scene {name!r}, check truth" in found
        assert "accelerations agree with the judge's, so look at the integration" in found


def test_result_of_verify_on_a_failing_engine_has_the_hint(monkeypatch):
    """The engine without gravity fails on a free fall; the hint is in the result and in its record."""
    failing = held_against(runner_with("gravity", monkeypatch), [KNOWN["free_fall"]])
    assert "gravity left out explains 1 of 1 scenes" in failing.hint and not failing.conforms
    assert failing.to_record()["hint"] == failing.hint


class Geared(type(engine("mbref"))):
    """mbref with a ``defect``: ``factor`` times the armatures, no coupling, positions 0.1 mm aside, springs
    without natural displacements, stops with restitution², no impulses, or reactions of J alone."""

    def __init__(self, defect: str, factor=1.0):
        self.defect, self.factor = defect, factor

    def run(self, scene, times, setting):
        changes = {"coupling": {"coupling": ()}}.get(self.defect, {})
        if self.defect == "armature":
            heavier = [x.model_copy(update={"armature": self.factor * x.armature}) for x in scene.joint]
            changes = {"joint": heavier}
        if self.defect == "natural":
            changes = {"load": [x.model_copy(update={"natural_displacement": 0.0}) for x in scene.load]}
        if self.defect == "stop":
            stop = scene.joint[0].stop.model_copy(update=self.factor)
            changes = {"joint": [scene.joint[0].model_copy(update={"stop": stop}), *scene.joint[1:]]}
        found = super().run(scene.with_(**changes), times, setting)
        if self.defect == "impulses":
            still = [replace(e, impulses={n: 0 * x for n, x in e.impulses.items()}) for e in found.events]
            return replace(found, events=tuple(still))
        if self.defect == "reactions":
            return replace(found, reactions={n: x * (n == "J") for n, x in found.reactions.items()})
        return replace(found, position=found.position + 1e-4) if self.defect == "output" else found


@pytest.mark.parametrize(
    ("defect", "scene", "says"),
    [
        (("armature", 0.0), "armature pendulum", "the armature of joint 'A' left out explains 1 of 1"),
        (("armature", 2.0), "armature pendulum", "the armature of joint 'A' counted twice explains 1 of 1"),
        (("output",), "armature pendulum", "accelerations agree with the judge's"),
        (("coupling",), "gear pair", "look at the constraints: coupling 'teeth' left out"),
        (("natural",), "slide_spring load", "the natural displacement of load[0] (slide_spring at 'J') left"),
        (("stop", {"restitution": 0.36}), "end stop", "look at the times of its events and at its impacts"),
    ],
)
def test_hint_names_a_wrong_armature_or_coupling_and_none_for_a_wrong_output(defect, scene, says):
    """`Geared` has the ``defect``. Positions that are given 0.1 mm aside leave accelerations right."""
    found = hint(InProcess(Geared(*defect), "mbref"), [Failure(KNOWN[scene], "truth")])
    assert says in found, found


@pytest.mark.parametrize(
    ("defect", "scene", "check", "says"),
    [
        (("armature", 0.0), "gears in motion", "truth", "most of 'hub'"),
        (("armature", 0.0), "cam in motion", "truth", "most of 'body'"),
        (("coupling",), "sum of coordinates", "closure", "most at 'sum'"),
        (("reactions",), "gears in motion", "balance", ""),
        (("stop", {"restitution": 0.36}), "end stop", "truth", "most of 'body'"),
        (("impulses",), "latch", "balance", ""),
        (("impulses",), "interval", "balance", ""),
    ],
)
def test_fault_of_couplings_armatures_and_events_fails_a_check_that_the_sound_engine_passes(
    defect, scene, check, says
):
    found, sound = (
        suite.verdict_on(check, trial.set_up(InProcess(Geared(*each), "mbref"), KNOWN[scene]))
        for each in (defect, ("",))
    )
    assert (found.status, sound.status) == (suite.FAIL, suite.PASS) and says in found.reason, (found, sound)
