"""Child process: values, printed text and files of its calls, limits, and failures that end it."""

import operator
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from crosscheck.processes.child import Child, ChildFailed
from mbref.motions.trajectory import Outcome
from tests.helpers.fake_engines import converse
from tests.helpers.processes import is_gone


@pytest.fixture
def child() -> Iterator[Child]:
    with closing(Child()) as made:
        yield made


def test_calls_share_a_process_but_no_folder_and_no_printed_text(child: Child):
    """``converse`` prints by Python and C, warns, leaves a file, and returns its folder and process."""
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


def test_a_silent_call_after_a_long_output_has_no_output(child: Child):
    """The first call prints 200 characters; the next has its value 2 + 3, no printed text and no files."""
    child.call(converse, ("word " * 40,), 60.0)
    assert child.call(operator.add, (2, 3), 60.0) == (5, "", ())


def test_a_child_has_the_environment_variables_of_its_parent_when_it_starts(monkeypatch: pytest.MonkeyPatch):
    """The second child starts after the parent has changed the variable."""
    for value in ("first", "second"):
        monkeypatch.setenv("CROSSCHECK_PROBE", value)
        with closing(Child()) as made:
            assert made.call(os.getenv, ("CROSSCHECK_PROBE",), 60.0).value == value


def test_a_call_that_raises_ends_its_child_as_crashed(child: Child):
    """The call 1 / 0 raises. Its process ends, because a next call could find remains of the failed one."""
    with pytest.raises(ChildFailed, match="ZeroDivisionError: division by zero") as raised:
        child.call(operator.truediv, (1, 0), 60.0)
    assert raised.value.outcome is Outcome.CRASHED
    assert not child.is_alive


@pytest.mark.parametrize("in_copy", [False, True], ids=["in the child", "in a forked copy"])
@pytest.mark.parametrize("work", ["time.sleep(60)", "3 ** 10**9"], ids=["sleeps", "computes for hours"])
def test_a_call_past_its_limit_times_out_and_its_processes_end(child: Child, tmp_path, work, in_copy: bool):
    """The call writes its process number, then works past 0.5 s. The child and its forked copy end."""
    number = child.call(os.getpid, (), 60.0).value  # the limit does not cover the start of the process
    text = f"import os, pathlib, time; pathlib.Path({str(tmp_path / 'pid')!r}).write_text(str(os.getpid()))"
    with pytest.raises(ChildFailed, match=r"no result after 0\.5 s") as raised:
        child.call(exec, (f"{text}; {work}",), 0.5, in_copy)
    assert raised.value.outcome is Outcome.TIMED_OUT
    working = int((tmp_path / "pid").read_text())
    assert (working != number) == in_copy, (working, number)
    assert not child.is_alive and is_gone(working)


def test_large_answers_arrive_whole(child: Child):
    """A million numbers are more than a pipe of the operating system holds."""
    many = list(range(1_000_000))
    assert child.call(sorted, (many,), 60.0).value == many


def test_value_that_cannot_be_sent_is_a_failed_call(child: Child):
    """The call returns a lock, which Python cannot send between processes."""
    with pytest.raises(ChildFailed, match="cannot pickle"):
        child.call(threading.Lock, (), 60.0)


def test_the_command_line_computes_with_one_thread_unless_the_user_sets_a_number():
    """The user sets only OpenMP's number, to 3; OpenBLAS' becomes 1. Variables must be set before numpy is
    imported, which reads them once: ``import crosscheck`` imports no numpy."""
    known = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    code = "import os, sys, crosscheck; assert 'numpy' not in sys.modules; import crosscheck.cli\n"
    code += "print(os.environ['OMP_NUM_THREADS'], os.environ['OPENBLAS_NUM_THREADS'])"
    given = {**known, "OMP_NUM_THREADS": "3"}
    done = subprocess.run([sys.executable, "-c", code], env=given, capture_output=True, text=True, check=True)
    assert done.stdout == "3 1\n"
