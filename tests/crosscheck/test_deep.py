"""Drawn mechanisms / every check: decided as often as asked, resumed from records, a defect found."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest

from crosscheck.cli.commands import main
from crosscheck.conformance import deep, random_scenes
from crosscheck.conformance.deep_table import tables
from crosscheck.conformance.properties import PROPERTIES
from crosscheck.conformance.relations import RELATIONS
from crosscheck.conformance.runners import InProcess
from crosscheck.conformance.trial import Specimen, set_up
from crosscheck.engine import Cannot, Engine, Owner
from crosscheck.judge.constraints import closure, closure_rates, initial_poses, initial_twists
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import violation_series
from mbref import Limits, simulate
from mbref.scene import GROUND
from mbref.trajectory import Outcome
from tests.zoo.defects import DEFECTS
from tests.zoo.defects import engine as example


@pytest.fixture
def known(monkeypatch):
    """Makes an engine known to `deep` by the name "example"."""

    def make(simulator: Engine) -> None:
        real = deep.engine
        monkeypatch.setattr(deep, "engine", lambda name: simulator if name == "example" else real(name))

    return make


@pytest.mark.parametrize("times", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_every_check_and_the_sound_example_engine(known, tmp_path, times):
    """Each check is decided as often as asked, and a second run takes the records of the first."""
    known(example())
    path, plan = tmp_path / "records.jsonl", deep.Plan("example", times)
    found = deep.examined(plan, path)
    assert not found.violations, found.violations
    assert not found.open() and set(found.counts) == {*PROPERTIES, "run", "refusal"} - {
        "dead end",
        "refined",
    }, found.counts
    known(None)
    assert deep.examined(plan, path).to_record() == found.to_record(), "records were not taken"


def test_records_without_a_check(known, tmp_path, monkeypatch):
    """Only checks without a record are asked again."""
    known(example())
    path, plan = tmp_path / "records.jsonl", deep.Plan("example", 1)
    monkeypatch.setattr(deep, "KINDS", ((random_scenes.mechanism, ("run", "closure", "smooth")),))
    before = deep.examined(plan, path).to_record()
    (record,) = [json.loads(line) for line in path.read_text().splitlines()]
    del record["asked"]
    record["verdicts"] = [v for v in record["verdicts"] if v["property"] != "smooth"]
    path.write_text(json.dumps(record) + "\n")
    asked = []
    judged = deep.suite.verdict_on
    monkeypatch.setattr(
        deep.suite, "verdict_on", lambda check, bench: asked.append(check) or judged(check, bench)
    )
    assert deep.examined(plan, path).to_record() == before and asked == ["smooth"], asked


def test_planted_defect_and_the_checks_that_find_it(known):
    known(example(DEFECTS["gyroscopic moment with the wrong sign"]))
    found = deep.examined(deep.Plan("example", 1))
    assert {"truth", "balance"} <= {v["property"] for v in found.violations}, found.violations


def test_two_engines_and_their_agreement(known):
    """Two sound engines agree on a mechanism; a faulty one agrees with neither."""
    specimen = Specimen(random_scenes.mechanism(1), None, True, reference_time=0.0)
    late = example(DEFECTS["a driver's time a hundredth of a second late"])
    for simulator, status in ((example(), "pass"), (late, "fail")):
        verdict = deep.agreement(set_up(InProcess(simulator), specimen), "pinocchio")
        assert verdict.status == status, verdict


def test_drawn_mechanisms_and_what_is_promised_of_them():
    """Joints and drivers hold, velocities are the given ones; every kind of load and driver is drawn."""
    scenes = list(map(random_scenes.mechanism, range(24)))
    for scene in [*scenes, *map(random_scenes.floating, range(6))]:
        pose, rates = initial_poses(scene), initial_twists(scene)
        rows = [*closure(scene, 0.0, *pose).values(), *closure_rates(scene, 0.0, *pose, *rates).values()]
        kept = np.abs(rates[0] - [body.velocity for body in scene.body]).max()
        assert max(kept, *(np.abs(row).max() for row in rows)) < 1e-12, scene.name
    assert {load.type for scene in scenes for load in scene.load} >= {"torsion_spring", "spring"}
    assert {
        joint.facts.driven
        for scene in scenes
        for d in scene.driver
        for joint in scene.joint
        if joint.name == d.joint
    } == {"angle", "displacement"}
    assert not any(scene.driver for scene in scenes[::2]), "an even seed has a driver"
    assert not any(GROUND in joint.bodies for joint in random_scenes.floating(3).joint)


@pytest.mark.parametrize("seed", [1001, 1005])
def test_redundant_rows_stay_so_in_an_exact_motion(seed):
    """Rows that are redundant at the start do not hold the motion when a step drifts."""
    scene = random_scenes.random_mechanism(seed).with_(duration=0.1)
    motion = gauss_motion(scene, (0.0, 0.05, 0.1))
    assert violation_series(scene, motion).max() < 1e-9


def test_command_and_its_records(known, capsys, tmp_path):
    """The command prints the counts of the checks, and is 1 where a check is violated."""
    known(example())
    arguments = ["verify", "mbref", "--mechanisms", "1", "--records", str(tmp_path / "r.jsonl")]
    arguments += [
        "--family",
        "taylor",
        "--first-seed",
        "2",
        "--beside",
        "mbref=mpi-svd+projection",
    ]
    assert main([*arguments, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    counts = record["cards"]["agreement"]
    assert counts["pass"] == 1 and record["first_seed"] == 2, record["cards"]
    assert main(arguments) == 0
    assert "mbref: 0 violated checks; the engine ran 1 of 1 random mechanisms" in capsys.readouterr().out


def test_tally_and_seeds_that_decide_nothing(known):
    """A check that says nothing of any mechanism ends the search at MOST seeds for each."""

    class Refusing(type(example())):
        def cannot(self, scene):
            return super().cannot(scene) or Cannot(Owner.ENGINE, "it runs nothing")

    known(Refusing())
    found = deep.examined(deep.Plan("example", 2))
    assert found.seeds == deep.MOST * 2 and set(found.open()) >= {"truth"}, found.counts
    *_, last = tables(found)
    assert str(last) == "example: ran none of 6 random mechanisms, so it is not judged"
    assert all(not set(c) - {"cannot", "pass"} for c in itertools.islice(found.counts.values(), 5))


@pytest.mark.parametrize(("seed", "change"), [(101, "rotated"), (211, ""), (319, "rotated")])
def test_drawn_mechanism_that_mbref_did_not_run(seed, change):
    """A driven displacement had a part in series where none should be, and a wrong unit of length."""
    scene = random_scenes.mechanism(seed)
    scene = RELATIONS[change].change(scene, None) if change else scene
    run = simulate(scene, "taylor", np.linspace(0.0, scene.duration, 3), Limits(rtol=1e-9))
    assert run.outcome is Outcome.COMPLETED, run.message
