"""Malformed answers of engines are refused with their defect, and a study goes on after them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.processes.answer import OPTIONAL, MalformedAnswer, well_formed
from crosscheck.study.grid import Case, study
from mbref.motions.trajectory import PER_BODY, Cost, Outcome
from mbref.scene import Body, Scene
from tests.helpers.fake_engines import DAMAGES, FAKE, FAKES, MALFORMED, SCALARS

TIMES = np.array([0.0, 0.1, 0.3])
BLOCK = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
SCENE = Scene(name="still", body=(BLOCK,))
SAYS = {  # key of DAMAGES, the defect that it puts into a good answer: words of the error
    "None": "returned NoneType, not a Trajectory",
    "a dictionary": "returned dict, not a Trajectory",
    "a class": "not a Trajectory",
    "outcome as text": "outcome: is 'COMPLETED'",
    "other bodies": "bodies: are ('someone',)",
    "no bodies": "bodies: are None",
    "other times": "times: are not the first of the requested times",
    "few samples": "times: completed with 1 of 3 samples",
    "few positions": "position: has shape (1, 1, 3), not (3, 1, 3)",
    "wrong shape": "position: has shape (3, 3), not (3, 1, 3)",
    "velocity as text": "velocity: is str, not an array of numbers",
    "ragged velocity": "velocity: is list, not an array of numbers",
    "no rotation": "orientation: has a quaternion",
    "unknown joint": "reactions: name joints that",
    "cost as a number": "cost: is float, not a Cost",
    "cost of NaN": "cost: is not finite",
    "another scene": "scene: is 'moving', not 'still'",
    "blank version": "version: is empty",
    "negative cost": "cost: is negative",
    "settings of objects": "settings: must be a dictionary",
    "a local class": "returned Local, not a Trajectory",
}


@pytest.mark.parametrize(("damage", "words"), [(damage, SAYS[damage]) for damage in DAMAGES])
def test_error_of_a_malformed_answer_names_its_defect(damage: str, words: str):
    """The engine MALFORMED gives a good answer with the one defect that ``damage`` names."""
    with pytest.raises(MalformedAnswer) as caught:
        well_formed(MALFORMED.run(SCENE, TIMES, Setting("a", {"damage": damage})), SCENE, TIMES)
    assert words in str(caught.value)


def test_only_a_failed_run_may_answer_with_the_first_samples_alone():
    """Two of the three requested times are a good answer of a run that failed, not of one that completed."""
    settings = (Setting("a", {"outcome": name}) for name in ("STEP_FAILED", "COMPLETED"))
    failed, completed = (FAKE.run(SCENE, TIMES[:2], setting) for setting in settings)
    assert well_formed(failed, SCENE, TIMES).times.tolist() == [0.0, 0.1]
    with pytest.raises(MalformedAnswer, match="completed with 2 of 3 samples"):
        well_formed(completed, SCENE, TIMES)


def test_bodies_of_an_answer_are_put_into_the_scene_s_order():
    """An engine may name its bodies in any order; tables and reports compare arrays in the scene's."""
    scene = SCENE.with_(body=(BLOCK, BLOCK.model_copy(update={"name": "plate", "position": (0.0, 0.0, 9.0)})))
    good = FAKE.run(scene, TIMES, Setting("a"))
    turned = {name: getattr(good, name)[:, ::-1] for name in PER_BODY if getattr(good, name) is not None}
    run = well_formed(replace(good, bodies=good.bodies[::-1], **turned), scene, TIMES)
    assert run.bodies == ("block", "plate") and np.array_equal(run.position, good.position)


@pytest.mark.parametrize("name", [name for name in PER_BODY if name not in OPTIONAL])
def test_a_run_that_completed_with_numbers_that_are_not_finite_has_failed(name: str):
    good = FAKE.run(SCENE, TIMES, Setting("a"))
    bad = np.where(TIMES[:, None, None] < 0.2, getattr(good, name), np.nan)
    turns = {"angles": {"A": TIMES}, "open_reactions": {"A": TIMES}}
    run = well_formed(replace(good, **turns | {name: bad}), SCENE, TIMES)
    assert (run.outcome, run.t_end, run.times.tolist()) == (Outcome.NOT_FINITE, 0.1, [0.0, 0.1])
    assert [len(rows["A"]) for rows in (run.angles, run.open_reactions)] == [2, 2]
    assert "motion of block is not finite at 0.3 s" in run.message


def test_a_completed_run_of_zero_seconds_is_a_well_formed_answer():
    """A run that is shorter than a tick of the clock has cost 0 s."""
    good = FAKE.run(SCENE, TIMES, Setting("a"))
    assert well_formed(replace(good, cost=Cost(seconds=0.0)), SCENE, TIMES).outcome is Outcome.COMPLETED


def test_numbers_of_numpy_in_an_answer_become_floats_and_ints():
    """SCALARS answers with numpy's numbers, such as 7 steps, and lists of velocities and bodies."""
    run = well_formed(SCALARS.run(SCENE, TIMES, Setting("a")), SCENE, TIMES)
    assert json.loads(json.dumps(run.to_record()))["cost"]["steps"] == 7
    kinds = [type(x) for x in (run.t_end, run.cost.seconds, run.cost.steps, run.settings["seconds"])]
    assert kinds == [float, float, int, float]
    assert run.velocity.shape == (3, 1, 3) and run.bodies == ("block",)


def test_a_study_records_malformed_answers_as_crashed_and_goes_on(tmp_path: Path):
    """MALFORMED gives an answer with the defect that its option names. SCALARS answers with numpy's numbers,
    which are accepted. VERSIONLESS raises the error "no licence" when its version is read."""
    wanted = [  # engine, its options, the outcome in its record
        ("MALFORMED", {"damage": "None"}, "CRASHED"),
        ("MALFORMED", {"damage": "few samples"}, "CRASHED"),
        ("SCALARS", {}, "COMPLETED"),
        ("VERSIONLESS", {}, "CRASHED"),
        ("MALFORMED", {"damage": "a local class"}, "CRASHED"),
        ("FAKE", {}, "COMPLETED"),
    ]
    cases = [Case(SCENE, TIMES, f"{FAKES}:{name}", Setting("a", options)) for name, options, _ in wanted]
    records = study(cases, records_path=tmp_path / "records.jsonl")
    assert [record["outcome"] for record in records] == [outcome for *_, outcome in wanted]
    assert "no licence" in records[3]["message"], "the error that ``version`` raises"
    assert len((tmp_path / "records.jsonl").read_text().splitlines()) == 6
