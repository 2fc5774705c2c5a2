"""`crosscheck compare`: a verdict on the engines. `crosscheck tune`: settings of an engine that reach an
error."""

from __future__ import annotations

import argparse
import shlex
from concurrent.futures import ThreadPoolExecutor

from crosscheck.cli import request, scene_request, tables
from crosscheck.cli.comparison import WIDTH, comparisons
from crosscheck.cli.planning import Choice, plan
from crosscheck.cli.running import COMPLETED, OTHERWISE, asked_of, console, missing_truths, notice, print_json
from crosscheck.engine import engine
from crosscheck.study.command import command
from crosscheck.study.comparison import Wanted, collected, scouted
from crosscheck.study.dead_positions import followed
from crosscheck.study.grid import study
from crosscheck.study.progress import counted
from crosscheck.study.record_view import public
from crosscheck.study.search import selection
from crosscheck.study.search.cheapest import by_closure, by_error, tuned
from crosscheck.study.search.selection import families
from crosscheck.study.timings import with_timings
from mbref.formats import import_options


def compare(arguments: argparse.Namespace) -> int:
    """Print a verdict, tables and a plot for each scene, or the records with the verdict as JSON; returns 1
    if engines simulate different mechanisms."""
    asked = asked_of(arguments, selection.QUICK_SAMPLES)
    there = [
        followed(scene, times, arguments.reference_time)
        for scene, times in zip(asked.scenes, asked.times, strict=True)
    ]
    asked = asked._replace(scenes=[f.scene for f in there], times=[f.times for f in there])
    wanted = Wanted(
        asked.times,
        arguments.reference_time,
        asked.chosen.is_quick,
        None,
        arguments.repeats,
        asked.chosen.is_named,
        [f.dead for f in there],
    )
    found = collected(asked.scenes, asked.engines, wanted, lambda: plan(*asked, notice), notice)
    words = import_options(arguments).words()
    paths = {
        s.name: shlex.join([path, *words]) for s, path in zip(asked.scenes, arguments.scene, strict=True)
    }
    compared = comparisons(found, paths, asked.engines, arguments.reference_time)
    for comparison in compared:
        if comparison.difference:
            name = comparison.judged.scene.name
            reason = "the engines simulate different mechanisms, so times are not compared"
            blamed = ", ".join(comparison.judged.differences)
            reason = f"{blamed}: the adapter or the scene differs" if blamed else reason
            notice(f"{name}: {reason}: {comparison.difference}")
    if arguments.json:
        print_json([comparison.document() for comparison in compared])
    else:
        for comparison in compared:
            comparison.print(console(WIDTH))
    return OTHERWISE if any(comparison.difference for comparison in compared) else COMPLETED


def tune(arguments: argparse.Namespace) -> int:
    """Print the cheapest settings of an engine that reach an error; returns 1 if no setting reaches it."""
    reading = import_options(arguments)
    (scene,) = scene_request.find_scenes([arguments.scene], reading, notice)
    path = shlex.join([arguments.scene, *reading.words()])
    name = request.find_engine(arguments.engine, notice)
    scene = request.lasting(scene, None, arguments.duration)
    request.check_gap(arguments.closure, scene)
    times = request.sample_times(scene, None, selection.QUICK_SAMPLES)
    scouted([scene], [name])
    limit, ours = arguments.time_limit, engine(name).integrated_here
    planned = plan([scene], [name], Choice(is_quick=False), [times], limit, notice)
    cases = [case._replace(reference_time=arguments.reference_time) for case in planned]
    wanted = by_closure(arguments.closure, scene) if arguments.closure else by_error(arguments.error)
    with counted("trying settings", len(families(cases))) as advance, ThreadPoolExecutor() as threads:
        found = tuned(cases, wanted.level, lambda some: study(some, threads), ours, advance, wanted.measure)
    best = with_timings(found.cases, found.reached, None, notice)
    best.sort(key=lambda record: (record["family"] in ours, record["cost"]["seconds"]))
    if arguments.json:
        shown = [
            {
                **public(r),
                "command": command(r, path),
                "own_code": tables.own_code(scene, r),
                "integrated_here": r["family"] in ours,
            }
            for r in best
        ]
        goal = "closure" if arguments.closure else "error"
        document = {"scene": scene.name, goal: wanted.level, "records": shown}
        if not best:
            nearest = tables.nearest_of(wanted, found.records)
            reasons = [tables.unreached(wanted, nearest)[0], *missing_truths(cases, found.records)]
            document |= {"reason": " ".join(reasons), "nearest": public(nearest)}
        print_json([document])
    else:
        tables.print_tuning(console(), wanted, best, found.records, scene, path)
        for sentence in missing_truths(cases, found.records):
            console().print(sentence, soft_wrap=True)
    return COMPLETED if best else OTHERWISE
