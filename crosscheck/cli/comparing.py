"""`crosscheck compare`: a verdict on a mechanism; `crosscheck tune`: an engine's settings for an error."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from crosscheck.cli import request, tables
from crosscheck.cli.collection import Collection, measured, scouted
from crosscheck.cli.request import Choice, RequestError
from crosscheck.cli.running import (
    COMPLETED,
    OTHERWISE,
    by_scene,
    cases_of,
    console,
    notice,
    print_json,
)  # fmt: skip
from crosscheck.study import sweep
from crosscheck.study.command import command
from crosscheck.study.fair_timing import model_difference
from crosscheck.study.grid import TIME_LIMIT, Case, Record, key, study
from crosscheck.study.progress import shown
from crosscheck.study.record_view import public
from crosscheck.study.sentences import verdict
from crosscheck.study.timings import REPEATS, with_timings
from crosscheck.study.tuning import tuned
from crosscheck.study.verdict import Judged, judged

TRUTH = ("kind", "bound", "until", "seconds", "reason", "both")  # fields of a truth's record that are printed


def compare(arguments: argparse.Namespace) -> int:
    """Print a verdict, tables and a plot for each scene, or the records with the verdict as JSON; returns 1
    where engines simulate different mechanisms."""
    if arguments.repeats < REPEATS:
        raise RequestError(f"--repeats: must be at least {REPEATS}, got {arguments.repeats}")
    cases = cases_of(arguments, sweep.QUICK_SAMPLES)
    scenes = list({case.scene.name: case.scene for case in cases}.values())
    long = sweep.QUICK_LONG if arguments.depth == "quick" else sweep.LONG
    found = measured(scenes, cases, None, long, notice, arguments.repeats)
    reasons = _differences(found, arguments.reference_time)
    groups = judged(found.scenes, found.truths, found.records)
    paths = {request.find_scenes([path])[0].name: path for path in arguments.scene}
    if arguments.json:
        print_json([_document(group, reasons, cases) for group in groups])
    else:
        for group in groups:
            name = group.scene.name
            tables.print_comparison(console(), group, paths[name], reasons.get(name))
    return OTHERWISE if reasons else COMPLETED


def tune(arguments: argparse.Namespace) -> int:
    """Print the cheapest settings of an engine that reach an error; returns 1 where none does."""
    (scene,) = request.find_scenes([arguments.scene])
    (name,) = request.find_engines([arguments.engine], notice)
    scene = request.lasting(scene, None, arguments.duration)
    times = request.sample_times(scene, None, sweep.QUICK_SAMPLES)
    scouted([scene], [name])
    limit = arguments.time_limit or TIME_LIMIT
    planned = request.plan([scene], [name], Choice(is_quick=False), [times], limit, notice)
    cases = [case._replace(reference_time=arguments.reference_time) for case in planned]
    records, reached = tuned(cases, arguments.error, _studied)
    case_of = {key(case): case for case in cases}
    best = with_timings([case_of[r["key"]] for r in reached], reached, None, notice)
    best.sort(key=lambda record: record["cost"]["seconds"])
    if arguments.json:
        found = [{**public(r), "command": command(r, arguments.scene)} for r in best]
        print_json([{"scene": scene.name, "error": arguments.error, "records": found}])
    else:
        tables.print_tuning(console(), arguments.error, best, records, arguments.scene)
    return COMPLETED if best else OTHERWISE


def _studied(cases: Sequence[Case]) -> list[Record]:
    with shown("trying settings", len(cases)) as progress:
        return study(cases, progress=progress)


def _differences(found: Collection, reference_time: float) -> dict[str, str]:
    """By scene, why the engines' mechanisms are not the same; each is printed."""
    reasons = {}
    for scene in found.scenes:
        own = [record for record in found.identities if record["scene"] == scene.name]
        if reason := model_difference(scene, own, reference_time):
            reasons[scene.name] = reason
            notice(
                f"{scene.name}: times are not compared, the engines simulate different mechanisms: {reason}"
            )
    return reasons


def _document(group: Judged, reasons: dict[str, str], cases: Sequence[Case]) -> dict[str, Any]:
    """The scene's document: verdict, truth and records."""
    (document,) = [d for d in by_scene(cases, group.records) if d["scene"] == group.scene.name]
    truth = {name: group.truth[name] for name in TRUTH}
    return {**document, "verdict": verdict([group])._asdict(), "truth": truth,
            "difference": reasons.get(group.scene.name)}  # fmt: skip
