"""Sentences of verdicts on random and committed records / the claims recomputed by other code."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import pytest

from crosscheck.engine import engine
from crosscheck.study.sentences import breaks, headline, right
from crosscheck.study.speed_sentences import fast
from crosscheck.study.verdict import Judged
from mbref.scene import Body, Scene
from tests.crosscheck import recomputed, recomputed_together

REFERENCE = Path(__file__).parents[2] / "reports" / "reference"
FAMILIES = {
    "mbref": ("taylor", "alf-dual"),
    "mujoco": ("defaults", "stock", "forward", "newton, compiled"),
    "pinocchio": ("defaults", "tuned"),
    "exudyn": ("defaults", "alpha"),
    "sundials": ("ggl",),
}
BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="block", body=(BLOCK,), duration=1.0)


def ours(records: list[dict[str, Any]]) -> dict[str, list[str]]:
    """The families that crosscheck integrates, by engine."""
    return {name: list(engine(name).integrated_here) for name in recomputed.names(records)}


def study(seed: int) -> tuple[list[dict[str, Any]], float]:
    """Random records of some engines, a third of them failed, and the bound of their truth."""
    draw = random.Random(seed)
    bound = draw.choice((3e-14, 2e-9))
    chosen = draw.sample(list(FAMILIES), draw.randint(1, 5))
    best = {name: 10 ** draw.uniform(-13, 1) for name in chosen}
    records = []
    for name in chosen:
        for family in draw.sample(FAMILIES[name], draw.randint(1, len(FAMILIES[name]))):
            for _ in range(draw.randint(1, 4)):
                e = best[name] * 10 ** draw.uniform(0, 4)
                outcome = draw.choice(("COMPLETED", "COMPLETED", "COMPLETED", "NOT_FINITE", "TIMED_OUT"))
                records.append(record(name, family, e, bound, outcome, draw))
    return records, bound


def record(
    name: str, family: str, error: float, bound: float, outcome: str, draw: random.Random
) -> dict[str, Any]:
    done = outcome == "COMPLETED"
    return {
        "scene": "block",
        "engine": name,
        "family": family,
        "outcome": outcome,
        "t_end": 1.0 if done else draw.uniform(0.0, 0.9),
        "times": [0.0, 1.0],
        "message": "",
        "settings": {},
        "time_limit": draw.choice((20.0, 60.0)),
        "cost": {"seconds": 10 ** draw.uniform(-4, 1)},
        "asked": {"engine": name, "options": {}},
        "metrics": {"error": error if done else None, "error_bound": bound},
    }


def check(group: Judged, bound: float) -> None:
    """Compare each sentence on one scene with the records."""
    unlike = dict(group.differences)
    records = [r for r in group.records if r["engine"] not in unlike]
    recomputed.headline(headline([group]), records, list(unlike))
    recomputed.right(right([group]), records, bound, unlike)
    recomputed.breaks(breaks([group]), records)
    if records:
        recomputed.fast(fast([group]), group.records, ours(records), list(unlike))


@pytest.mark.parametrize("seed", range(150))
def test_sentences_on_random_records(seed):
    records, bound = study(seed)
    truth = {"scene": "block", "kind": "reference", "bound": bound, "reason": "", "until": 1.0}
    check(Judged(SCENE, truth, records), bound)


@pytest.mark.parametrize("seed", range(100))
def test_sentences_on_engines_that_are_unlike_the_scene(seed):
    records, bound = study(1000 + seed)
    truth = {"scene": "block", "kind": "reference", "bound": bound, "reason": "", "until": 1.0}
    found = recomputed.names(records)
    draw = random.Random(seed)
    unlike = {name: "start: truth and it differ by 0.2" for name in found[1:] if draw.random() < 0.5}
    check(Judged(SCENE, truth, records, unlike), bound)


def committed(name: str) -> list[dict[str, Any]]:
    lines = (REFERENCE / name).read_text().splitlines()
    return [json.loads(line) for line in lines]


def test_sentences_on_the_committed_records():
    """Each scene of the reference report alone."""
    records, truths = committed("records.jsonl"), {t["scene"]: t for t in committed("truths.jsonl")}
    scenes = [Scene.from_file(path) for path in sorted((REFERENCE / "scenes").glob("*.toml"))]
    assert len(scenes) == 5
    for scene in scenes:
        own = [r for r in records if r["scene"] == scene.name]
        assert len(own) > 20, scene.name
        check(Judged(scene, truths[scene.name], own), truths[scene.name]["bound"])


def test_a_claim_that_the_records_do_not_bear_is_found():
    """The checks see a verdict of other records: another error, time, default, count or engine."""
    records, bound = [], 3e-14
    draw = random.Random(0)
    for name, family, e in (
        ("mbref", "taylor", 1e-12),
        ("mujoco", "defaults", 0.5),
        ("mujoco", "stock", 1e-7),
        ("mujoco", "forward", 3e-9),
        ("exudyn", "alpha", 1e-4),
    ):
        records.append(record(name, family, e, bound, "COMPLETED", draw))
    truth = {"scene": "block", "kind": "reference", "bound": bound, "reason": "", "until": 1.0}
    said = Judged(SCENE, truth, records)
    check(said, bound)
    for k, change in (
        (0, {"metrics": {"error": 1e-7, "error_bound": bound}}),
        (1, {"metrics": {"error": 1e-9, "error_bound": bound}}),
        (4, {"outcome": "NOT_FINITE"}),
        (3, {"family": "newton, compiled", "cost": {"seconds": 1e-9}}),
        (2, {"cost": {"seconds": 1e-9}}),
    ):
        others = [*records[:k], {**records[k], **change}, *records[k + 1 :]]
        seen = 0
        for checked, text, more in (
            (recomputed.headline, headline([said]), ()),
            (recomputed.right, right([said]), (bound,)),
            (recomputed.fast, fast([said]), (ours(records),)),
            (recomputed.breaks, breaks([said]), ()),
        ):
            try:
                checked(text, others, *more)
            except AssertionError:
                seen += 1
        assert seen, (k, change)


@pytest.mark.parametrize("seed", range(150))
def test_sentences_on_several_scenes_together(seed):
    """Two or three scenes; a third of the engines miss a scene."""
    draw = random.Random(f"together {seed}")
    bound, groups, studies = draw.choice((3e-14, 2e-9)), [], {}
    for k in range(draw.choice((2, 3))):
        found, _ = study(1000 * seed + k)
        name = f"block{k}"
        own = [{**r, "scene": name, "metrics": {**r["metrics"], "error_bound": bound}} for r in found]
        studies[name] = own
        truth = {"scene": name, "kind": "reference", "bound": bound, "reason": "", "until": 1.0}
        groups.append(Judged(SCENE.with_(name=name), truth, own))
    everything = [r for own in studies.values() for r in own]
    recomputed_together.headline(headline(groups), studies)
    recomputed_together.right(right(groups), studies, bound)
    recomputed_together.fast(fast(groups), studies, ours(everything))
    recomputed_together.breaks(breaks(groups), studies)
