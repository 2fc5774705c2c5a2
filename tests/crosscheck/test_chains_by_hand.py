"""Parallel runs of engines by hand: a cancelled run, an end of the executor, one thread for each engine."""

from __future__ import annotations

import threading
from concurrent.futures import CancelledError
from types import SimpleNamespace

import pytest

from crosscheck.study.chains import Chains

LONG = 30.0  # s, after which a test that waits fails


def test_a_cancelled_run_is_not_begun():
    begun, may_end, runs = threading.Event(), threading.Event(), []

    def run(case):
        runs.append(case.name)
        begun.set()
        assert may_end.wait(LONG)
        return f"motion of {case.name}"

    with Chains(lambda case, motion: {"made of": motion}) as chains:
        first, second, third = (
            chains.submit(run, SimpleNamespace(engine="e", name=name)) for name in ("1", "2", "3")
        )
        assert begun.wait(LONG) and second.cancel()
        may_end.set()
        assert first.result(LONG) == {"made of": "motion of 1"}
        assert third.result(LONG) == {"made of": "motion of 3"}
        with pytest.raises(CancelledError):
            second.result(LONG)
    assert runs == ["1", "3"]


def test_an_engine_is_served_by_one_thread_again_after_its_last_run():
    runs = []

    def run(case):
        runs.append((case.engine, threading.get_ident()))
        return case.engine

    with Chains(lambda case, motion: {"engine": motion}) as chains:
        for engine in ("a", "b", "a"):
            assert chains.submit(run, SimpleNamespace(engine=engine)).result(LONG) == {"engine": engine}
    assert [engine for engine, _ in runs] == ["a", "b", "a"]
    assert threading.get_ident() not in [thread for _, thread in runs]


def test_a_measure_that_raises_reaches_the_owner_of_the_future():
    def measure(case, motion):
        raise ValueError(motion)

    with Chains(measure) as chains:
        future = chains.submit(lambda case: "the motion", SimpleNamespace(engine="e"))
        assert str(future.exception(LONG)) == "the motion"
    with pytest.raises(RuntimeError, match="shutdown"):
        chains.submit(lambda case: 1, SimpleNamespace(engine="e"))
    with pytest.raises(RuntimeError, match="shutdown"):
        chains._measuring.submit(int)
