"""Child process: what one call does / what the next one finds."""

from __future__ import annotations

import operator
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from crosscheck.processes.child import Child, ChildFailed
from mbref.trajectory import Outcome
from tests.helpers.fake_engines import converse


@pytest.fixture
def child() -> Iterator[Child]:
    with closing(Child()) as made:
        yield made


def test_calls_share_the_process_and_nothing_else(child: Child):
    first, second = (child.call(converse, (text,), 60.0) for text in ("first", "second"))
    (here, pid), (there, again) = first.value, second.value
    assert pid == again, "the second call had another process"
    assert here != there and not Path(here).exists() and not Path(there).exists(), (here, there)
    for seen, text in ((first, "first"), (second, "second")):
        lines = set(seen.printed.splitlines())
        assert {text, f"compiled {text}"} < lines, seen.printed
        assert any("careful" in line for line in lines), f"{text}: its warning is missing: {seen.printed}"
        assert seen.files == (text,), seen.files
    assert "first" not in second.printed, second.printed


def test_silent_call_after_one_that_printed_much(child: Child):
    child.call(converse, ("word " * 40,), 60.0)
    assert child.call(operator.add, (2, 3), 60.0) == (5, "", ())


def test_child_has_the_present_environment(monkeypatch: pytest.MonkeyPatch):
    for value in ("first", "second"):
        monkeypatch.setenv("CROSSCHECK_PROBE", value)
        with closing(Child()) as made:
            assert made.call(os.getenv, ("CROSSCHECK_PROBE",), 60.0).value == value
            assert made.call(os.getenv, ("OMP_NUM_THREADS",), 60.0).value == "1"


def test_failed_call_and_its_child(child: Child):
    with pytest.raises(ChildFailed, match="ZeroDivisionError: division by zero") as raised:
        child.call(operator.truediv, (1, 0), 60.0)
    assert raised.value.outcome is Outcome.CRASHED
    assert not child.is_alive, "what is left of a failed call would be there in the next"


def test_late_call_and_its_child(child: Child):
    child.call(operator.add, (2, 3), 60.0)  # it has started
    with pytest.raises(ChildFailed, match=r"no result after 0\.2 s") as raised:
        child.call(time.sleep, (60.0,), 0.2)
    assert raised.value.outcome is Outcome.TIMED_OUT
    assert not child.is_alive


@pytest.mark.parametrize("in_copy", [False, True])
def test_a_busy_call_is_late(child: Child, in_copy: bool):
    child.call(operator.add, (2, 3), 60.0)
    with pytest.raises(ChildFailed, match=r"no result after 0\.5 s") as raised:
        child.call(pow, (3, 10**9), 0.5, in_copy)
    assert raised.value.outcome is Outcome.TIMED_OUT


def test_large_answers_arrive_whole(child: Child):
    many = list(range(1_000_000))
    assert child.call(sorted, (many,), 60.0).value == many


def test_value_that_cannot_be_sent_is_a_failed_call(child: Child):
    with pytest.raises(ChildFailed, match="cannot pickle"):
        child.call(threading.Lock, (), 60.0)


@pytest.mark.parametrize(("given", "used"), [({}, "1"), ({"OMP_NUM_THREADS": "3"}, "3")])
def test_the_command_line_computes_with_one_thread_unless_the_user_wants_more(given, used):
    known = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    code = "import os, sys, crosscheck; assert 'numpy' not in sys.modules; import crosscheck.cli\n"
    code += "print(os.environ['OMP_NUM_THREADS'])"
    done = subprocess.run(
        [sys.executable, "-c", code], env={**known, **given}, capture_output=True, text=True, check=True
    )
    assert done.stdout == f"{used}\n"
