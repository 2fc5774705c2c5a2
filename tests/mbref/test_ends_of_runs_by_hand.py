"""Dead positions, trials, remedies and singular positions of runs / with stand-ins of runs, by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.equations.branches import MOST_BRANCHED_ROWS
from mbref.kernels.layout import NOT_CONVERGED, SINGULAR
from mbref.simulation import comparison, dead_position, remedies, singular_position, trial
from mbref.simulation.trial import Trial
from mbref.stepping.loop import DONE, LEFT_MOTION, STEP_TOO_SMALL, UNDECIDED, VIOLATED


def space(**given: Any) -> Any:
    return SimpleNamespace(**given)


# --- dead positions -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("given", "found"),
    [
        ({}, True),
        ({"driver": ()}, False),
        ({"m": 400}, True),
        ({"m": 401}, False),
        ({"q": math.nan}, False),
        ({"lever": 100.0}, False),
        ({"lever": 99.0}, False),
        ({"nu": 0.0}, False),
        ({"trial": None}, True),
        ({"trial": Trial(True, 3.0)}, False),
        ({"trial": Trial(False, 3.03)}, True),
        ({"trial": Trial(False, 3.04)}, False),
    ],
)
def test_dead_positions_of_drivers(monkeypatch, given, found):
    """The driver's rate of 2 rad/s turns a body by 2 lever rad/s; a dead position has a lever above 100."""
    facts: Any = {
        "driver": (1,),
        "m": 2,
        "q": 1.0,
        "lever": 101.0,
        "nu": 2.0,
        "trial": Trial(False, 3.0),
        **given,
    }

    def terms(t: float, q: np.ndarray) -> Any:
        assert t == 3.0 and q[0] == 1.0
        jacobian = np.zeros((2, 6))
        jacobian[0, 5], jacobian[1, 0] = 1 / facts["lever"], 1.0
        return space(jacobian=jacobian, nu=np.array([-facts["nu"], 0.0]))

    memory = space(
        state=space(coordinates=np.array([facts["q"], 0.0])), loop=space(clock=space(time=np.float64(3.0)))
    )
    model = space(m=facts["m"], nb=1, length=4.0, terms=terms)
    monkeypatch.setattr(dead_position, "trial_of", lambda run: facts["trial"])
    assert (
        dead_position.is_at_dead_position(
            space(memory=memory, model=model, scene=space(driver=facts["driver"]))
        )
        is found
    )


def test_velocities_are_over_the_length_of_the_mechanism(monkeypatch):
    """A rate of 0.5 m/s moves a point by 100 m/s: 20 lengths of 5 m a second, or 200 of 0.5 m over a rate of
    1 a second."""
    monkeypatch.setattr(dead_position, "trial_of", lambda run: None)
    for length, found in ((5.0, False), (0.5, True)):
        jacobian = np.array([[0.005, 0.0, 0.0, 0.0, 0.0, 0.0]])
        model = space(
            m=1, nb=1, length=length, terms=lambda t, q, g=jacobian: space(jacobian=g, nu=np.array([0.5]))
        )
        memory = space(state=space(coordinates=np.zeros(7)), loop=space(clock=space(time=1.0)))
        run: Any = space(memory=memory, model=model, scene=space(driver=(1,)))
        assert dead_position.is_at_dead_position(run) is found


# --- trials -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("given", "status", "passed", "found"),
    [
        ({}, UNDECIDED, 1, False),
        ({}, UNDECIDED, 2, True),
        ({}, DONE, 0, True),
        ({"steps": 2000}, DONE, 0, True),
        ({"steps": 2001}, DONE, 0, None),
        ({"bodies": 100}, DONE, 0, True),
        ({"bodies": 101}, DONE, 0, None),
        ({"series": False}, DONE, 0, None),
    ],
)
def test_runs_with_changed_limits(monkeypatch, given, status, passed, found):
    facts: Any = {"steps": 5, "bodies": 1, "series": True, **given}
    released: list[bool] = []
    made = space(
        crossings=[None] * passed,
        stepper=space(advance=lambda progress: (status, 0.0)),
        release=lambda: released.append(True),
    )

    def start(scene: Any, of: Any, times: Any, limits: Any) -> Any:
        assert limits == {"code": "generic", "most_steps": 2000, "rtol": 1e-13} and times == "times"
        return made

    monkeypatch.setattr(trial, "replace", lambda limits, **changes: changes)
    monkeypatch.setattr(trial, "start_run", start)
    run: Any = space(
        memory=space(equations=space(system=space(counts=space(steps=facts["steps"])))),
        method=space(is_series=facts["series"]),
        scene=space(body=[None] * facts["bodies"]),
        limits="limits",
        times="times",
        crossings=[None],
    )
    assert trial.passes_with(run, rtol=1e-13) is found and len(released) == (found is not None)


# --- remedies -----------------------------------------------------------------------------------------------
def undetermined(rows: Any, masses: Any = (0, 0, 1)) -> str:
    bodies = [space(name=name, mass=mass) for name, mass in zip("abc", masses, strict=True)]
    jacobian = np.zeros((len(rows), 18))
    for k, row in enumerate(rows):
        jacobian[k, [place for place, _ in row]] = [value for _, value in row]
    remedies.scaled_jacobian = lambda model, t, q: jacobian  # type: ignore[assignment]
    return remedies._undetermined(space(scene=space(body=bodies), model=None, start=space(q=None)))


def test_bodies_without_mass_that_nothing_holds(monkeypatch):
    """All six coordinates of bodies a and b but one, or but one sum, are held."""
    monkeypatch.setattr(remedies, "scaled_jacobian", None)
    held = [[(k, 1.0)] for k in range(12)]
    assert undetermined(held) == "" and undetermined(held, (1, 1, 1)) == ""
    assert undetermined(held[:8] + held[9:]) == "b" and undetermined(held[1:]) == "a"
    assert undetermined([*held[1:6], *held[7:], [(0, 1.0), (6, 0.5)]]) == "b", "which moves twice as far"
    assert undetermined([*held[1:6], *held[7:], [(0, 1.0), (6, 2.0)]]) == "a"
    assert undetermined(held, (0, 0, 0)) == "c"
    assert undetermined(held, (0, None, 1)) == ""


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"loose": "x"}, "nothing determines the motion of body 'x', which has mass 0"),
        ({"mass": 0.0}, "body 'b' lacks mass or a moment of inertia; use mass True redundancy False"),
        (
            {"mass": 0.0, "redundant": 2},
            "body 'b' lacks mass or a moment of inertia; use mass True redundancy True",
        ),
        ({"mass": 0.0, "completes": "taylor"}, "body 'b' lacks mass or a moment of inertia; taylor"),
        ({"redundant": 2}, "constraint rows are redundant (2 of 9); use mass False redundancy True"),
        ({"redundant": 2, "completes": "taylor"}, "constraint rows are redundant (2 of 9); taylor"),
        ({"redundant": 2, "bears": True}, "follows"),
        ({"mass": 0.0, "masses": True}, "follows"),
        ({"loops": 0}, ""),
        ({}, "follows"),
    ],
)
def test_remedies_for_a_singular_matrix(monkeypatch, given, says):
    facts: Any = {"loose": "", "mass": 1.0, "redundant": 0, "completes": "", "bears": False, "masses": False}
    facts |= {"loops": 1, **given}
    monkeypatch.setattr(remedies, "_undetermined", lambda run: facts["loose"])
    monkeypatch.setattr(remedies, "_completes", lambda run: facts["completes"])
    monkeypatch.setattr(remedies, "_follows", lambda run: "follows")
    monkeypatch.setattr(remedies, "counts", lambda scene: space(redundant=facts["redundant"], rows=9))
    bearing = lambda mass=False, redundancy=False: f"use mass {mass} redundancy {redundancy}"  # noqa: E731
    monkeypatch.setattr(remedies, "_bearing", bearing)
    formulation = space(handles_singular_mass=facts["masses"], handles_redundancy=facts["bears"])
    run: Any = space(
        method=space(formulation=formulation),
        scene=space(body=[space(name="a"), space(name="b")]),
        model=space(mass=np.array([*[1.0] * 11, facts["mass"], *[0.0] * 6]), closed_loops=facts["loops"]),
    )
    assert remedies.remedy(run, SINGULAR) == says


@pytest.mark.parametrize(
    ("status", "name", "series", "loops", "says"),
    [
        (NOT_CONVERGED, "alf", False, 1, "mpi-svd and mpi-qr solve without iteration"),
        (NOT_CONVERGED, "lm1", False, 1, "follows"),
        (STEP_TOO_SMALL, "lm1", False, 1, "follows"),
        (STEP_TOO_SMALL, "lm1", True, 1, "mbref diagnose prints the distance of the motion"),
        (STEP_TOO_SMALL, "lm1", False, 0, "mbref diagnose prints the distance of the motion"),
        (VIOLATED, "lm1", False, 1, "+projection corrects violations after every step"),
        (LEFT_MOTION, "lm1", False, 1, "follows"),
        (DONE, "lm1", False, 1, ""),
    ],
)
def test_remedies_for_other_ends(monkeypatch, status, name, series, loops, says):
    monkeypatch.setattr(remedies, "_completes", lambda run: "")
    monkeypatch.setattr(remedies, "_follows", lambda run: "follows")
    run: Any = space(
        method=space(formulation=space(name=name), is_series=series), model=space(closed_loops=loops)
    )
    found = remedies.remedy(run, status)
    assert found.startswith(says) and bool(found) == bool(says)


# --- singular positions -------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("loops", "reference", "smallest", "near"),
    [
        (1, 1.0, 0.029, True),
        (1, 1.0, 0.03, False),
        (1, 2.0, 0.05, True),
        (1, 0.0, -1.0, False),
        (0, 1.0, 0.0, False),
    ],
)
def test_steps_that_end_near_a_singular_position(loops, reference, smallest, near):
    watch = space(reference_pivot=reference, smallest_pivot=smallest)
    run: Any = space(memory=space(watch=watch), model=space(closed_loops=loops))
    assert singular_position.is_near(run) is near


@pytest.mark.parametrize(
    ("inside", "part", "rows", "rank", "time", "q", "v", "joints"),
    [
        (True, 0.25, 5, 2, 1.5, "pose", 1.5, ("at", 1.5, "pose", 2)),
        (True, 0.0, 5, 2, 1.0, "before", 1.0, ("at", 1.0, "before", 2)),
        (False, 0.25, 5, 2, 1.0, "before", 1.0, ("at", 1.0, "before", 2)),
        (True, 0.25, 5, 0, 1.5, "pose", 1.5, ()),
        (True, 0.25, MOST_BRANCHED_ROWS, 2, 1.5, "pose", 1.5, ("at", 1.5, "pose", 2)),
        (True, 0.25, MOST_BRANCHED_ROWS + 1, 2, 1.5, "pose", 1.5, ()),
    ],
)
def test_the_singular_position_of_a_run(monkeypatch, inside, part, rows, rank, time, q, v, joints):
    """From 1 s to 3 s, with velocities 1 and 3; a quarter of the step ends at 1.5 s."""
    clock = space(time=1.0, attempt_end=3.0)
    memory = space(
        loop=space(clock=clock, ends=space(pose=space(copy=lambda: "pose"))),
        watch=space(singular_part=part),
        state=space(velocities=3.0),
    )
    monkeypatch.setattr(singular_position, "_accepted", lambda run: ("before", 1.0))
    monkeypatch.setattr(singular_position, "_rank", lambda run, t, q: rank)
    monkeypatch.setattr(singular_position, "_joints", lambda run, t, q, rank: ("at", t, q, rank))
    found = singular_position.met_by(space(memory=memory, model=space(m=rows)), inside)
    assert found == (time, q, v, joints)


@pytest.mark.parametrize(
    ("values", "generic", "rank"), [([1.0, 0.5, 0.1], 1, 2), ([0.1, 0.0, 0.0], 0, 1), ([1.0, 0.5, 0.1], 3, 3)]
)
def test_the_regular_rank(monkeypatch, values, generic, rank):
    monkeypatch.setattr(singular_position, "_singular_values", lambda run, t, q: (np.array(values), None))
    run: Any = space(limits=space(rank_tolerance=0.1), memory=space(watch=space(generic_rank=generic)))
    assert singular_position._rank(run, 0.0, np.zeros(7)) == rank


@pytest.mark.parametrize(
    ("values", "rank", "joints"),
    [
        ([1.0, 0.5, 1e-9, 0.0], 3, ("B",)),
        ([1.0, 0.5, 0.02, 0.01], 4, ("B", "C")),
        ([1.0, 0.25, 0.2, 0.1], 4, ("C",)),
        ([1.0, 0.19, 0.15, 0.1], 4, ("A", "B", "C")),
        ([1.0, 0.5, 1e-9, 0.0], 2, ("A",)),
    ],
)
def test_joints_whose_rows_lose_rank(monkeypatch, values, rank, joints):
    """Rows k belong to A, A, B and C, and row k + 1 alone to the singular value k + 1; values below 0.03, or
    below twice the smallest of the rank, are lost."""
    left = np.eye(4)
    monkeypatch.setattr(singular_position, "_singular_values", lambda run, t, q: (np.array(values), left))
    run: Any = space(model=space(row_joint=["A", "A", "B", "C"]))
    assert singular_position._joints(run, 0.0, np.zeros(7), rank) == joints


# --- comparison ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("given", "may"),
    [
        ({}, False),
        ({"nearest": 0.09}, True),
        ({"nearest": 0.1}, False),
        ({"nearest": 0.09, "series": True}, False),
        ({"tolerance": 1e-10}, False),
        ({"tolerance": 2e-10}, True),
        ({"projects": False}, True),
        ({"projects": False, "loops": 0}, False),
    ],
)
def test_runs_that_may_have_left_their_motion(given, may):
    facts: Any = {"nearest": 1.0, "series": False, "tolerance": 1e-12, "projects": True, "loops": 1, **given}
    run: Any = space(
        method=space(is_series=facts["series"], stabilisation=space(projects=facts["projects"])),
        limits=space(rank_tolerance=facts["tolerance"]),
        memory=space(watch=space(nearest=facts["nearest"])),
        model=space(closed_loops=facts["loops"]),
    )
    assert comparison.may_leave(run) is may
