"""Two sets of records differ, in sentences, just above a limit of noise and not just below."""

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
    """Return a set of one completed run."""
    run = {"outcome": "COMPLETED", "t_end": 1.0, "message": "", "machine": SAME, "times": [0.0, 1.0]}
    run |= {"asked": {"end": 1.0}, "repeated": repeated, "cost": {"seconds": seconds}}
    return {"run": {**run, "metrics": {"error": error, "error_bound": bound, **metrics}}}


def said(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """Return the sentences on the differences of two sets of one run."""
    [change] = changes(old, new)
    return list(change.sentences)


@pytest.mark.parametrize(("first", "second"), [(2e-9, 1e-12), (1e-12, 2e-9)])
def test_errors_below_the_larger_bound_of_both_truths_do_not_differ(first, second):
    """Errors of 1e-10 and 9e-10 differ only if the truths of both sets are known better: a bound of 2e-9 in
    one of them hides the difference, bounds of 1e-12 do not."""
    assert said(one(1e-10, bound=first), one(9e-10, bound=second)) == []
    assert said(one(1e-10, bound=1e-12), one(9e-10, bound=1e-12)) == ["error 1.00e-10 → 9.00e-10"]


def test_times_that_differ_by_three_quarters_are_reported_only_if_both_runs_were_repeated():
    """Times are 1 s and 1.75 s. A single run may take that much longer by chance."""
    fast, slow = one(1e-5, repeated=True), one(1e-5, seconds=1.75, repeated=True)
    assert said(fast, slow) == ["time 1.00e+00 s → 1.75e+00 s"]
    single = one(1e-5, seconds=1.75)
    assert said(fast, single) == [] and said(single, fast) == []


NAMES = {"velocity_error": "velocities", "violation_position": "closure"}
NAMES |= {"energy_error": "energy", "reaction_error": "reactions"}


@pytest.mark.parametrize(("metric", "name"), NAMES.items())
def test_other_errors_of_a_run_are_compared_if_the_positions_agree(metric, name):
    """Errors of positions are 1e-5 in both sets. Another error is reported if it changes by a factor over 2:
    from 1e-9 to 3e-9 and not to 1.9e-9. Errors below 1e-11 are rounding: 1e-13 and 9e-12 do not differ."""
    old, new = one(1e-5, **{metric: 1e-9}), one(1e-5, **{metric: 3e-9})
    assert said(old, new) == [f"{name} 1.00e-09 → 3.00e-09"]
    assert said(old, one(1e-5, **{metric: 1.9e-9})) == []
    assert said(one(1e-5, **{metric: 1e-13}), one(1e-5, **{metric: 9e-12})) == []


def stored(place, *lines: dict[str, Any], **timings: float):
    """Write records, and times (s) of interleaved runs by key of record, into a folder; return the folder."""
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


def test_interleaved_times_of_a_folder_replace_those_of_its_records(tmp_path):
    """Both records have a cost of 4 s. The run k2 has an interleaved time of 0.5 s, k1 has none."""
    place = stored(tmp_path, {"key": "k1"}, {"key": "k2", "family": "g"}, k2=0.5)
    found = {record["key"]: record for record in load(place).values()}
    assert [(found[k]["cost"], found[k]["repeated"]) for k in ("k1", "k2")] == [
        ({"seconds": 4.0, "steps": 7}, False),
        ({"seconds": 0.5, "steps": 7}, True),
    ]


def test_records_are_loaded_by_scene_engine_family_options_and_samples(tmp_path):
    """Two records of families f and g; their file is given by its path or by its folder's. The third record
    has the options of the second in another order, and replaces it."""
    two, turned = ({"engine": "a", "options": dict.fromkeys(x, 0.1), "end": 1.0} for x in ("pq", "qp"))
    asked = [{"key": key, "family": "g", "asked": ours} for key, ours in (("k2", two), ("k3", turned))]
    place = stored(tmp_path, {"key": "k1"}, *asked)
    assert load(place / "records.jsonl") == load(place)
    [first, second] = load(place)
    assert first == ("s", "a", "f", '{"step": 0.1}', '{"samples": 3, "end": 1.0}') and second[2] == "g"


def test_a_missing_file_or_field_of_records_is_refused(tmp_path):
    """The folder "none" does not exist; a record without ``asked`` does not say which run it is."""
    with pytest.raises(ValueError, match=r"none\S*: no such file"):
        load(tmp_path / "none")
    (tmp_path / "records.jsonl").write_text('{"key": "k", "scene": "s", "cost": {"seconds": 1.0}}\n')
    with pytest.raises(ValueError, match="lack the field `asked`"):
        load(tmp_path)


def test_records_of_another_version_of_a_scene_are_left_out(tmp_path):
    """The records k1 and k2 are of a scene and of one with another mass. The folder's file of the scene
    decides which records count; without a file the last record does."""
    scene = Scene(name="s", body=(Body(name="b", mass=1.0, inertia=(1.0,) * 3, position=(0.0,) * 3),))
    heavier = scene.with_(body=(scene.body[0].model_copy(update={"mass": 2.0}),))
    named = zip(("k1", "k2"), (scene, heavier), strict=True)
    place = stored(tmp_path, *({"key": key, "mechanism": mechanism(each)} for key, each in named))
    assert [record["key"] for record in load(place).values()] == ["k2"]
    assert "s: a set has several mechanisms of this name" in circumstances(load(place), load(place))[0]
    (place / "scenes").mkdir()
    scene.save(place / "scenes" / "s.toml")
    assert [record["key"] for record in load(place).values()] == ["k1"]


def test_a_faulty_scene_of_a_folder_of_records_is_refused(tmp_path):
    """The scene's gravity is one number instead of three; the error names the scene's file."""
    place = stored(tmp_path, {"key": "k1"})
    (place / "scenes").mkdir()
    (place / "scenes" / "s.toml").write_text("gravity = 3\n")
    with pytest.raises(ValueError, match=r"scenes/s\.toml: "):
        load(place)


def test_runs_of_different_mechanisms_are_listed_without_comparison():
    """A record of mechanism m1 and one of m2 are listed as "only in" their sets. Records of one mechanism, or
    one that names none, are compared: one change."""
    old, new = one(1e-5), one(1e-4)
    old["run"]["mechanism"], new["run"]["mechanism"] = "m1", "m2"
    alone = [(change.old, change.new, change.sentences) for change in changes(old, new)]
    assert alone == [(None, new["run"], ["only in the new set"]), (old["run"], None, ["only in the old set"])]
    for name in ("m1", None):
        assert len(changes(old, {"run": {**new["run"], "mechanism": name}})) == 1, name


def test_failed_runs_differ_by_their_outcome_or_by_their_end_beyond_rounding():
    """Ends of 0.5 s and 0.5 (1 + 1e-12) s are equal, ends of 0.5 and 0.25 s are not."""

    def failed(t_end: float, outcome: str = "STEP_FAILED") -> dict[str, Any]:
        return {"run": {**one(1e-5)["run"], "outcome": outcome, "t_end": t_end, "message": ""}}

    assert said(failed(0.5), failed(0.5)) == [] and said(failed(0.5), failed(0.5 * (1 + 1e-12))) == []
    [text] = said(failed(0.5), failed(0.25))
    assert text.startswith("end ") and "0.5" in text and "0.25" in text
    for old, new in ((failed(0.5), failed(0.5, "NOT_FINITE")), (failed(1.0, "COMPLETED"), failed(0.5))):
        [text] = said(old, new)
        assert text.startswith("outcome ")


def circumstance(engine: str, version: str, cpu: str, **more: Any) -> dict[str, Any]:
    """Return the record of a run of scene "s" by a version of an engine on a processor."""
    made = {"engine": engine, "version": version, "versions": {"numpy": "2"}, "machine": {"cpu": cpu}}
    return {"scene": "s", **made, **more}


def test_comparison_of_records_names_changed_versions_machines_and_mechanisms():
    """``circumstance`` is a record of scene s by an engine, its version and a processor. Engine a has
    versions 1.0 and 1.1 before and 1.0 after, engine b none and 2. Run 1 is repeated on another processor;
    run 2 too, but of another mechanism, so that its time is not counted. In the new set run 1 names none."""
    old = {
        "1": circumstance("a", "1.0", "x", commit="c1", mechanism="m1"),
        "2": circumstance("a", "1.1", "x", mechanism="m1"),
        "3": circumstance("b", "", "x", mechanism="m3"),
    }
    new = {
        "1": circumstance("a", "1.0", "y", commit="c1"),
        "2": circumstance("a", "1.0", "y", mechanism="m2"),
        "3": circumstance("b", "2", "x", mechanism="m3"),
    }
    assert circumstances(old, old) == []
    assert circumstances(old, new) == [
        "a: 1.0, 1.1 → 1.0",
        "cpu: x → x, y",
        "b: none → 2",
        "s: the mechanism was changed, so its runs are not compared.",
        "s: records name no mechanism, so it may have changed unseen.",
        "Times of 1 run are not compared: the machines differ.",
    ]
