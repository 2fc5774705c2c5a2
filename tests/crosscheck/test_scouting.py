"""Settings of engines for scenes: the order in which engines are asked."""

import os
from threading import Event
from typing import NamedTuple

from crosscheck.study import scouting


class Named(NamedTuple):
    """A scene of a name."""

    name: str


def test_an_engine_that_compiles_keeps_no_other_engine_waiting(monkeypatch):
    scenes = [Named("one"), Named("two"), Named("three")]
    answered, others_are_done, order = [], Event(), []

    def asked(pair):
        if pair[0] == "slow":
            assert others_are_done.wait(20.0), f"only {order} were asked while an engine compiled"
        order.append(pair)
        if [name for name, _ in order].count("quick") == len(scenes):
            others_are_done.set()
        return ()

    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(scouting, "_asked", asked)
    monkeypatch.setattr(scouting, "_found", {})
    scouting.scout(["slow", "quick"], scenes, answered.append)
    pairs = [(name, scene) for name in ("slow", "quick") for scene in scenes]
    assert sorted(answered) == sorted(f"{name} {scene.name}" for name, scene in pairs)
    assert scouting._found == dict.fromkeys(pairs, ())
    scouting.scout(["slow", "quick"], scenes, answered.append)
    assert len(answered) == 6, "an answer is known, and nothing is asked again"
