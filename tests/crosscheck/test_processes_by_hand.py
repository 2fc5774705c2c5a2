"""Child processes / time that is counted, children that are kept and answers that are checked, on paper."""

from __future__ import annotations

import math
import os
import pickle
import signal
import subprocess
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from multiprocessing import Pipe
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Cannot, Owner, Setting
from crosscheck.processes import answer, child, pool, serve
from crosscheck.processes.answer import MalformedAnswer, well_formed
from crosscheck.processes.child import ChildFailed, Observation
from crosscheck.processes.fork_server import Forked
from mbref.scene import Body, Revolute, Scene
from mbref.trajectory import Cost, Outcome, Trajectory

TIMES = np.array([0.0, 0.1, 0.3])
PLAIN = Setting("plain", {"step": 0.5})
BLOCKS = tuple(
    Body(name=name, mass=2.0, inertia=(1.0, 1.0, 1.0), position=(x, 0.0, 0.0))
    for name, x in (("a", 1), ("b", 2))
)
SCENE = Scene(
    name="still",
    body=BLOCKS,
    joint=(Revolute(name="J", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),),
)


def run(**parts: Any) -> Trajectory:
    zero = np.zeros((len(parts.get("times", TIMES)), 2, 3))
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (len(zero), 2, 1))
    made = Trajectory("still", "e", "1", "m", {"step": 0.5}, TIMES, ("a", "b"), zero, turn, zero, zero)
    return replace(made, **{"t_end": 0.3, "cost": Cost(seconds=0.1), **parts})


def refused(**parts: Any) -> str:
    with pytest.raises(MalformedAnswer) as caught:
        well_formed(run(**parts), SCENE, TIMES)
    return str(caught.value)


# --- answers ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("size", [1 - 0.9e-3, 1 + 0.9e-3, 1 - 1.1e-3, 1 + 1.1e-3])
def test_length_of_quaternions(size):
    turn = run().orientation.copy()
    turn[1, 1] *= size
    if abs(size - 1) < 1e-3:
        assert (well_formed(run(orientation=turn), SCENE, TIMES).orientation == turn).all()
    else:
        assert refused(orientation=turn) == "orientation: has a quaternion that is not of unit length"


@pytest.mark.parametrize("name", ["acceleration", "angular_acceleration"])
def test_accelerations_may_be_missing_but_not_of_another_shape(name):
    assert getattr(well_formed(run(), SCENE, TIMES), name) is None
    assert getattr(well_formed(run(**{name: np.ones((3, 2, 3)).tolist()}), SCENE, TIMES), name).sum() == 18
    assert refused(**{name: np.ones((3, 2, 4))}) == f"{name}: has shape (3, 2, 4), not (3, 2, 3)"


def test_reactions_of_known_joints():
    forces = well_formed(run(reactions={"J": np.ones((3, 6)).tolist()}), SCENE, TIMES).reactions
    assert forces["J"].shape == (3, 6) and well_formed(run(reactions={}), SCENE, TIMES).reactions == {}
    assert refused(reactions={"J": np.ones((3, 5))}) == "reactions[J]: has shape (3, 5), not (3, 6)"
    for wrong in ({"K": np.ones((3, 6))}, [("J", np.ones((3, 6)))]):
        assert refused(reactions=wrong) == "reactions: name joints that the scene does not have"


def test_times_that_are_not_the_first_ones():
    first = "times: are not the first of the requested times"
    assert refused(times=TIMES[1:]) == first and refused(times=np.array([*TIMES, 0.4])) == first
    assert refused(times=TIMES[:, None]) == first
    assert refused(times=TIMES[:2]) == "times: completed with 2 of 3 samples"
    early = {"times": TIMES[:0], "outcome": Outcome.STEP_FAILED}
    none = np.zeros((0, 2, 3))
    found = well_formed(
        run(**early, position=none, velocity=none, angular_velocity=none, orientation=np.zeros((0, 2, 4))),
        SCENE,
        TIMES,
    )
    assert found.times.size == 0


def test_bodies_in_another_order():
    assert well_formed(run(bodies=["b", "a"]), SCENE, TIMES).bodies == ("b", "a")
    assert refused(bodies=("a",)) == "bodies: are ('a',), but the scene has ('a', 'b')"
    assert refused(bodies="ab").startswith("bodies: are 'ab'")
    assert refused(version="  ") == "version: is empty"
    assert refused(t_end=np.zeros(1)) == "t_end: has shape (1,), not ()"


def test_costs():
    found = well_formed(run(cost=Cost(0.5, 0.25, steps=np.int64(3), newton=7.0)), SCENE, TIMES).cost
    assert found == Cost(0.5, 0.25, steps=3, newton=7) and type(found.steps) is type(found.newton) is int
    assert type(found.build_seconds) is float
    assert refused(cost=Cost(0.1, steps=-1)) == "cost: is negative"
    assert refused(cost=Cost(0.1, rhs=math.inf)) == "cost: is not finite"
    assert refused(cost=Cost(0.1, rhs="many")) == "cost.rhs: is str, not an array of numbers"


@pytest.mark.parametrize("parts", [{"outcome": Outcome.NOT_FINITE}, {"t_end": 0.0}])
def test_only_a_completed_motion_takes_time(monkeypatch, parts):
    monkeypatch.setattr(answer, "LEAST", 1e-9)
    assert well_formed(run(cost=Cost(), **parts), SCENE, TIMES).cost.seconds == 0.0
    assert refused(cost=Cost()) == "cost: is 0 s, of a run that completed"
    assert well_formed(run(cost=Cost(1e-9)), SCENE, TIMES).cost.seconds == 1e-9


class Paper:
    """An engine on paper that gives ``made``."""

    name, package, compile_seconds = "e", "e-package", 2.5

    def __init__(self, made: Trajectory | None = None, **parts: Any) -> None:
        self.made, self.parts = made or run(), parts
        self.prepared: list[Any] = []

    def version(self) -> str:
        if "missing" in self.parts:
            raise ImportError(self.parts["missing"])
        return "1"

    def prepare(self, families: Any) -> None:
        self.prepared.append(families)

    def run(self, *given: Any) -> Trajectory:
        return self.made

    def cannot(self, scene: Scene) -> Cannot | None:
        return self.parts.get("cannot")

    def settings(self, scene: Scene) -> list[Setting]:
        return [PLAIN, Setting("fine", {"step": 0.1})]

    def settings_of(self, scene: Scene, family: str) -> tuple[Setting, ...]:
        return tuple(s for s in self.settings(scene) if s.family == family)

    def best_settings(self, scene: Scene) -> tuple[Setting, ...]:
        return (Setting("best"),)

    def serves(self, scene: Scene, family: str) -> bool:
        return bool(self.settings_of(scene, family))


@pytest.mark.parametrize(
    ("made", "says"),
    [
        ({"engine": "f"}, "engine: is 'f', not 'e'"),
        ({"version": "2"}, "version: is '2', not '1'"),
        ({"settings": {"step": 0.25}}, "settings: step is 0.25, not 0.5"),
        ({"settings": {}}, "settings: step is None, not 0.5"),
    ],
)
def test_answers_name_their_engine_and_options(made, says):
    with pytest.raises(MalformedAnswer) as caught:
        answer.answered(Paper(run(**made)), SCENE, TIMES, PLAIN)
    assert str(caught.value) == says
    more = run(settings={"step": np.float64(0.5), "order": 4})
    assert answer.answered(Paper(more), SCENE, TIMES, PLAIN).settings == {"step": 0.5, "order": 4}


# --- calls in the child -----------------------------------------------------------------------------------
@pytest.fixture
def paper(monkeypatch: pytest.MonkeyPatch) -> Any:
    def use(**parts: Any) -> Paper:
        made = Paper(**parts)
        monkeypatch.setattr(serve, "engine", lambda name: made)
        return made

    return use


def test_an_engine_gets_ready(paper):
    engine = paper()
    assert serve.get_ready("e", ["plain"]) == ("1", 2.5) and engine.prepared == [["plain"]]
    assert paper(missing="no e").prepared == [] and serve.get_ready("e", ["plain"]) == ("", 0.0)


def test_a_missing_package_fails_a_run_with_what_to_install(paper):
    paper(missing="no module e")
    failed = serve.run_once("e", SCENE, TIMES, PLAIN)
    assert failed.outcome is Outcome.CRASHED and failed.message == "e-package is not installed: no module e"
    assert (failed.scene, failed.engine, failed.version, failed.method) == ("still", "e", "", "plain")
    assert failed.settings == {"step": 0.5} and failed.bodies == ("a", "b") and failed.times.size == 0
    paper()
    assert serve.run_once("e", SCENE, TIMES, PLAIN).outcome is Outcome.COMPLETED


def test_only_a_motion_with_samples_has_an_error_estimate(paper, monkeypatch):
    monkeypatch.setattr(Trajectory, "with_error_estimate", lambda self, seconds: ("estimated", seconds))
    paper()
    assert serve.run_estimated("e", SCENE, TIMES, PLAIN, 3.0) == ("estimated", 3.0)
    paper(missing="no e")
    assert serve.run_estimated("e", SCENE, TIMES, PLAIN, 3.0).outcome is Outcome.CRASHED


def test_what_an_engine_offers(paper):
    no = Cannot(Owner.MODEL, "loads")
    engine = paper()
    assert serve.capabilities("e", SCENE) == ("1", None, engine.settings(SCENE))
    assert serve.offered("e", SCENE, "fine") == ("1", None, [engine.settings(SCENE)[1]])
    assert serve.offered("e", SCENE, "") == ("1", None, [Setting("best")])
    unserved = Cannot(Owner.MODEL, "rough has no settings for this scene")
    assert serve.offered("e", SCENE, "rough") == ("1", unserved, [])
    assert serve.refused("e", SCENE, "fine") is None and serve.refused("e", SCENE, "rough") == unserved
    paper(cannot=no)
    assert serve.capabilities("e", SCENE) == serve.offered("e", SCENE, "fine") == ("1", no, [])
    assert serve.refused("e", SCENE, "fine") == serve.refused("e", SCENE, "rough") == no


def test_runs_take_turns_after_a_warm_up(monkeypatch):
    """The first round does not count; a run that does not complete has no time."""
    seconds, order = iter([9.0, 0.1, 0.2, 0.3]), []

    class Timed(Paper):
        def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
            order.append(setting.family)
            if setting.family == "ends":
                return run(outcome=Outcome.NOT_FINITE)
            return run(cost=Cost(next(seconds)))

    monkeypatch.setattr(serve, "engine", lambda name: Timed())
    jobs = [("e", Setting("ends")), ("e", PLAIN)]
    ended, timed = serve.run_interleaved(SCENE, TIMES, jobs, 3)
    assert timed == [0.1, 0.2, 0.3] and len(ended) == 3 and all(map(math.isnan, ended))
    assert order == ["ends", "plain"] * 4


def test_answers_are_pickled_values_or_sentences():
    assert pickle.loads(serve._answer(divmod, (7, 2))) == (True, (3, 1))
    assert pickle.loads(serve._answer(divmod, (7, 0)))[0] is False
    assert "ZeroDivisionError" in pickle.loads(serve._answer(divmod, (7, 0)))[1]


@pytest.mark.parametrize(("status", "ends"), [(0, [0]), (3, [3]), (-11, [(7, 11), 0])])
def test_a_process_ends_as_its_copy(monkeypatch, status, ends):
    seen: list[Any] = []
    system = SimpleNamespace(getpid=lambda: 7, kill=lambda *given: seen.append(given), _exit=seen.append)
    monkeypatch.setattr(serve, "os", system)
    serve._end_as(status)
    assert seen == ends


def test_a_copy_answers_and_a_crash_of_it_is_passed_on(monkeypatch):
    """The copies are forks of this process that end after their call."""
    assert pickle.loads(serve._answer_of_copy(60.0, divmod, (7, 2))) == (True, (3, 1))
    ends: list[int] = []
    monkeypatch.setattr(serve, "_end_as", lambda status: ends.append(status) or b"ended")
    assert serve._answer_of_copy(60.0, os._exit, (3,)) == b"ended"
    assert serve._answer_of_copy(60.0, signal.raise_signal, (signal.SIGKILL,)) == b"ended"
    assert ends == [3, -9]


opened = ExitStack()  # files of a test


@pytest.fixture(autouse=True)
def _all_is_closed():
    yield
    opened.close()


# --- the child --------------------------------------------------------------------------------------------
class Waiting(child.Child):
    """A child whose process, connection and output are on paper."""

    def __init__(self, printed: bytes = b"", cpu: Any = (), polls: int = 10**6) -> None:
        self.now, self._copies, self.intervals = 0.0, False, []
        self._printed = opened.enter_context(tempfile.TemporaryFile(buffering=0))  # noqa: SIM115
        self._printed.write(printed)
        self._channel = SimpleNamespace(poll=self._poll)
        self._cpu, self._polls = cpu, polls

    def _poll(self, interval: float) -> bool:
        self.now += interval
        self.intervals.append(interval)
        assert len(self.intervals) < 1000, "it waits without end"
        return len(self.intervals) > self._polls

    def _cpu_seconds(self) -> float:
        return self._cpu(self.now) if self._cpu else 0.0


def waited(monkeypatch: pytest.MonkeyPatch, limit: float, **parts: Any) -> tuple[bool, Waiting]:
    made = Waiting(**parts)
    monkeypatch.setattr(child, "time", SimpleNamespace(monotonic=lambda: 50.0 + made.now))
    return made._has_answer(limit), made


@pytest.mark.parametrize(
    ("limit", "cpu", "passed"),
    [
        (0.5, None, 0.5),  # it waits: wall time counts
        (0.5, lambda t: t, 0.6),  # it computes on a whole core
        (0.5, lambda t: 2 * t, 0.4),  # two threads
        (0.5, lambda t: 1e-3 * t, 5.0),  # others have the cores: ten times the limit
        (0.5, lambda t: t / 5, 2.6),
    ],
)
def test_time_of_a_call(monkeypatch, limit, cpu, passed):
    is_there, made = waited(monkeypatch, limit, cpu=cpu)
    assert not is_there and made.now == pytest.approx(passed, abs=0.11)
    assert max(made.intervals) == 0.2 and min(made.intervals) > 0


def test_an_answer_that_comes_in_time(monkeypatch):
    is_there, made = waited(monkeypatch, 5.0, polls=3)
    assert is_there and made.intervals == [0.2] * 4
    assert waited(monkeypatch, 0.3)[1].intervals == pytest.approx([0.2, 0.1])


@pytest.mark.parametrize(("copies", "seconds"), [(False, 3.0), (True, 10.0)])
def test_cpu_time_of_a_process_and_of_its_copy(monkeypatch, copies, seconds):
    def used(user: float, system: float, *children: Any) -> Any:
        return SimpleNamespace(
            cpu_times=lambda: SimpleNamespace(user=user, system=system), children=lambda: list(children)
        )

    made = Waiting()
    made._process, made._copies = SimpleNamespace(pid=7), copies
    tree = used(1.0, 2.0, used(3.0, 4.0, used(50.0, 60.0)))
    monkeypatch.setattr(child.psutil, "Process", lambda pid: tree if pid == 7 else None)
    assert child.Child._cpu_seconds(made) == seconds

    def ended(pid: int) -> Any:
        raise child.psutil.NoSuchProcess(pid)

    monkeypatch.setattr(child.psutil, "Process", ended)
    assert child.Child._cpu_seconds(made) == 0.0


def test_the_last_line_that_was_printed():
    assert child._last_line("one\n two \n\n  \n") == "two" and child._last_line("\n") == ""
    assert Waiting(b"one\ntwo\n").last_printed() == "two"
    long = Waiting(b"a\n" + b"x" * (child.TAIL - 1))
    assert long.last_printed() == "x" * (child.TAIL - 1)
    assert Waiting(b"first" + b"y" * child.TAIL).last_printed() == "y" * child.TAIL, "the end is searched"


def test_a_failure_quotes_200_characters_of_the_last_line():
    failed = Waiting(b"start\n" + b"x" * 300)._failure(Outcome.CRASHED, "it ended")
    assert failed.outcome is Outcome.CRASHED and str(failed) == "it ended; last printed: " + "x" * 200
    assert str(Waiting()._failure(Outcome.TIMED_OUT, "late")) == "late"


@pytest.mark.parametrize(
    ("status", "says"),
    [(-9, "was ended by SIGKILL"), (3, "ended with exit status 3"), (None, "does not answer")],
)
def test_how_a_process_ended(status, says):
    def wait(seconds: float) -> int:
        if status is None:
            raise subprocess.TimeoutExpired("p", seconds)
        return status

    made = Waiting()
    made._process = SimpleNamespace(wait=wait)
    assert made._ending() == says
    made._channel.recv_bytes = lambda: (_ for _ in ()).throw(EOFError)
    with pytest.raises(ChildFailed, match=f"the process {says}") as caught:
        made._answer()
    assert caught.value.outcome is Outcome.CRASHED


def test_an_answer_that_cannot_be_read():
    made = Waiting()
    made._channel.recv_bytes = lambda: b"nonsense"
    with pytest.raises(ChildFailed, match="its answer cannot be read"):
        made._answer()


def piped(pid: int) -> tuple[Forked, Any]:
    news, theirs = Pipe(duplex=False)
    opened.enter_context(theirs)
    theirs.send(pid)
    return Forked(opened.enter_context(news)), theirs


def test_a_fork_and_its_exit_status():
    fork, theirs = piped(123)
    assert fork.pid == 123 and fork.poll() is None
    with pytest.raises(subprocess.TimeoutExpired):
        fork.wait(0.01)
    theirs.send(-11)
    assert fork.wait(1.0) == -11 == fork.poll() == fork.wait()
    lost, theirs = piped(5)
    theirs.close()
    assert lost.poll() == -signal.SIGKILL, "the process that waits for the fork was killed"


# --- children that are kept -------------------------------------------------------------------------------
class Kept:
    """A child on paper."""

    def __init__(self, value: Any = None, fails: Outcome | None = None) -> None:
        self.is_alive, self.closed, self.ready, self.calls = True, False, None, []
        self.value, self.fails = value, fails

    def close(self) -> None:
        self.closed, self.is_alive = True, False

    def kill(self) -> None:
        self.is_alive = False

    def last_printed(self) -> str:
        return ""

    def call(self, function: Any, arguments: Any, limit: float, in_copy: bool = False) -> Observation:
        self.calls.append((function, arguments, limit, in_copy))
        if function is serve.get_ready:
            return Observation(("1", 0.5), "ready ", ())
        if self.fails:
            raise ChildFailed(self.fails, "no result")
        return Observation(self.value, "seen", ("file",))


@pytest.fixture
def idle(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any]]:
    """The idle children, none at first; a further child is a new ``Kept``."""
    kept: list[tuple[str, Any]] = []
    monkeypatch.setattr(pool, "_idle", kept)
    monkeypatch.setattr(pool, "Child", lambda: Kept(run()))
    monkeypatch.setattr(pool, "_prepared", set())
    return kept


def test_the_latest_living_child_of_an_engine_is_used(idle):
    first, second, dead, other = (Kept() for _ in range(4))
    idle += [("e", first), ("e", second), ("e", dead), ("f", other)]
    dead.is_alive = False
    assert pool._idle_child("e") is second and pool._idle_child("e") is first
    assert pool._idle_child("e") is None and [name for name, _ in idle] == ["e", "f"]
    with pool._in_use("g", instead="f") as used:
        assert used is other
    assert idle[-1] == ("g", other), "it is kept under the new name"
    with pool._in_use("h") as used:
        assert isinstance(used, Kept) and used not in (first, second, other)


def test_eight_children_are_kept(idle):
    children = [Kept() for _ in range(10)]
    children[4].is_alive = False
    for k, each in enumerate(children):
        pool._put_back(f"e{k}", each)
    assert [name for name, _ in idle] == [f"e{k}" for k in (1, 2, 3, 5, 6, 7, 8, 9)]
    assert [each.closed for each in children] == [k in (0, 4) for k in range(10)]
    pool.end_idle()
    assert idle == [] and all(each.closed for each in children)


def test_an_isolated_run_and_its_estimate(idle):
    assert pool.run_isolated("m:e", SCENE, TIMES, PLAIN, 20.0).outcome is Outcome.COMPLETED
    [(name, used)] = idle
    ready, question = used.calls
    assert ready == (serve.get_ready, ("m:e", ["plain"]), 600.0, False) and name == "m:e"
    assert question == (serve.run_once, ("m:e", SCENE, TIMES, PLAIN), 20.5, False), "with its compilation"
    pool.run_estimated("m:e", SCENE, TIMES, PLAIN, 20.0)
    estimate = used.calls[-1][0]
    assert estimate.func is serve.run_estimated and estimate.keywords == {"seconds": 2.0}
    assert ("m:e", "plain") in pool._prepared


def test_a_run_that_does_not_complete_ends_its_child(idle, monkeypatch):
    monkeypatch.setattr(pool, "Child", lambda: Kept(run(outcome=Outcome.NOT_FINITE)))
    assert pool.run_isolated("m:e", SCENE, TIMES, PLAIN, 20.0).outcome is Outcome.NOT_FINITE
    assert idle == []
    monkeypatch.setattr(pool, "Child", lambda: Kept(fails=Outcome.TIMED_OUT))
    ended = pool.run_isolated("m:e", SCENE, TIMES, PLAIN, 20.0)
    assert (ended.outcome, ended.message, ended.version) == (Outcome.TIMED_OUT, "no result", "1")


def test_an_observed_run_is_made_in_a_copy_of_a_ready_process(idle, monkeypatch):
    monkeypatch.setattr(pool.fork_server, "AVAILABLE", True)
    for _ in range(2):
        seen = pool.observe("m:e", SCENE, TIMES, PLAIN, 20.0)
        assert (seen.printed, seen.files) == ("ready seen", ("file",))
    [(name, used)] = idle
    assert name == "m:e plain ready" and [call[3] for call in used.calls] == [False, True, True]
    monkeypatch.setattr(pool.fork_server, "AVAILABLE", False)
    pool.observe("m:e", SCENE, TIMES, PLAIN, 20.0)
    assert len(idle) == 1 and len(used.calls) == 3, "a new process, which ends"


def test_questions_and_computations_have_their_children(idle):
    assert pool.ask("m:e", divmod, (7,), 5.0) is not None
    assert idle[0][1].calls == [(divmod, ("m:e", 7), 5.0, False)] and ("m:e", None) in pool._prepared
    assert pool.apart(divmod, (7, 2), 3.0) is not None
    assert idle[1][0] == "" and idle[1][1].calls == [(divmod, (7, 2), 3.0, False)]
    pool.time_interleaved(SCENE, TIMES, [("m:e", PLAIN)], 4, 9.0)
    assert idle[-1][0] == "*" and idle[-1][1].calls[-1] == (
        serve.run_interleaved,
        (SCENE, TIMES, [("m:e", PLAIN)], 4),
        9.0,
        False,
    )
    assert [name for name, _ in idle] == ["", "*"], "the child of the first job's engine was used"


@pytest.mark.parametrize("name", ["nosuch", "mbref ", ""])
def test_unknown_engines(idle, name):
    for question in (
        lambda: pool.ask(name, divmod, (), 1.0),
        lambda: pool.time_interleaved(SCENE, TIMES, [("m:e", PLAIN), (name, PLAIN)], 1, 1.0),
        lambda: pool.observe(name, SCENE, TIMES, PLAIN, 1.0),
    ):
        with pytest.raises(LookupError, match=f"unknown engine '{name}'; known: mbref"):
            question()
    assert idle == []


def test_engines_that_start_are_named_with_what_they_print(monkeypatch):
    monkeypatch.setattr(pool, "_starting", {})
    quiet, loud = Kept(), Kept()
    loud.last_printed = lambda: "compiling"
    with pool._starts("quiet plain", quiet):
        [(_, said)] = pool.starting().items()
        assert said == "quiet plain starts"
    with pool._starts("loud plain", loud):
        assert list(pool.starting().values()) == ["compiling"]
    assert pool.starting() == {}
    with pytest.raises(ValueError), pool._starts("quiet plain", quiet):
        raise ValueError
    assert pool.starting() == {}
