"""`crosscheck diagnose`: what an engine cannot simulate of a mechanism, its known defects there, and ways to
solve the same equations that differ there."""

from __future__ import annotations

import argparse
from typing import Any

from crosscheck.alternatives.at_model import disagreements
from crosscheck.cli.request import find_engines
from crosscheck.cli.running import COMPLETED, OTHERWISE, console, notice, print_json
from crosscheck.cli.scene_request import find_scenes
from crosscheck.engine import Cannot, engine
from crosscheck.findings.at_model import defects
from crosscheck.study.comparison import scouted
from crosscheck.study.search.offers import offer, settings
from mbref.formats import import_options
from mbref.scene import Scene

NONE = "no known defect shows, and no solvers differ"


def diagnose(arguments: argparse.Namespace) -> int:
    """Print refusals, known defects and solvers of engines that differ at the scenes; returns 1 if a defect
    or a difference shows."""
    scenes = find_scenes(arguments.scene, import_options(arguments), notice)
    engines = find_engines(arguments.engine, notice)
    scouted(scenes, engines)
    found: list[dict[str, Any]] = [
        {"scene": s.name, "engines": [_diagnosed(s, name) for name in engines]} for s in scenes
    ]
    if arguments.json:
        print_json(found)
    else:
        for document in found:
            console().print("\n".join(_lines(document)), soft_wrap=True, markup=False, highlight=False)
    shown = [one for document in found for one in document["engines"]]
    return OTHERWISE if any(one["defects"] or one["disagreements"] for one in shown) else COMPLETED


def _diagnosed(scene: Scene, name: str) -> dict[str, Any]:
    refusal = found if isinstance(found := offer(name, scene), Cannot) else None
    shown = [] if refusal else defects(scene, [name], lambda name: settings(name, scene))
    return {
        "engine": name,
        "version": engine(name).version(),
        "cannot": str(refusal) if refusal else None,
        "defects": [one._asdict() for one in shown],
        "disagreements": [] if refusal else [one._asdict() for one in disagreements(scene, [name])],
    }


def _lines(document: dict[str, Any]) -> list[str]:
    lines = [document["scene"]]
    for found in document["engines"]:
        shown = [f"{one['sentence']}; `crosscheck findings {one['finding']}`" for one in found["defects"]]
        shown += [one["sentence"] for one in found["disagreements"]]
        lines += shown or [f"{found['engine']} {found['version']}: {found['cannot'] or NONE}"]
    return [lines[0], *(f"  {line}" for line in lines[1:])]
