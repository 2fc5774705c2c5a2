"""Differences of two sets of records, worked out by hand / the sentences at the limits of noise."""

from __future__ import annotations

import json
from typing import Any

import pytest

from crosscheck.judge.reference.cache import mechanism
from crosscheck.study.difference import changes, circumstances, load
from mbref.scene import Body, Scene

SAME = {"cpu": "a"}


def one(
    error: float, *, bound: float = 0.0, seconds: float = 1.0, repeated: bool = False, **metrics: float
) -> dict[str, dict[str, Any]]:
    """A set of one run."""
    found = {"error": error, "error_bound": bound, **metrics}
    return {
        "run": {
            "outcome": "COMPLETED",
            "t_end": 1.0,
            "message": "",
            "metrics": found,
            "machine": SAME,
            "cost": {"seconds": seconds},
            "asked": {"end": 1.0},
            "repeated": repeated,
            "times": [0.0, 1.0],
        }
    }


def said(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    [change] = changes(old, new)
    return list(change.sentences)


@pytest.mark.parametrize(("first", "second"), [(2e-9, 1e-12), (1e-12, 2e-9)])
def test_errors_below_the_larger_bound_of_both_truths_do_not_differ(first, second):
    """The truth of one set is known to 2e-9, of the other to 1e-12: 1e-10 and 9e-10 are not apart."""
    assert said(one(1e-10, bound=first), one(9e-10, bound=second)) == []
    assert said(one(1e-10, bound=1e-12), one(9e-10, bound=1e-12)) == ["error 1.00e-10 → 9.00e-10"]


@pytest.mark.parametrize(("ratio", "changed"), [(1.9, False), (2.0, False), (2.1, True)])
def test_errors_change_by_more_than_twofold(ratio, changed):
    for old, new in ((1e-5, ratio * 1e-5), (ratio * 1e-5, 1e-5)):
        assert bool(said(one(old), one(new))) is changed, (old, new)


@pytest.mark.parametrize(
    ("both", "ratio", "changed"),
    [
        ((True, True), 1.45, False),
        ((True, True), 1.75, True),
        ((True, False), 1.75, False),
        ((False, True), 1.75, False),
        ((False, False), 1.75, False),
        ((False, False), 2.05, True),
    ],
)
def test_times_that_were_repeated_change_by_half_and_single_ones_by_twofold(both, ratio, changed):
    old, new = (one(1e-5, seconds=s, repeated=r) for s, r in zip((1.0, ratio), both, strict=True))
    assert bool(said(old, new)) is changed and bool(said(new, old)) is changed
    if changed:
        assert said(old, new) == [f"time 1.00e+00 s → {ratio:.2e} s"]


@pytest.mark.parametrize(("noise", "changed"), [(4e-13, False), (1.9e-12, False), (2.1e-12, True)])
def test_errors_are_raised_to_the_rounding_first(noise, changed):
    assert bool(said(one(1e-16), one(noise))) is changed


def test_another_measure_is_compared_where_the_error_is_the_same():
    pairs = {
        "velocity_error": "velocities",
        "violation_position": "closure",
        "energy_error": "energy",
        "reaction_error": "reactions",
    }
    for metric, name in pairs.items():
        old, new = one(1e-5, **{metric: 1e-9}), one(1e-5, **{metric: 3e-9})
        assert said(old, new) == [f"{name} 1.00e-09 → 3.00e-09"]
        assert said(old, one(1e-5, **{metric: 1.9e-9})) == []
        assert said(one(1e-5, **{metric: 1e-13}), one(1e-5, **{metric: 9e-12})) == [], "below 1e-11"


def stored(place, *lines: dict[str, Any], **timings: float):
    """A folder with records, and with the times of interleaved runs by key."""
    asked = {"engine": "a", "options": {"step": 0.1}, "samples": 3, "end": 1.0}
    common = {"scene": "s", "family": "f", "asked": asked, "version": "1", "outcome": "COMPLETED"}
    common |= {"message": "", "t_end": 1.0, "time_limit": 60.0, "metrics": {}, "versions": {}, "settings": {}}
    common |= {"engine": "a", "machine": SAME, "times": [0.0, 1.0], "cost": {"seconds": 4.0, "steps": 7}}
    text = "".join(json.dumps({**common, **line}) + "\n" for line in lines)
    (place / "records.jsonl").write_text(text)
    repeats = {"median": 1.0, "repeats": 5}
    times = [{"key": name, "seconds": seconds, "timing": repeats} for name, seconds in timings.items()]
    (place / "timings.jsonl").write_text("".join(json.dumps(line) + "\n" for line in times))
    return place


def test_times_of_a_folder_are_the_interleaved_ones_where_they_exist(tmp_path):
    place = stored(tmp_path, {"key": "k1"}, {"key": "k2", "family": "g"}, k2=0.5)
    found = {record["key"]: record for record in load(place).values()}
    assert [(found[k]["cost"], found[k]["repeated"]) for k in ("k1", "k2")] == [
        ({"seconds": 4.0, "steps": 7}, False),
        ({"seconds": 0.5, "steps": 7}, True),
    ]
    assert load(place / "records.jsonl") == load(place), "a file stands for its folder"
    [first, second] = load(place)
    assert first == ("s", "a", "f", '{"step": 0.1}', '{"samples": 3, "end": 1.0}') and second[2] == "g"


def test_records_that_cannot_be_compared_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"none/records.jsonl: no such file|none: no such file"):
        load(tmp_path / "none")
    (tmp_path / "records.jsonl").write_text('{"key": "k", "scene": "s", "cost": {"seconds": 1.0}}\n')
    with pytest.raises(ValueError, match="lack the field `asked`"):
        load(tmp_path)


def test_records_of_a_scene_that_was_changed_since_are_left_out(tmp_path):
    scene = Scene(name="s", body=(Body(name="b", mass=1.0, inertia=(1.0,) * 3, position=(0.0,) * 3),))
    heavier = scene.with_(body=(scene.body[0].model_copy(update={"mass": 2.0}),))
    place = stored(
        tmp_path, {"key": "k1", "mechanism": mechanism(scene)}, {"key": "k2", "mechanism": mechanism(heavier)}
    )
    assert [record["key"] for record in load(place).values()] == ["k2"], "of two, the later one is kept"
    (place / "scenes").mkdir()
    scene.save(place / "scenes" / "s.toml")
    assert [record["key"] for record in load(place).values()] == ["k1"]
    (place / "scenes" / "s.toml").write_text("gravity = 3\n")
    with pytest.raises(ValueError, match="scenes: "):
        load(place)


def test_a_changed_mechanism_is_two_runs_and_a_missing_run_has_one_side():
    old, new = one(1e-5), one(1e-4)
    old["run"]["mechanism"], new["run"]["mechanism"] = "m1", "m2"
    first, second = changes(old, new)
    assert (first.old, first.new, first.sentences) == (None, new["run"], ["only in the new set"])
    assert (second.old, second.new, second.sentences) == (old["run"], None, ["only in the old set"])
    new["run"]["mechanism"] = "m1"
    assert len(changes(old, new)) == 1
    del new["run"]["mechanism"]
    assert len(changes(old, new)) == 1, "a record without its mechanism is compared"
    order = [change.identity for change in changes({"b": old["run"], "a": old["run"]}, {"a": new["run"]})]
    assert order == ["a", "b"], "the order of the new set, and then the others"


def test_ends_of_runs_that_fail_in_both_sets():
    def failed(t_end: float, outcome: str = "STEP_FAILED") -> dict[str, Any]:
        return {"run": {**one(1e-5)["run"], "outcome": outcome, "t_end": t_end, "message": ""}}

    assert said(failed(0.5), failed(0.5)) == [] and said(failed(0.5), failed(0.5 * (1 + 1e-12))) == []
    [text] = said(failed(0.5), failed(0.25))
    assert text.startswith("end ") and "0.5" in text and "0.25" in text
    [text] = said(failed(0.5), failed(0.5, "NOT_FINITE"))
    assert text.startswith("outcome ")
    [text] = said(failed(1.0, "COMPLETED"), failed(0.5))
    assert text.startswith("outcome ")


def circumstance(engine: str, version: str, cpu: str, **more: Any) -> dict[str, Any]:
    made = {"engine": engine, "version": version, "versions": {"numpy": "2"}, "machine": {"cpu": cpu}}
    return {"scene": "s", **made, **more}


def test_versions_machines_and_mechanisms_that_differ():
    old = {
        "1": circumstance("a", "1.0", "x", commit="c1"),
        "2": circumstance("a", "1.1", "x", mechanism="m1"),
        "3": circumstance("b", "", "x"),
    }
    new = {
        "1": circumstance("a", "1.0", "y", commit="c1"),
        "2": circumstance("a", "1.0", "y", mechanism="m2"),
        "3": circumstance("b", "2", "x"),
    }
    assert circumstances(old, old) == []
    assert circumstances(old, new) == [
        "a: 1.0, 1.1 → 1.0",
        "cpu: x → x, y",
        "b: none → 2",
        "s: the mechanism was changed, so its runs are not compared.",
        "Times of 1 run are not compared: the machines differ.",
    ]
