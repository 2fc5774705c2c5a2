"""Functions shared by the commands that run engines: the requested runs, their progress, and the output."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from crosscheck.cli import request, scene_request
from crosscheck.cli.planning import Choice, choice, plan
from crosscheck.study.comparison import scouted
from crosscheck.study.grid import TIME_LIMIT, Case, Record, study
from crosscheck.study.progress import shown
from crosscheck.study.record_view import is_judged, public
from crosscheck.study.search.execution import CoarseFirst
from crosscheck.study.search.selection import QUICK_LIMIT, thinned
from crosscheck.study.truths import known_at
from crosscheck.study.words.truth import unknown
from mbref.formats import import_options
from mbref.records import finite
from mbref.scene import Scene
from mbref.terminal import Console

Document = dict[str, Any]
COMPLETED, OTHERWISE = 0, 1
SAMPLES = 101
STANDARD_OUTPUT, STANDARD_ERROR = 1, 2  # file descriptors
PIPED_WIDTH = 180  # characters of a line, so that no cell of a table is folded


class Asked(NamedTuple):
    """Request of a command line: scenes, engines, settings, sample times (k,) of every scene, CPU time (s) of
    a run."""

    scenes: Sequence[Scene]
    engines: Sequence[str]
    chosen: Choice
    times: Sequence[np.ndarray]
    time_limit: float


def asked_of(arguments: argparse.Namespace, samples: int = SAMPLES) -> Asked:
    """Return the request of a command line; raises RequestError if it cannot be carried out."""
    scenes = scene_request.find_scenes(arguments.scene, import_options(arguments), notice)
    engines = request.find_engines(arguments.engine, notice)
    named = [*(arguments.method or ()), *(arguments.setting or ())]
    is_quick = arguments.depth == "quick"
    chosen = choice(engines, named, arguments.option, arguments.rtol, is_quick)
    scenes = [request.lasting(s, arguments.times, arguments.duration) for s in scenes]
    count = samples if arguments.samples is None else arguments.samples
    times = [request.sample_times(s, arguments.times, count) for s in scenes]
    limit = arguments.time_limit
    if limit is None:
        limit = QUICK_LIMIT if is_quick and chosen.setting is None else TIME_LIMIT
    return Asked(scenes, engines, chosen, times, limit)


def cases_of(arguments: argparse.Namespace) -> list[Case]:
    """Return the requested runs; each refusal of an engine is reported on standard error."""
    asked = asked_of(arguments)
    if asked.chosen.setting is None:
        scouted(asked.scenes, asked.engines)
    cases = plan(*asked, notice)
    if asked.chosen.is_quick and asked.chosen.rtol is None:
        cases = thinned(cases)
    return [case._replace(reference_time=arguments.reference_time) for case in cases]


def studied(cases: Sequence[Case], finished: list[Record]) -> list[Record]:
    """Run the cases with a progress bar and return their records; each record is appended to ``finished`` as
    its run ends."""
    with shown("running", len(cases)) as advance:

        def progress(done: int, total: int, record: Record) -> None:
            finished.append(record)
            advance(done, total, record)

        return study(cases, progress=progress, run=CoarseFirst())


def missing_truths(cases: Sequence[Case], records: Sequence[Record]) -> list[str]:
    """Return a sentence for each scene whose true motion is unknown at some time that its runs reached."""
    unjudged = {r["scene"] for r in records if not is_judged(r)}
    asked = {case.scene.name: case for case in cases if case.scene.name in unjudged}
    return [unknown(c.scene, known_at(c.scene, c.times, c.reference_time)) for c in asked.values()]


def by_scene(cases: Sequence[Case], records: Sequence[Record]) -> list[Document]:
    """Return one dictionary {"scene", "records"} for each scene."""
    names = dict.fromkeys(case.scene.name for case in cases)
    return [{"scene": name, "records": [public(r) for r in records if r["scene"] == name]} for name in names]


def print_json(documents: Sequence[Document]) -> None:
    """Print the JSON document of one scene, or a list of the documents of several scenes. Numbers that are
    not finite become null."""
    print(json.dumps(finite(documents[0] if len(documents) == 1 else documents), allow_nan=False))


@contextlib.contextmanager
def standard_output_kept() -> Iterator[None]:
    """Print on standard error what engines print in this process during the ``with`` block."""
    sys.stdout.flush()
    kept = os.dup(STANDARD_OUTPUT)
    os.dup2(STANDARD_ERROR, STANDARD_OUTPUT)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, STANDARD_OUTPUT)
        os.close(kept)


def console(width: int = PIPED_WIDTH) -> Console:
    """Return a console on standard output; ``width`` (columns) applies if the output is no terminal."""
    return Console(width=None if sys.stdout.isatty() else width)


def notice(sentence: str) -> None:
    """Print a sentence for the user on standard error."""
    print(sentence, file=sys.stderr)
