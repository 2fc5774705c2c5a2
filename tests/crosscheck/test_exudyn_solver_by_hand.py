"""A solver of Exudyn on a stand-in for its library / clocks, states, counts and ends worked out by hand."""

from __future__ import annotations

import itertools
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.exudyn import dynamic
from crosscheck.engines.exudyn.dynamic import Solver, State
from mbref.trajectory import Outcome

SCENE = SimpleNamespace(driver=())


class SolverError(Exception):
    """Exudyn's error of a solver."""


class Library:
    """A stand-in for Exudyn: it notes settings, and fails in the runs whose numbers are given."""

    SolverError = SolverError
    InternalError = ZeroDivisionError
    ConfigurationType = SimpleNamespace(Initial="initial")

    def __init__(self, *failing: int) -> None:
        self.asked: list[tuple] = []
        self.failing = failing

    def SimulationSettings(self) -> Any:
        part = SimpleNamespace
        return part(timeIntegration=part(), solution=part(sensors=part(), file=part()))

    def SolveDynamic(self, settings: Any, solverType: str, updateInitialValues: bool) -> None:
        span = settings.timeIntegration
        assert updateInitialValues
        self.asked.append((span.startTime, span.endTime, span.numberOfSteps, solverType))
        if len(self.asked) in self.failing:
            raise SolverError("it failed")


def system(library: Library, redundant: bool = False) -> Any:
    """A system of one body whose coordinates are t and whose force is 2 t."""
    numbers = SimpleNamespace(
        currentTime=0.0, currentStepSize=0.25, currentStepIndex=6, newtonJacobiCount=3, newtonStepsCount=9
    )
    flags = SimpleNamespace(
        linearSolverFailed=False, massMatrixNotInvertible=False, newtonConverged=False, residual=0.5
    )
    solver = SimpleNamespace(it=numbers, conv=flags, output=SimpleNamespace(finishedSuccessfully=True))
    mbs = SimpleNamespace(sys={"dynamicSolver": solver}, SolveDynamic=library.SolveDynamic)

    def samples() -> Any:
        start, end, *_ = library.asked[-1]
        numbers.currentTime = end
        solver.output.finishedSuccessfully = len(library.asked) not in library.failing
        times = np.array([start, end])
        values = np.zeros((3, 2, 1, 7))
        values[0], values[1] = times[:, None, None], 1.0
        return times, values, 2 * times[:, None]

    return SimpleNamespace(mbs=mbs, redundant=redundant, samples=samples)


@pytest.fixture
def clock(monkeypatch) -> None:
    """A CPU clock that shows 1, 3, 6, 10, … s."""
    ticks = itertools.accumulate(itertools.count(1))
    monkeypatch.setattr(time, "process_time", lambda: float(next(ticks)))


def solver(monkeypatch, library: Library, scene: Any = SCENE, **parts: Any) -> Solver:
    monkeypatch.setattr(dynamic, "build", lambda exu, given, forces: system(library, **parts))
    return Solver(library, scene)


def configure(exu: Any, settings: Any, singular: bool) -> str:
    return f"solver {singular}"


def test_a_run_in_two_stretches(monkeypatch, clock):
    """Built in 3 - 1 s; stepping took 10 - 6 and 21 - 15 s. Samples at 0.5, 1 and 3 s, steps of 0.2 s."""
    library = Library()
    made = solver(monkeypatch, library)
    assert (made.built, made.seconds, made.now, made.reached, made.singular) == (2.0, 0.0, 0.0, 0.0, False)
    (times, values, forces), ending = made.run(
        np.array([0.5, 1.5]), lambda interval: round(interval / 0.25), configure
    )
    assert ending is None and times.tolist() == [0.5, 1.5] and forces[:, 0].tolist() == [1.0, 3.0]
    assert library.asked == [(0.0, 0.5, 2, "solver False"), (0.5, 1.5, 4, "solver False")]
    assert values[0, :, 0, 0].tolist() == [0.5, 1.5] and (made.now, made.reached) == (1.5, 1.5)
    cost = made.cost()
    assert (cost.seconds, cost.build_seconds) == (10.0, 2.0)
    assert (cost.steps, cost.factorisations, cost.newton) == (10, 6, 18)


def test_a_run_that_stops(monkeypatch, clock):
    library = Library(2)
    made = solver(monkeypatch, library, redundant=True)
    (times, *_), ending = made.run(np.array([0.5, 1.5, 4.5]), lambda interval: 1, configure)
    assert made.singular and library.asked[0][3] == "solver True" and len(library.asked) == 2
    assert (ending.outcome, ending.t) == (Outcome.NOT_CONVERGED, 0.5)
    assert times.tolist() == [0.5, 1.5] and made.now == 0.5 and made.reached == 1.25
    assert made.seconds == 10.0


@pytest.mark.parametrize(
    ("redundant", "driver", "singular"), [(False, (), False), (True, (), True), (False, (1,), True)]
)
def test_equations_that_may_be_singular(monkeypatch, redundant, driver, singular):
    scene = SimpleNamespace(driver=driver)
    assert solver(monkeypatch, Library(), scene, redundant=redundant).singular is singular


def test_states_are_read_and_put(monkeypatch):
    made, put = solver(monkeypatch, Library()), []
    data = {name: lambda configuration, name=name: [len(name), configuration == "initial"] for name in (
        "GetODE2Coordinates", "GetODE2Coordinates_t", "GetDataCoordinates")}  # fmt: skip
    for name in ("SetODE2Coordinates", "SetODE2Coordinates_t", "SetDataCoordinates"):
        data[name] = lambda values, configuration, name=name: put.append((name, list(values), configuration))
    made.system.mbs.systemData = SimpleNamespace(**data)
    made.now = 0.75
    state = made.state()
    assert state.t == 0.75
    assert [part.tolist() for part in state[1:]] == [[18, 1], [20, 1], [18, 1]]
    made.put(State(0.25, np.array([1.0]), np.array([2.0]), np.array([3.0])))
    assert made.now == 0.25 and put == [
        ("SetODE2Coordinates", [1.0], "initial"),
        ("SetODE2Coordinates_t", [2.0], "initial"),
        ("SetDataCoordinates", [3.0], "initial"),
    ]
    made.put(State(0.5, np.array([1.0]), np.array([2.0]), np.zeros(0)))
    assert len(put) == 5, "no data to put"


def test_one_run_of_equal_steps(monkeypatch, clock):
    library = Library()
    monkeypatch.setattr(dynamic, "build", lambda exu, given, forces: system(library))
    found = dynamic.integrate(library, SCENE, np.array([0.5, 1.5]), 0.3, configure)
    assert [asked[2] for asked in library.asked] == [2, 4] and found.outcome is Outcome.COMPLETED
    assert (found.t_end, found.message, found.cost.seconds) == (1.5, "", 10.0)
    failed = Library(2)
    monkeypatch.setattr(dynamic, "build", lambda exu, given, forces: system(failed))
    found = dynamic.integrate(failed, SCENE, np.array([0.5, 1.5]), 0.3, configure)
    assert found.outcome is Outcome.NOT_CONVERGED and "Newton's method stopped at t = 0.5 s" in found.message
