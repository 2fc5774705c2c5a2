"""Conformance suite: a sound engine / every property; a fault put in by hand / the property that tells."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.cli.commands import main
from crosscheck.conformance import properties, suite, trial
from crosscheck.conformance.features import undetermined
from crosscheck.conformance.relations import shaken
from crosscheck.conformance.trial import Specimen, specimens
from crosscheck.engine import Cannot, Engine, Owner, Setting
from crosscheck.judge.truth import truth_for
from crosscheck.processes.pool import Observation
from mbref.scene import Scene
from mbref.trajectory import Outcome, Trajectory

SPECIMENS = {specimen.scene.name: specimen for specimen in specimens()}
ASKEW = {"rotated", "turned", "mirrored"}  # an error along the world's axes shows in every turned scene


class Exact(Engine):
    """The exact motion, with a fault: ``fault(trajectory, scene, calls)`` gives what the engine returns."""

    name, package = "exact", "exact"

    def __init__(self, fault: Callable[[Trajectory, Scene, int], Trajectory]):
        self.fault, self.calls = fault, 0

    def version(self) -> str:
        return "1"

    def cannot(self, scene: Scene) -> Cannot | None:
        return None if scene.has_mass() else Cannot(Owner.MODEL, "bodies have no mass")

    def settings(self, scene: Scene) -> list[Setting]:
        return [Setting("only", {"step": 0.1})]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        self.calls += 1
        truth = truth_for(scene)
        assert truth is not None, scene.name
        motion = replace(truth.poses(times), t_end=float(times[-1]), acceleration=None)
        return self.fault(replace(motion, angular_acceleration=None), scene, self.calls)


def shifted(run: Trajectory, by: float) -> Trajectory:
    return replace(run, position=run.position + by)


def weighed(run: Trajectory, scene: Scene, factor: float) -> Trajectory:
    return shifted(run, factor * sum(body.mass for body in scene.body))


Fault = Callable[[Trajectory, Scene, int], Trajectory]
FAULTS: dict[str, tuple[Fault, set[str]]] = {
    "none": (lambda run, scene, calls: run, set()),
    "late": (lambda run, scene, calls: replace(run, times=run.times * (1 + 1e-15)), {"times"}),
    "stretched": (
        lambda run, scene, calls: replace(run, orientation=1.001 * run.orientation),
        ASKEW | {"unit", "energy", "translated"},
    ),
    "apart": (
        lambda run, scene, calls: shifted(run, 1e-6 * (run.times[:, None, None] > 0)),
        ASKEW | {"closure"},
    ),
    "fast": (lambda run, scene, calls: replace(run, velocity=1.01 * run.velocity), {"velocities", "energy"}),
    "backwards": (
        lambda run, scene, calls: replace(run, angular_velocity=-run.angular_velocity),
        {"velocities", "energy"},
    ),
    "drifting": (lambda run, scene, calls: shifted(run, 1e-14 * calls), {"repeated"}),
    "sampled": (lambda run, scene, calls: shifted(run, 1e-8 * len(run.times)), ASKEW | {"resampled"}),
    "placed": (
        lambda run, scene, calls: shifted(run, 1e-7 * min(j.anchor[0] for j in scene.joint)),
        ASKEW | {"translated"},
    ),
    "weighed": (lambda run, scene, calls: weighed(run, scene, 1e-8), ASKEW | {"scaled"}),
    "listed": (
        lambda run, scene, calls: shifted(run, 1e-8 * (scene.body[0].name == "crank")),
        ASKEW | {"reordered"},
    ),
    "stopped": (lambda run, scene, calls: replace(run, outcome=Outcome.STEP_FAILED), {"run"}),
}


def failed(
    engine: Engine, specimen: Specimen, monkeypatch: pytest.MonkeyPatch, printed: str = ""
) -> set[str]:
    """Names of the properties that fail, the runs made in this process."""

    def observe(name: str, scene: Scene, times: np.ndarray, setting: Setting, limit: float) -> Observation:
        return Observation(engine.run(scene, times, setting), printed, ())

    monkeypatch.setattr(trial, "observe", observe)
    monkeypatch.setattr(trial, "run_isolated", lambda *arguments: observe(*arguments).value)
    monkeypatch.setattr(properties, "engine", lambda name: engine)
    on = trial.Bench(
        "exact", specimen, "1", engine.cannot(specimen.scene), engine.settings(specimen.scene), 9
    )
    return {verdict.property for verdict in suite.examine(on) if verdict.status == suite.FAIL}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_put_in_and_property_that_tells(fault, monkeypatch):
    put_in, told = FAULTS[fault]
    found = failed(Exact(put_in), SPECIMENS["spatial_slider_crank"], monkeypatch)
    assert found == told, f"{fault}: failed {sorted(found)}, expected {sorted(told)}"


def test_wrong_gravity_and_truth(monkeypatch):
    class Light(Exact):
        def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
            lighter = tuple(0.999 * g for g in scene.gravity)
            return super().run(scene.with_(gravity=lighter), times, setting)

    found = failed(Light(FAULTS["none"][0]), SPECIMENS["loop"], monkeypatch)
    assert found == {"truth", "energy"}, f"gravity 0.1 % light: failed {sorted(found)}"


def test_printing_and_silence(monkeypatch):
    found = failed(Exact(FAULTS["none"][0]), SPECIMENS["loop"], monkeypatch, printed="solver banner\n")
    assert found == {"silence"}, f"an engine that prints: failed {sorted(found)}"


def test_undetermined_motion_and_refusal(monkeypatch):
    class Bold(Exact):
        def cannot(self, scene: Scene) -> Cannot | None:
            return None

    undone = Specimen(undetermined())
    bold, shy = Bold(FAULTS["none"][0]), Exact(FAULTS["none"][0])
    assert failed(bold, undone, monkeypatch) == {"refusal"}, "took on a motion without masses"
    assert failed(shy, undone, monkeypatch) == set(), "was faulted for refusing a motion without masses"


def test_closed_form_and_its_own_equation():
    """The formulas of the suite / the judge's truth, which solves the reduced equation."""
    for name in ("free_fall", "oscillator", "torsion", "driven", "pendulum"):
        specimen = SPECIMENS[name]
        solved, times = truth_for(specimen.scene), np.linspace(0, specimen.scene.duration, 7)
        assert solved is not None, f"{name} is of no family"
        written = trial.exact_motion(specimen, times)
        apart = trial.difference(specimen.scene, written, solved.poses(times))
        assert apart < 1e-12, f"{name}: formula and {solved.name} differ by {apart:.3g}, allowed 1e-12"


def test_verify_command_and_an_engine_that_breaks_the_contract(capsys, monkeypatch):
    """Chatter prints, leaves a file, and rests where bodies fall / its verdicts, exit status 1."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    status = main(["verify", "fake_engines:CHATTER", "--scene", "free_fall", "--json"])
    record = json.loads(capsys.readouterr().out)
    verdicts = {v["property"]: v["status"] for v in record["verdicts"] if v["scene"] == "free_fall"}
    faulty = {name for name, verdict in verdicts.items() if verdict == "fail"}
    assert (status, record["conforms"]) == (1, False), (status, record["conforms"])
    assert {"silence", "truth"} <= faulty, verdicts
    assert {"times", "unit", "run"}.isdisjoint(faulty), verdicts
    undone = [v for v in record["verdicts"] if v["scene"] == undetermined().name]
    assert [v["status"] for v in undone] == ["fail"], undone


@pytest.mark.parametrize(("fake", "status"), [("FAKE", "pass"), ("AGING", "fail")])
def test_what_a_run_leaves_to_the_next_and_the_property_that_tells(fake, status, monkeypatch):
    """Of two engines that repeat themselves in processes of their own one does not within a process."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    found = suite.verify(f"fake_engines:{fake}", [SPECIMENS["pendulum"]], 60.0)
    verdicts = {v.property: v for v in found.verdicts if v.scene == "pendulum"}
    assert verdicts["repeated"].status == status, verdicts["repeated"]
    assert verdicts["reordered"].status == "pass", verdicts["reordered"]


def test_shaken_scene_and_truth():
    for name in ("spatial_slider_crank", "four_bar_gravity"):
        scene, times = SPECIMENS[name].scene, np.linspace(0, SPECIMENS[name].scene.duration, 5)
        first, again, other = (shaken(seed).change(scene) for seed in (0, 0, 1))
        assert first == again and first != other and first != scene, f"{name}: a seed, a scene"
        exact, moved = (truth_for(s).poses(times) for s in (scene, first))
        apart = trial.difference(scene, exact, moved)
        assert 0 < apart < 1e-12, f"{name}: {apart:.1e} from data that are off by rounding"


def test_verify_command_and_crashing_engine(capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    status = main(["verify", "fake_engines:SEGFAULT", "--scene", "free_fall"])
    out = capsys.readouterr().out
    assert status == 1, status
    assert "SIGSEGV" in out, f"the table does not say why: {out[-600:]}"


def test_unknown_scene_of_the_suite_and_status_2(capsys):
    assert main(["verify", "mbref", "--scene", "nothing"]) == 2
    assert "unknown scene of the suite 'nothing'" in capsys.readouterr().err
