"""Starts at singular positions / decisions and accelerations worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.equations.branches import MOST_BRANCHED_ROWS, Fit
from mbref.stepping import singular_start as start
from mbref.stepping.singular_start import Leaving

Q = np.array([9.0])


def run(**changes: Any) -> Any:
    """A run of one loop with projection: three velocities, rows of rank 1 at most poses and 2 pivots."""
    given: dict[str, Any] = {
        "v": [0.0, 0.0, 0.0],
        "driver": (),
        "loops": 1,
        "projects": True,
        "rows": 2,
        "generic": 1,
        "velocities": 3,
        "rank": 1,
        "pivots": 2,
        "least": 1.0,
        "force": [0.0, 0.0, 0.0],
        **changes,
    }
    terms = SimpleNamespace(force=np.array(given["force"], dtype=float))
    return SimpleNamespace(
        scene=SimpleNamespace(driver=given["driver"]),
        start=SimpleNamespace(q=Q, v=np.array(given["v"], dtype=float)),
        model=SimpleNamespace(
            closed_loops=given["loops"],
            m=given["rows"],
            mass=np.array([2.0, 3.0, 5.0]),
            terms=lambda t, q, v: terms,
        ),
        method=SimpleNamespace(stabilisation=SimpleNamespace(projects=given["projects"])),
        memory=SimpleNamespace(
            active=SimpleNamespace(velocities=np.zeros(given["velocities"])),
            watch=SimpleNamespace(generic_rank=given["generic"]),
            pivots=np.zeros(given["pivots"]),
        ),
        ranks=SimpleNamespace(rank=given["rank"], least=given["least"]),
    )


MOVING = {"v": [0.0, 1.0, 0.0]}


def test_velocities_of_first_order():
    assert start.freedoms_of_first_order(run()) == 2
    assert start.freedoms_of_first_order(run(projects=False)) == 0
    assert start.freedoms_of_first_order(run(rows=MOST_BRANCHED_ROWS)) == 2
    assert start.freedoms_of_first_order(run(rows=MOST_BRANCHED_ROWS + 1)) == 0


@pytest.mark.parametrize(
    ("changes", "rests"),
    [({}, True), (MOVING, False), ({"driver": (1,)}, False), ({"loops": 0}, False), ({"generic": 2}, False)],
)
def test_starts_at_rest_with_two_velocities(changes, rests):
    assert start.begins_at_rest(run(**changes)) is rests


@pytest.mark.parametrize(
    ("changes", "moves"),
    [
        ({}, True),
        ({"v": [0.0] * 3}, False),
        ({"rank": 2}, False),
        ({"loops": 0}, False),
        ({"generic": 2}, False),
        ({"generic": 2, "driver": (1,)}, True),
        ({"generic": 3, "driver": (1,)}, False),
    ],
)
def test_starts_in_motion_with_dependent_rows(changes, moves):
    assert start.begins_in_motion(run(**{**MOVING, **changes})) is moves


@pytest.mark.parametrize(
    ("changes", "off", "near"),
    [
        ({"least": 0.99 * start.NEAR_SINGULAR}, start.MET, True),
        ({"least": 0.99 * start.NEAR_SINGULAR}, 1.01 * start.MET, False),
        ({"least": start.NEAR_SINGULAR}, 0.0, False),
        ({"least": 0.0, "v": [0.0] * 3}, 0.0, False),
    ],
)
def test_starts_near_a_singular_position(monkeypatch, changes, off, near):
    asked: list[Any] = []
    monkeypatch.setattr(start, "rate_violation", lambda model, q, v: asked.append((q, v)) or off)
    made = run(**{**MOVING, **changes})
    assert start.begins_near_singular(made) is near
    assert not asked or (asked[0][0] is Q and asked[0][1] is made.start.v)


def test_the_acceleration_along_the_velocities():
    """Velocities (1, 2, 0), forces (4, 3, 9) N and masses 2, 3 and 5 kg: 10 W over 14 J."""
    v = np.array([1.0, 2.0, 0.0])
    forward = run(v=v, force=[4.0, 3.0, 9.0])
    assert start.acceleration_along(forward) == pytest.approx(v * 10 / 14)
    for changes in ({"force": [-4.0, 1.0, 9.0]}, {"force": [-2.0, 1.0, 9.0]}, {"driver": (1,)}):
        still = run(**{"v": v, "force": [4.0, 3.0, 9.0], **changes})
        assert start.acceleration_along(still).tolist() == [0.0, 0.0, 0.0]


@pytest.fixture
def branches(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Directions of branches and how velocities fit them."""
    found = SimpleNamespace(tangents=np.zeros((0, 3)), fit=None)
    monkeypatch.setattr(start, "tangents", lambda model, q: found.tangents)
    monkeypatch.setattr(start, "fit_to_branches", lambda model, t, q, v: found.fit if t == 0.0 else 1 / 0)
    monkeypatch.setattr(start, "rate_violation", lambda *_: 0.0)
    return found


def test_the_acceleration_from_rest_along_a_branch(branches):
    """Along (1, 1, 0) 3² / 5, along (0, 1, 2) -10² / 23: the second one, backwards."""
    branches.tangents = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 2.0]])
    resting = run(force=[4.0, -1.0, -4.5])
    expected = np.array([0.0, 1.0, 2.0]) * -10 / 23
    assert start.leaving_acceleration(resting) == pytest.approx(expected)
    branches.tangents = branches.tangents[::-1]
    assert start.leaving_acceleration(resting) == pytest.approx(expected)
    branches.tangents = branches.tangents[:1]
    assert start.leaving_acceleration(resting) is None, "one branch"
    branches.tangents = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
    for part, leaves in ((1.01, True), (0.99, False)):
        force = [5.0, part * start.NO_FORCE * 5.0, 0.0]
        assert (start.leaving_acceleration(run(force=force)) is not None) is leaves
    assert start.leaving_acceleration(run()) is None, "no forces"


def test_how_a_run_leaves_its_start(branches):
    branches.tangents = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 2.0]])
    resting = run(force=[4.0, -1.0, -4.5])
    found = start.leaving(resting)
    assert isinstance(found, Leaving) and found.coordinates is Q and found.velocities is resting.start.v
    assert found.acceleration == pytest.approx(np.array([0.0, 1.0, 2.0]) * -10 / 23)
    assert start.begins_on_singular_position(resting)
    branches.tangents = branches.tangents[:1]
    assert start.leaving(resting) is None and not start.begins_on_singular_position(resting)
    moving = run(**MOVING, force=[0.0, 6.0, 0.0])
    for fit, leaves in ((None, 0), (Fit(True, True), 1), (Fit(True, False), 0), (Fit(False, True), 0)):
        branches.fit = fit
        found = start.leaving(moving)
        assert (found is not None) == leaves
        assert start.begins_on_singular_position(moving) is (fit is not None)
        assert start.fits_no_branch(moving) is (fit is not None and not fit.fits)
    branches.fit = Fit(True, True)
    found = start.leaving(moving)
    assert found is not None and found.acceleration.tolist() == [0.0, 2.0, 0.0]
    regular = run(**MOVING, rank=2)
    assert start.leaving(regular) is None and not start.begins_on_singular_position(regular)
    near = run(**MOVING, rank=2, least=0.5 * start.NEAR_SINGULAR)
    assert start.leaving(near) is not None and start.begins_on_singular_position(near)
    branches.fit = Fit(False, True)
    assert not start.fits_no_branch(regular)
