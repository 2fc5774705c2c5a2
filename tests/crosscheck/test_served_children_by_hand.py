"""Programs of child processes and of the fork server / their calls of the system, in order, on paper."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from contextlib import nullcontext, suppress
from types import SimpleNamespace
from typing import Any

import pytest

from crosscheck.engine import BUILT_IN, OPTIONAL
from crosscheck.processes import answer, child, fork_server, pool, serve
from crosscheck.processes.child import Child, ChildFailed
from mbref.trajectory import Outcome

SETTING = SimpleNamespace(family="f")


class Calls:
    """The calls of the system in their order; each named one returns its next answer."""

    def __init__(self, **answers: list[Any]) -> None:
        self.made: list[tuple[Any, ...]] = []
        self._answers = answers

    def __call__(self, name: str) -> Any:
        def call(*given: Any, **named: Any) -> Any:
            self.made.append((name, *given, *named.items()))
            found = self._answers[name].pop(0) if self._answers.get(name) else None
            if isinstance(found, BaseException):
                raise found
            return found

        return call

    def of(self, *names: str, **more: Any) -> SimpleNamespace:
        return SimpleNamespace(**{name: self(name) for name in names}, **more)


class Pipes:
    """One end of a connection."""

    def __init__(self, calls: Calls, name: str, number: int = 9) -> None:
        self.fileno = lambda: number
        for method in ("send", "recv", "send_bytes", "recv_bytes", "close"):
            setattr(self, method, calls(f"{name}.{method}"))

    def __enter__(self) -> Pipes:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Ended(BaseException):
    """The end of a process."""


# --- the program of a child ---------------------------------------------------------------------------------
def test_a_child_makes_the_calls_that_are_sent(monkeypatch):
    """In the directory of each; standard input is empty for the engines."""
    calls = Calls(dup=[5], recv=[("one", 7.0, "f", (1,), False), ("two", 8.0, "g", (2,), True), EOFError()])
    monkeypatch.setattr(serve, "os", calls.of("dup", "dup2", "chdir", devnull="/dev/null"))
    channel = calls.of("recv", "send_bytes")
    monkeypatch.setattr(serve, "Connection", lambda number: channel if number == 5 else None)
    monkeypatch.setattr(serve, "_answer_within", lambda *given: ("within", *given))
    monkeypatch.setattr(serve, "_answer_of_copy", lambda *given: ("copy", *given))
    serve.main()
    (_, number), (name, _, replaced), *others = calls.made
    assert number == 0 and (name, replaced) == ("dup2", 0)
    assert others == [
        ("recv",),
        ("chdir", "one"),
        ("send_bytes", ("within", 7.0, "f", (1,))),
        ("recv",),
        ("chdir", "two"),
        ("send_bytes", ("copy", 8.0, "g", (2,))),
        ("recv",),
    ]


def test_a_call_ends_the_child_after_its_last_resort(monkeypatch):
    calls = Calls()
    monkeypatch.setattr(
        serve, "faulthandler", calls.of("dump_traceback_later", "cancel_dump_traceback_later")
    )
    monkeypatch.setattr(serve, "_answer", lambda *given: calls("answer")(*given) or b"a")
    assert serve._answer_within(7.0, divmod, (3, 2)) == b"a"
    assert calls.made == [
        ("dump_traceback_later", 7.0, ("exit", True)),
        ("answer", divmod, (3, 2)),
        ("cancel_dump_traceback_later",),
    ]


@pytest.mark.parametrize("divisor", [2, 0])
def test_printed_text_is_written_before_the_answer(monkeypatch, divisor):
    """Python's and the C library's output, also after a failure."""
    calls = Calls()
    library = SimpleNamespace(fflush=calls("fflush"))
    monkeypatch.setattr(serve, "ctypes", SimpleNamespace(CDLL=lambda name: library if name is None else None))
    out, err = (SimpleNamespace(flush=calls(name)) for name in ("stdout", "stderr"))
    monkeypatch.setattr(serve, "sys", SimpleNamespace(stdout=out, stderr=err))
    is_value, value = pickle.loads(serve._answer(divmod, (7, divisor)))
    assert (is_value, value) == ((True, (3, 1)) if divisor else (False, value))
    assert calls.made == [("stdout",), ("stderr",), ("fflush", None)]


def copied(monkeypatch: pytest.MonkeyPatch, copy: int, answer: Any, status: int) -> tuple[Any, Calls]:
    calls = Calls(fork=[copy], waitpid=[(copy, status)], _exit=[Ended()], **{"ours.recv_bytes": [answer]})
    system = calls.of("fork", "_exit", "waitpid", waitstatus_to_exitcode=lambda status: 10 * status)
    monkeypatch.setattr(serve, "os", system)
    ends = Pipes(calls, "ours"), Pipes(calls, "theirs")
    monkeypatch.setattr(serve, "Pipe", lambda duplex: None if duplex else ends)
    monkeypatch.setattr(serve, "_answer_within", lambda *given: ("answer", *given))
    monkeypatch.setattr(serve, "_end_as", lambda status: ("ended as", status))
    try:
        return serve._answer_of_copy(7.0, divmod, (3, 2)), calls
    except Ended:
        return None, calls


def test_the_copy_of_a_child_sends_its_answer_and_ends(monkeypatch):
    found, calls = copied(monkeypatch, 0, b"", 0)
    assert found is None and calls.made == [
        ("fork",),
        ("ours.close",),
        ("theirs.send_bytes", ("answer", 7.0, divmod, (3, 2))),
        ("_exit", 0),
    ]


@pytest.mark.parametrize(
    ("answer", "wanted"), [(b"value", b"value"), (EOFError(), ("ended as", 30)), (b"", ("ended as", 30))]
)
def test_a_child_passes_the_answer_of_its_copy_on(monkeypatch, answer, wanted):
    found, calls = copied(monkeypatch, 4, answer, 3)
    assert found == wanted and calls.made == [
        ("fork",),
        ("theirs.close",),
        ("ours.recv_bytes",),
        ("ours.close",),
        ("waitpid", 4, 0),
    ]


# --- the program of the fork server -------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("asked", "is_served"),
    [([False, False, EOFError()], False), ([False, True], True), ([EOFError()], False)],
)
def test_the_server_forks_until_its_parent_ends(monkeypatch, asked, is_served):
    calls = Calls(is_child=asked, dup=[6])
    monkeypatch.setattr(fork_server, "engine", calls("engine"))
    monkeypatch.setattr(fork_server, "gc", calls.of("freeze"))
    monkeypatch.setattr(fork_server, "signal", calls.of("signal", SIGCHLD="child"))
    monkeypatch.setattr(fork_server, "os", calls.of("dup"))
    monkeypatch.setattr(fork_server, "Connection", lambda number: f"connection {number}")
    monkeypatch.setattr(fork_server, "_is_child", calls("is_child"))
    monkeypatch.setattr(fork_server, "serve", SimpleNamespace(main=calls("serve")))
    count = len(asked)
    fork_server.main()
    made = [call for call in calls.made if call != ("freeze",)]
    assert made == [
        *(("engine", name) for name in (*BUILT_IN, *OPTIONAL)),
        ("signal", "child", fork_server._reap),
        ("dup", 0),
        *[("is_child", "connection 6")] * count,
        *[("serve",)] * is_served,
    ]


@pytest.mark.parametrize("last", [(0, 0), ChildProcessError()])
def test_ended_processes_are_removed(monkeypatch, last):
    calls = Calls(waitpid=[(7, 0), (8, 0), last])
    monkeypatch.setattr(fork_server, "os", calls.of("waitpid", WNOHANG=1))
    fork_server._reap(signal.SIGCHLD, None)
    assert calls.made == [("waitpid", -1, 1)] * 3


def requested(monkeypatch: pytest.MonkeyPatch, fork: int) -> tuple[bool, Calls, SimpleNamespace]:
    environment = {"PYTHONPATH": "a:b", "OMP_NUM_THREADS": "1"}
    calls = Calls(
        fork=[fork], dup=[3], recv_fds=[(b".", [10, 11, 12], 0, None)], **{"requests.recv": [environment]}
    )
    system = calls.of("fork", "dup", "close", environ={"OLD": "1"}, pathsep=":")
    monkeypatch.setattr(fork_server, "os", system)
    sockets = SimpleNamespace(
        socket=lambda fileno: Pipes(calls, f"socket {fileno}"),
        recv_fds=lambda receiving, size, most: calls("recv_fds")(size, most),
    )
    monkeypatch.setattr(fork_server, "socket", sockets)
    monkeypatch.setattr(fork_server, "_keep", calls("keep"))
    monkeypatch.setattr(fork_server, "importlib", calls.of("invalidate_caches"))
    path = SimpleNamespace(path=["old"])
    monkeypatch.setattr(fork_server, "sys", path)
    found = fork_server._is_child(Pipes(calls, "requests", 2))
    return found, calls, SimpleNamespace(environ=system.environ, path=path.path)


RECEIVED = [("requests.recv",), ("dup", 2), ("recv_fds", 1, 3), ("socket 3.close",), ("fork",)]


def test_the_server_closes_the_descriptors_of_a_child(monkeypatch):
    found, calls, state = requested(monkeypatch, 7)
    assert found is False and calls.made == [*RECEIVED, ("close", 10), ("close", 11), ("close", 12)]
    assert state.environ == {"OLD": "1"} and state.path == ["old"]


def test_a_fork_has_the_environment_that_was_sent(monkeypatch):
    found, calls, state = requested(monkeypatch, 0)
    assert found is True
    assert calls.made == [*RECEIVED, ("requests.close",), ("keep", 10, 11, 12), ("invalidate_caches",)]
    assert state.environ == {"PYTHONPATH": "a:b", "OMP_NUM_THREADS": "1"} and state.path == ["a", "b"]


def kept(monkeypatch: pytest.MonkeyPatch, fork: int, **answers: list[Any]) -> Calls:
    calls = Calls(fork=[fork], getpid=[77], _exit=[Ended()], **answers)
    names = ("fork", "close", "setsid", "getpid", "dup2", "_exit")
    system = calls.of(*names, waitstatus_to_exitcode=lambda status: 10 * status)
    monkeypatch.setattr(fork_server, "os", system)
    words = {"SIGCHLD": "child", "SIG_DFL": "default", "SIG_BLOCK": "block", "SIG_UNBLOCK": "unblock"}
    monkeypatch.setattr(fork_server, "signal", calls.of("signal", "pthread_sigmask", **words))
    monkeypatch.setattr(
        fork_server,
        "Connection",
        lambda number, readable: None if readable else Pipes(calls, f"reports {number}"),
    )
    monkeypatch.setattr(fork_server, "_status", lambda worker, news: calls("status")(worker, news) or 3)
    with suppress(Ended):
        fork_server._keep(10, 11, 12)
    return calls


BLOCKED = [("signal", "child", "default"), ("pthread_sigmask", "block", {"child"}), ("fork",)]


def test_a_worker_reports_its_number_and_gets_its_streams(monkeypatch):
    """Input, output and errors; it leads a group of its own."""
    assert kept(monkeypatch, 0).made == [
        *BLOCKED,
        ("pthread_sigmask", "unblock", {"child"}),
        ("setsid",),
        ("getpid",),
        ("reports 12.send", 77),
        ("reports 12.close",),
        ("dup2", 10, 0),
        ("close", 10),
        ("dup2", 11, 1),
        ("dup2", 11, 2),
        ("close", 11),
    ]


@pytest.mark.parametrize("sent", [None, BrokenPipeError()])
def test_the_keeper_of_a_worker_reports_its_exit_status(monkeypatch, sent):
    assert kept(monkeypatch, 7, **{"reports 12.send": [sent]}).made == [
        *BLOCKED,
        ("close", 10),
        ("close", 11),
        ("status", 7, 12),
        ("reports 12.send", 30),
        ("_exit", 0),
        ("reports 12.close",),
    ]


@pytest.mark.parametrize("killed", [None, ProcessLookupError()])
def test_a_worker_whose_parent_has_ended_is_killed_after_a_second(monkeypatch, killed):
    """At the first look the parent is there; at the second nobody reads the news."""
    calls = Calls(waitpid=[(0, 0), (0, 0), (7, 9)], poll=[[], [(12, 8)]], killpg=[killed])
    monkeypatch.setattr(fork_server, "os", calls.of("waitpid", "killpg", WNOHANG=1))
    monkeypatch.setattr(fork_server, "signal", calls.of("sigtimedwait", SIGCHLD="child", SIGKILL="kill"))
    reader = calls.of("register", "poll")
    monkeypatch.setattr(fork_server, "select", SimpleNamespace(poll=lambda: reader))
    assert fork_server._status(7, 12) == 9
    look = [("waitpid", 7, 1), ("poll", 0), ("sigtimedwait", {"child"}, 1.0)]
    assert calls.made == [("register", 12, 0), *look, *look, ("killpg", 7, "kill"), ("waitpid", 7, 1)]


# --- the server and its owner -------------------------------------------------------------------------------
def server(calls: Calls, *polls: Any) -> fork_server.Server:
    calls._answers["poll"] = list(polls)
    return fork_server.Server(calls.of("poll", "wait", "kill"), calls.of("close", "send", fileno=lambda: 4))


@pytest.mark.parametrize(("polls", "is_new"), [([None], False), ([0], True), ([-9], True)])
def test_a_server_that_has_ended_is_replaced(monkeypatch, polls, is_new):
    calls = Calls()
    monkeypatch.setattr(fork_server, "_servers", [server(calls, *polls)])
    monkeypatch.setattr(fork_server, "_started", lambda environment: ("new", environment))
    [before] = fork_server._servers
    found = fork_server._running({"A": "1"})
    assert found == (("new", {"A": "1"}) if is_new else before) and fork_server._servers == [found]
    fork_server._servers.clear()
    assert fork_server._running({"B": "2"}) == ("new", {"B": "2"})


@pytest.mark.parametrize(
    ("waits", "more"),
    [([0], []), ([subprocess.TimeoutExpired("p", 1.0), 0], [("kill",), ("wait",)])],
)
def test_the_end_of_a_server(monkeypatch, waits, more):
    """Its connection is closed; a server that does not end within a second is killed."""
    calls = Calls(wait=waits)
    monkeypatch.setattr(fork_server, "_servers", [server(calls)])
    fork_server.end()
    assert calls.made == [("close",), ("wait", 1.0), *more] and fork_server._servers == []


def test_the_start_of_a_server(monkeypatch):
    """It prints nothing and leads a group of its own."""
    calls = Calls(popen=["process"])
    ours, theirs = Pipes(calls, "ours"), Pipes(calls, "theirs", 8)
    monkeypatch.setattr(fork_server, "Pipe", lambda: (ours, theirs))
    monkeypatch.setattr(fork_server, "subprocess", SimpleNamespace(Popen=calls("popen"), DEVNULL="nothing"))
    assert fork_server._started({"A": "1"}) == ("process", ours)
    command = [sys.executable, "-P", "-m", "crosscheck.processes.fork_server"]
    streams = ("stdin", 8), ("stdout", "nothing"), ("stderr", "nothing")
    assert calls.made == [
        ("popen", command, *streams, ("env", {"A": "1"}), ("start_new_session", True)),
        ("theirs.close",),
    ]


def test_a_request_for_a_fork(monkeypatch):
    """The environment, and the numbers of input, output and news."""
    calls = Calls(dup=[6])
    news, theirs = Pipes(calls, "news"), Pipes(calls, "theirs", 8)
    monkeypatch.setattr(fork_server, "Pipe", lambda duplex: None if duplex else (news, theirs))
    monkeypatch.setattr(fork_server, "_running", lambda environment: server(calls))
    monkeypatch.setattr(fork_server, "os", calls.of("dup"))
    sockets = SimpleNamespace(
        socket=lambda fileno: Pipes(calls, f"socket {fileno}"),
        send_fds=lambda sending, parts, numbers: calls("send_fds")(parts, numbers),
    )
    monkeypatch.setattr(fork_server, "socket", sockets)
    monkeypatch.setattr(fork_server, "Forked", lambda end: end)
    assert fork_server.forked(1, 2, {"A": "1"}) is news
    assert calls.made == [
        ("send", {"A": "1"}),
        ("dup", 4),
        ("send_fds", [b"."], [1, 2, 8]),
        ("socket 6.close",),
        ("theirs.close",),
    ]


def test_a_fork_that_is_waited_for():
    fork = fork_server.Forked(SimpleNamespace(recv=lambda: 7, poll=lambda timeout: False))
    for timeout, seconds in ((0.5, 0.5), (0, 0.0)):
        with pytest.raises(subprocess.TimeoutExpired) as caught:
            fork.wait(timeout)
        assert caught.value.timeout == seconds
    assert fork.poll() is None and fork.pid == 7


# --- a child and its owner ----------------------------------------------------------------------------------
def owned(calls: Calls, **parts: Any) -> Child:
    made = Child.__new__(Child)
    made._channel = calls.of("send", "close", "recv_bytes")
    made._printed = calls.of("seek", "truncate", "close", read=lambda: b"printed")
    made._process = SimpleNamespace(pid=7, poll=calls("poll"), wait=calls("wait"))
    made._has_answer = lambda limit: True
    for name, value in parts.items():
        setattr(made, name, value)
    return made


def test_a_job_of_a_child(monkeypatch):
    """Ten times its limit and ten seconds more until the child ends itself."""
    calls, folders = Calls(**{"recv_bytes": [pickle.dumps((True, 5))] * 2}), []
    real = tempfile.TemporaryDirectory
    named = lambda **options: folders.append(options) or real(prefix=options["prefix"])  # noqa: E731
    monkeypatch.setattr(child, "tempfile", SimpleNamespace(TemporaryDirectory=named))
    made = owned(calls)
    seen = made._called((divmod, (7, 2), True), 3.0)
    assert folders == [{"prefix": "crosscheck-", "ignore_cleanup_errors": True}]
    assert seen == (5, "printed", ()) and made._copies is True
    [(_, (folder, last_resort, *asked))] = [call for call in calls.made if call[0] == "send"]
    assert last_resort == 40.0 and asked == [divmod, (7, 2), True] and "crosscheck-" in folder
    assert calls.made[:2] == [("seek", 0), ("truncate",)]
    made._called((divmod, (7, 2), False), 3.0)
    assert made._copies is False


def test_a_job_that_fails_or_is_late():
    calls = Calls(recv_bytes=[pickle.dumps((False, "no pose"))], send=[None, BrokenPipeError(), None])
    made = owned(calls)
    with pytest.raises(ChildFailed, match="no pose; last printed: printed") as caught:
        made._called((divmod, (7, 0), False), 3.0)
    assert caught.value.outcome is Outcome.CRASHED
    made._ask(("job",), 3.0)  # the connection is closed; the answer says why
    made._has_answer = lambda limit: limit > 3.0
    with pytest.raises(ChildFailed, match=r"^no result after 3 s; ") as caught:
        made._ask(("job",), 3.0)
    assert caught.value.outcome is Outcome.TIMED_OUT


@pytest.mark.parametrize(
    ("status", "killed", "wanted"),
    [
        (None, None, [("poll",), ("killpg", 7, "kill"), ("wait",)]),
        (None, ProcessLookupError(), [("poll",), ("killpg", 7, "kill"), ("wait",)]),
        (0, None, [("poll",), ("wait",)]),
    ],
)
def test_a_child_and_its_group_are_killed(monkeypatch, status, killed, wanted):
    calls = Calls(poll=[status] * 2, killpg=[killed] * 2)
    monkeypatch.setattr(child, "os", calls.of("killpg"))
    monkeypatch.setattr(child, "signal", SimpleNamespace(SIGKILL="kill"))
    made = owned(calls)
    made.kill()
    assert calls.made == wanted
    monkeypatch.setattr(child, "_alive", {made})
    child.stop_all()
    assert calls.made == 2 * wanted and child._alive == {made}


def test_a_child_that_is_closed(monkeypatch):
    calls = Calls()
    made = owned(calls, kill=calls("kill"))
    monkeypatch.setattr(child, "_alive", {made})
    made.close()
    assert calls.made == [("kill",), ("close",), ("close",)] and child._alive == set()


def test_an_interrupted_call_ends_its_child():
    calls = Calls(called=[KeyboardInterrupt(), "seen"])
    made = owned(calls, kill=calls("kill"), _called=calls("called"))
    with pytest.raises(KeyboardInterrupt):
        made.call(divmod, (7, 2), 3.0)
    assert calls.made == [("called", (divmod, (7, 2), False), 3.0), ("kill",)]
    assert made.call(divmod, (7, 2), 3.0, in_copy=True) == "seen"
    assert calls.made[2:] == [("called", (divmod, (7, 2), True), 3.0)]


def test_ten_seconds_for_a_child_without_connection():
    calls = Calls(wait=[-9])
    assert owned(calls)._ending() == "was ended by SIGKILL" and calls.made == [("wait", 10.0)]


@pytest.mark.parametrize(
    ("is_available", "forked"), [(True, ["fork"]), (True, [EOFError()]), (True, [OSError()]), (False, [])]
)
def test_the_start_of_a_child(monkeypatch, is_available, forked):
    """A fork of the server; without it, a program that prints to the file."""
    calls = Calls(forked=forked, popen=["program"])
    can_fork = forked == ["fork"]
    monkeypatch.setattr(child, "fork_server", calls.of("forked", AVAILABLE=is_available))
    monkeypatch.setattr(child, "subprocess", SimpleNamespace(Popen=calls("popen"), STDOUT="output"))
    monkeypatch.setattr(child, "_environment", lambda: {"A": "1"})
    assert child._started(3, 4) == ("fork" if can_fork else "program")
    command = [sys.executable, "-P", "-m", "crosscheck.processes.serve"]
    streams = ("stdin", 3), ("stdout", 4), ("stderr", "output")
    program = ("popen", command, *streams, ("env", {"A": "1"}), ("start_new_session", True))
    wanted = [("forked", 3, 4, {"A": "1"})] * is_available + [program] * (not can_fork)
    assert calls.made == wanted


def test_the_environment_of_a_child(monkeypatch):
    monkeypatch.setattr(child.sys, "path", ["", "/x"])
    monkeypatch.chdir("/")
    monkeypatch.setenv("OMP_NUM_THREADS", "8")
    monkeypatch.setenv("KEPT", "yes")
    found = child._environment()
    assert found["PYTHONPATH"] == "/:/x" and found["KEPT"] == "yes"
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    assert [found[name] for name in names] == ["1"] * 4


def test_one_child_at_a_time_prepares_an_engine(monkeypatch):
    """The second waits for the first; a family that is prepared, and another engine, do not wait."""
    monkeypatch.setattr(pool, "_prepared", {("e", "ready")})
    monkeypatch.setattr(pool, "_preparing", {})
    with pool._alone_at_first("e", "slow"):
        assert pool._preparing["e"].locked()
        with pool._alone_at_first("e", "ready"), pool._alone_at_first("f", "slow"):
            assert pool._preparing["f"].locked()
        assert ("e", "slow") not in pool._prepared and ("f", "slow") in pool._prepared
    assert ("e", "slow") in pool._prepared and not pool._preparing["e"].locked()
    with pytest.raises(ValueError), pool._alone_at_first("e", "broken"):
        raise ValueError
    assert ("e", "broken") not in pool._prepared and not pool._preparing["e"].locked()


@pytest.mark.parametrize(
    ("question", "child_of", "more"),
    [
        (pool.run_isolated, "m:e", {"question": serve.run_once}),
        (pool.run_in_turn, "m:e", {}),
        (pool.observe, "m:e f ready", {"in_copy": True}),
        (pool.observe, "", {}),
    ],
)
def test_runs_of_a_child(monkeypatch, question, child_of, more):
    """A run alone, in turn with others, in a copy, and in a process of its own where nothing is copied."""
    calls = Calls()
    run = SimpleNamespace(value=SimpleNamespace(outcome=Outcome.COMPLETED))
    monkeypatch.setattr(pool, "_observed", lambda *given, **named: calls("run")(*given, **named) or run)
    monkeypatch.setattr(pool, "_in_use", lambda name: Pipes(calls, name))
    monkeypatch.setattr(pool, "Child", lambda: Pipes(calls, ""))
    monkeypatch.setattr(pool.fork_server, "AVAILABLE", bool(child_of))
    assert question("m:e", "scene", "times", SimpleNamespace(family="f"), 20.0) in (run, run.value)
    (name, used, *given), closed = calls.made
    assert (name, given[:3], given[4:]) == ("run", ["m:e", "scene", "times"], [20.0, *more.items()])
    assert given[3].family == "f" and isinstance(used, Pipes) and closed == (f"{child_of}.close",)


def test_a_question_is_named_while_it_starts(monkeypatch):
    """An engine's capabilities are asked of its child."""
    calls, said = Calls(), []
    waiting = SimpleNamespace(last_printed=lambda: "")

    def call(*given: Any) -> Any:
        said.extend(pool.starting().values())
        return calls("call")(*given) or SimpleNamespace(value="capabilities")

    waiting.call = call
    monkeypatch.setattr(pool, "_in_use", lambda name: nullcontext(waiting))
    monkeypatch.setattr(pool, "_prepared", set())
    assert pool.capabilities("m:e", "scene", 3.0) == "capabilities"
    assert calls.made == [("call", serve.capabilities, ("m:e", "scene"), 3.0)] and said == ["m:e starts"]


def test_a_call_without_a_result_printed_nothing(monkeypatch):
    def call(*given: Any) -> Any:
        raise ChildFailed(Outcome.CRASHED, "lost")

    monkeypatch.setattr(pool, "_made_ready", lambda *of: (("1", 0.5), "said", ()))
    monkeypatch.setattr(pool.serve, "failed", lambda *of: of)
    seen = pool._observed(SimpleNamespace(ready=None, call=call), "m:e", "scene", "times", SETTING, 2.0)
    assert seen == (("m:e", "1", "scene", SETTING, Outcome.CRASHED, "lost"), "", ())


@pytest.mark.skipif(not fork_server.AVAILABLE, reason="processes are not forked on this system")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # of a process with threads
@pytest.mark.parametrize("kept_by_parent", [pool._idle, fork_server._servers])
def test_children_and_servers_belong_to_the_process_that_started_them(kept_by_parent):
    before = list(kept_by_parent)
    kept_by_parent.append(None)
    try:
        if not (fork := os.fork()):
            os._exit(len(kept_by_parent))
        assert os.waitstatus_to_exitcode(os.waitpid(fork, 0)[1]) == 0 < len(kept_by_parent)
    finally:
        kept_by_parent[:] = before


def test_an_engine_runs_the_scene_at_the_times_with_a_setting(monkeypatch):
    setting = SimpleNamespace(options={"step": 0.5})
    made = SimpleNamespace(engine="e", version="1", settings={"step": 0.5})
    simulator = SimpleNamespace(name="e", version=lambda: "1", run=lambda *given: given)
    monkeypatch.setattr(
        answer, "well_formed", lambda run, scene, times: seen.append((run, scene, times)) or made
    )
    seen: list[Any] = []
    assert answer.answered(simulator, "scene", "times", setting) is made
    assert seen == [(("scene", "times", setting), "scene", "times")]


def test_a_new_child_is_known_until_it_is_closed(monkeypatch):
    monkeypatch.setattr(child, "_alive", set())
    started: list[Any] = []
    process = SimpleNamespace(poll=lambda: 0, wait=lambda: 0)
    monkeypatch.setattr(
        child, "_started", lambda channel, printed: started.append((channel, printed)) or process
    )
    made = Child()
    assert child._alive == {made} and made.ready is None and not made.is_alive and len(started) == 1
    assert started[0][1] == made._printed.fileno() != started[0][0]
    made._printed.write(b"a")
    assert made.last_printed() == "a"
    made.close()
    assert child._alive == set()


@pytest.mark.parametrize("question", [pool.run_isolated, pool.run_estimated, pool.run_in_turn, pool.observe])
def test_runs_of_unknown_engines(monkeypatch, question):
    monkeypatch.setattr(pool, "_in_use", None)
    with pytest.raises(LookupError, match="unknown engine 'nosuch'; known: mbref"):
        question("nosuch", "scene", "times", SETTING, 2.0)


@pytest.mark.parametrize(
    ("question", "outcome", "ends"),
    [
        (pool.run_isolated, Outcome.COMPLETED, False),
        (pool.run_isolated, Outcome.NOT_FINITE, True),
        (pool.observe, Outcome.COMPLETED, False),
        (pool.observe, Outcome.NOT_FINITE, True),
        (pool.run_in_turn, Outcome.NOT_FINITE, False),
    ],
)
def test_a_run_that_does_not_complete_ends_its_child(monkeypatch, question, outcome, ends):
    """Unless further runs take turns in it."""
    calls = Calls()
    monkeypatch.setattr(pool.fork_server, "AVAILABLE", True)
    monkeypatch.setattr(pool, "_in_use", lambda name: nullcontext(SimpleNamespace(kill=calls("kill"))))
    run = SimpleNamespace(value=SimpleNamespace(outcome=outcome))
    monkeypatch.setattr(pool, "_observed", lambda *of, **more: run)
    question("m:e", "scene", "times", SETTING, 2.0)
    assert calls.made == [("kill",)] * ends
