"""Memory, ranks and steps of one run / small mechanisms and tables worked out by hand."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.equations.model import Model
from mbref.input_error import InputError
from mbref.kernels.layout import SINGULAR_AHEAD
from mbref.method import Method
from mbref.scene import Body, Driver, Revolute, Scene, SceneError
from mbref.stepping import explicit, ranks, run
from mbref.stepping.limits import Limits
from mbref.stepping.loop import DONE, PAUSED
from mbref.stepping.ranks import NO_RANKS, Ranks
from mbref.stepping.run import Run, missing_masses

TIMES = np.array([0.0, 0.5, 1.0])


def pendulum(driven: bool = False, **body: Any) -> Scene:
    """A bar on a hinge about z: 5 rows and one freedom."""
    given = {"name": "bar", "mass": 2.0, "inertia": (0.1, 0.2, 0.3), "position": (0.25, 0.0, 0.0), **body}
    hinge = Revolute(name="A", bodies=("ground", "bar"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    drivers = (Driver(joint="A", polynomial=(0.0, 1.0)),) if driven else ()
    gravity = (0.0, -9.81, 0.0)
    return Scene(
        name="p", duration=1.0, gravity=gravity, body=(Body(**given),), joint=(hinge,), driver=drivers
    )


class Idle:
    """A stepper that only notes its release."""

    def __init__(self, made: Run) -> None:
        self.run, self.released = made, 0

    def advance(self, progress: Any) -> tuple[int, float]:
        raise NotImplementedError

    def release(self) -> None:
        self.released += 1


def made(method: str, scene: Scene | None = None, **limits: Any) -> Run:
    return Run(scene or pendulum(), Method.parse(method), TIMES, Limits(**limits), Idle)


# --- memory -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("method", "dense", "pivots", "watched", "coordinates", "velocities", "kept"),
    [
        ("mpi-svd+none", 5, 0, 0, 7, 6, 3),
        ("lm1+projection", 5, 2, 2, 4, 3, 3),
        ("alf-dual+projection", 0, 2, 2, 4, 3, 1),
        ("alf-dual+none", 0, 2, 0, 4, 3, 1),
        ("mpi-svd+partitioning", 5, 0, 0, 7, 6, 3),
    ],
)
def test_sizes_of_the_memory_of_a_run(method, dense, pivots, watched, coordinates, velocities, kept):
    """A bar in its plane moves along x and y and turns about z; two rows of its hinge's point act there."""
    of = made(method)
    memory, ends = of.memory, of.memory.loop.ends
    assert memory.equations.system.jacobian.shape == (dense, 6)
    assert memory.pivots.shape == (pivots,) and (memory.pivots == 1.0).all()
    assert ends.squared_pivots.shape == ends.pivots.shape == (watched,)
    assert (ends.gradient.size, ends.lower.size) == (
        (memory.factor.d.size, memory.factor.l.size) if watched else (0, 0)
    )
    assert (memory.active.coordinates.size, memory.active.velocities.size) == (coordinates, velocities)
    assert memory.equations.scene.primitives.kind.size == kept and memory.factor.symbolic.row.size == pivots
    assert memory.loop.samples.coordinates.shape == (3, 7) and memory.loop.times.tolist() == TIMES.tolist()
    assert (memory.chart is None) == (method.endswith("none"))
    assert of.built == of.making == 0.0 and of.crossings == []
    of.release()
    assert isinstance(of.stepper, Idle) and of.stepper.released == 1


def test_the_start_of_a_run_is_in_its_memory():
    of = made("alf-dual+projection", rank_tolerance=1e-8)
    memory, settings = of.memory, of.memory.equations.system.settings
    assert memory.state.coordinates.tolist() == [0.25, 0, 0, 1, 0, 0, 0] and not memory.state.velocities.any()
    assert (of.ranks.rank, memory.watch.generic_rank, memory.watch.regular) == (2, 2, 1)
    assert (settings.independent, settings.nearly_dependent, settings.rank_tolerance) == (1, 0, 1e-8)
    assert settings.rounding == pytest.approx(0.25e-15) and memory.control.rtol == 1e-9
    assert memory.equations.system.mass.tolist() == [2.0, 2.0, 2.0, 0.1, 0.2, 0.3]
    memory.state.coordinates[:] = 9.0
    memory.loop.times[:] = 7.0
    memory.control.rtol, settings.rank_tolerance = 5.0, 5.0
    memory.equations.scene.gravity[:] = 3.0
    memory.loop.clock.time = 4.0
    of.begin_again()
    assert memory.state.coordinates.tolist() == [0.25, 0, 0, 1, 0, 0, 0] and memory.loop.times[1] == 0.5
    assert (memory.control.rtol, settings.rank_tolerance, memory.loop.clock.time) == (1e-9, 1e-8, 0.0)
    assert memory.equations.scene.gravity.tolist() == [0.0, -9.81, 0.0]
    assert settings.rounding == pytest.approx(0.25e-15)
    of.release()


def test_memory_of_equal_methods_is_used_again():
    first = made("lm1+projection")
    memory = first.memory
    first.release()
    second = made("lm1+projection")
    assert second.memory is memory
    other = made("lm1+projection")
    assert other.memory is not memory
    second.release()
    third = made("lm2+projection")
    assert third.memory is not memory
    third.release()
    other.release()


@pytest.mark.parametrize(
    ("method", "given", "rounded"),
    [("mpi-svd+none", False, False), ("lm1+projection", True, True), ("alf-dual+none", True, True)],
)
def test_roundings_of_a_start_become_zero_where_rows_are_left_out(method, given, rounded):
    """A position of 1e-14 m is rounding in a scene of 0.25 m."""
    scene = pendulum(position=(0.25, 0.0, 0.5e-14))
    of = made(method, scene)
    assert bool(of.start.q[2] == 0.0) is rounded and (of.reduction is not None) is given
    if of.reduction is not None:
        assert of._blocks is not None
        assert of._blocks.tolist() == of.model.terms(0.0, of.start.q, of.start.v).blocks.tolist()
    of.release()


def test_rows_that_a_formulation_needs_or_not():
    data: Any = "data"
    for is_sparse, expected in ((True, ("data", 1)), (False, "data")):
        of = object.__new__(Run)
        of.method = SimpleNamespace(formulation=SimpleNamespace(is_sparse=is_sparse))  # type: ignore[assignment]
        of.reduction = SimpleNamespace(scene=lambda data, axis: (data, axis))  # type: ignore[assignment]
        assert of.reduced(data, 1) == expected  # type: ignore[comparison-overlap]
        of.reduction = None
        assert of.reduced(data, 1) == "data"  # type: ignore[comparison-overlap]


def test_bodies_without_mass_need_drivers_for_all_freedoms():
    bare = {"mass": None, "inertia": None}
    with pytest.raises(SceneError, match=r"body\[0\].mass: 'bar' has no mass and inertia, which a dynamic"):
        made("lm1+none", pendulum(**bare))
    of = made("lm1+none", pendulum(driven=True, **bare))
    assert of.model.kinematic
    of.release()
    scene = pendulum().with_(body=(*pendulum().body, Body(name="b", position=(0.0, 0.0, 0.0))))
    assert [line.partition(":")[0] for line in missing_masses(scene)] == ["body[1].mass"]
    assert missing_masses(pendulum()) == []


@pytest.mark.parametrize(
    ("rank", "pivots", "velocities", "driver", "independent", "regular"),
    [
        (3, 3, 4, False, True, True),
        (3, 3, 5, False, True, False),
        (2, 3, 2, True, False, True),
        (2, 3, 3, True, False, False),
        (2, 3, 3, False, False, True),
    ],
)
@pytest.mark.parametrize("projects", [True, False])
def test_what_ranks_tell_at_the_start(
    monkeypatch, rank, pivots, velocities, driver, independent, regular, projects
):
    """A motion begins at a regular position where Φ_q leaves one velocity, or none beside drivers."""
    asked: list[Any] = []
    found = Ranks(rank, 0.5e-5 if rank == 2 else 1e-5, 0.0)
    monkeypatch.setattr(run, "ranks_at", lambda *given: asked.append(given) or found)
    settings = SimpleNamespace(rounding=1e-15, independent=9, nearly_dependent=9)
    watch = SimpleNamespace(generic_rank=9, regular=9)
    of: Any = SimpleNamespace(
        memory=SimpleNamespace(
            state=SimpleNamespace(coordinates=np.zeros(2), velocities=np.zeros(2)),
            equations=SimpleNamespace(system=SimpleNamespace(settings=settings)),
            pivots=np.ones(pivots),
            factor="factor",
            watch=watch,
            active=SimpleNamespace(velocities=np.zeros(velocities)),
        ),
        start=SimpleNamespace(q=np.array([1.0, 2.0]), v=np.array([3.0, 4.0])),
        model=SimpleNamespace(length=0.5 if rank == 3 else 2.0),
        scene=SimpleNamespace(driver=driver),
        limits=SimpleNamespace(rank_tolerance=1e-7),
        method=SimpleNamespace(stabilisation=SimpleNamespace(projects=projects)),
        _blocks="blocks",
    )
    Run.put_start(of)
    assert of.memory.state.coordinates.tolist() == [1.0, 2.0] and of.memory.state.velocities.tolist() == [
        3.0,
        4.0,
    ]
    assert asked == [(of.model, of.start.q, "factor", 1e-7, "blocks")] and settings.independent == independent
    if projects:
        assert of.ranks == found and (watch.generic_rank, watch.regular) == (rank, regular)
        assert settings.nearly_dependent == (rank == 2)
        assert settings.rounding == (0.5e-15 if rank == 3 else 1e-15)
    else:
        assert of.ranks == NO_RANKS and watch.regular == 9 and settings.rounding == 1e-15


# --- ranks ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("values", "tolerance", "found"),
    [
        ([2.0, 1.0, 1e-3], 1e-2, (2, 1.0, 1e-3)),
        ([2.0, 1.0, 1e-3], 1e-4, (3, 1e-3, 0.0)),
        ([0.5, 0.25], 0.25, (1, 0.5, 0.25)),
        ([1e-3], 1e-2, (0, 1.0, 1e-3)),
        ([], 1e-2, (0, 1.0, 0.0)),
    ],
)
def test_ranks_of_singular_values(values, tolerance, found):
    assert ranks._ranks(np.array(values), tolerance) == found and NO_RANKS == (0, 1.0, 0.0)


def test_ranks_of_chosen_rows_and_columns():
    """Rows 2 and 0 of columns 1 and 3: (3, 4 · 2) and (3, 0), both of unit length in the metric."""
    dense = np.array([[9.0, 3.0, 9.0, 0.0], [9.0] * 4, [9.0, 3.0, 9.0, 4.0]])
    of: Any = SimpleNamespace(structure=SimpleNamespace(dense=lambda blocks: np.stack([dense] * len(blocks))))
    symbolic: Any = SimpleNamespace(row=np.array([2, 0]), column=np.array([1, 3]))
    root = np.array([[9.0, 1.0, 9.0, 0.75], [9.0, 1.0, 9.0, 1.0]])
    one, two = ranks.all_ranks(of, np.zeros((2, 3, 12)), root, symbolic, 1e-9)
    for found, cosine in ((one, np.sqrt(0.5)), (two, 0.6)):
        assert found == pytest.approx((2, np.sqrt(1 - cosine), 0.0))
    nothing: Any = SimpleNamespace(row=np.zeros(0), column=np.zeros(0))
    assert ranks.all_ranks(of, np.zeros((2, 3, 12)), root, nothing, 1e-9) == [NO_RANKS] * 2


@pytest.mark.parametrize(("count", "clear", "rank"), [(121, True, 121), (121, False, 0), (120, False, 7)])
@pytest.mark.parametrize("known", [True, False])
def test_many_rows_are_judged_by_their_pivots(monkeypatch, count, clear, rank, known):
    blocks = np.zeros((1, 12))
    monkeypatch.setattr(ranks, "are_clear", lambda *given: asked.append(given) or clear)
    monkeypatch.setattr(ranks, "all_ranks", lambda *given: asked.append(given) or [Ranks(7, 0.5, 0.25)])
    asked: list[Any] = []
    of: Any = SimpleNamespace(
        terms=lambda t, q: asked.append((t, q)) or SimpleNamespace(blocks=blocks),
        data=SimpleNamespace(metric_root=np.ones(6)),
    )
    symbolic = SimpleNamespace(row=np.zeros(count))
    factor: Any = SimpleNamespace(symbolic=symbolic)
    q: Any = "q"
    found = ranks.ranks_at(of, q, factor, 1e-7, blocks if known else None)
    assert found.rank == rank and (asked[0] == (0.0, "q")) is not known
    given = asked[-1]
    if count > 120:
        assert given == (of, blocks, factor) and found[1:] == (1.0, 0.0)
    else:
        assert given[0] is of and given[1].shape == (1, 1, 12) and given[2].shape == (1, 6)
        assert given[3:] == (symbolic, 1e-7)


@pytest.mark.parametrize(
    ("good", "pivots", "clear"),
    [(1, (1.0, 0.5), True), (0, (1.0, 0.5), False), (1, (1.0, 2.4e-4), False), (1, (1.0, 2.6e-4), True)],
)
def test_rows_whose_pivots_are_clear(monkeypatch, good, pivots, clear):
    """Squared pivots 1 / (l diagonal) of l at the places 0 and 2."""
    asked: list[Any] = []
    monkeypatch.setattr(ranks, "factorise_once", lambda *given: asked.append(given) or good)
    monkeypatch.setattr(ranks, "packed", lambda factor: SimpleNamespace(argument=factor))
    l = np.array([1 / (2.0 * pivots[0]), 99.0, 1 / (4.0 * pivots[1])])
    factor: Any = SimpleNamespace(
        l=l, diagonal=np.array([2.0, 4.0]), symbolic=SimpleNamespace(l_start=np.array([0, 2, 3]))
    )
    of: Any = SimpleNamespace(data=SimpleNamespace(metric_root="root"))
    assert ranks.are_clear(of, np.arange(4.0).reshape(2, 2), factor) is clear
    [(numbers, root, given)] = asked
    assert numbers.tolist() == [0.0, 1.0, 2.0, 3.0] and (root, given) == ("root", factor)


# --- steps of the compiled loop ---------------------------------------------------------------------------
def explicit_run(projects: bool = True, nearly: int = 1, now: float = 0.25, end: float = 1.0) -> Any:
    settings = SimpleNamespace(nearly_dependent=nearly)
    clock = SimpleNamespace(time=now, y_size=9, restart=9)
    memory = SimpleNamespace(
        loop=SimpleNamespace(clock=clock, y="y"),
        equations=SimpleNamespace(system=SimpleNamespace(settings=settings, counts=SimpleNamespace(steps=4))),
        state=SimpleNamespace(coordinates="q"),
        factor="factor",
    )
    entered: list[Any] = []
    enter = SimpleNamespace(callable=lambda *given: entered.append(given) or 5)
    return SimpleNamespace(
        memory=memory,
        packed=SimpleNamespace(argument="argument"),
        times=np.array([0.0, end]),
        model="model",
        method=SimpleNamespace(stabilisation=SimpleNamespace(enter=enter, projects=projects)),
        entered=entered,
        limits=SimpleNamespace(rank_tolerance=1e-7),
        ranks=Ranks(3, 1.0, 0.0),
    )


def test_the_chart_is_entered_at_the_beginning():
    of = explicit_run()
    stepper = explicit.ExplicitStepper(of)
    assert of.entered == [(0.25, "y", "argument")] and stepper.run is of
    assert (of.memory.loop.clock.y_size, of.memory.loop.clock.restart) == (5, 4)
    stepper.release()


@pytest.mark.parametrize(
    ("end", "singular", "status", "told"),
    [(1.0, False, DONE, [0.25, 0.25, 0.25]), (1.0, True, SINGULAR_AHEAD, []), (0.0, True, DONE, [0.25] * 3)],
)
def test_calls_of_the_loop_until_it_ends(monkeypatch, end, singular, status, told):
    of = explicit_run(end=end)
    statuses, looked = iter([PAUSED, PAUSED, DONE]), []
    monkeypatch.setattr(explicit, "advance_to_end", lambda argument: next(statuses))
    monkeypatch.setattr(explicit, "begins_on_singular_position", lambda given: singular and given is of)
    clock = iter([10.0, 12.5])
    monkeypatch.setattr(time, "process_time", lambda: next(clock))
    stepper = explicit.ExplicitStepper(of)
    stepper._pace = SimpleNamespace(judge=lambda given: given)  # type: ignore[assignment]
    monkeypatch.setattr(explicit.ExplicitStepper, "_look_at_rows_again", lambda self: looked.append(1))
    seen: list[float] = []
    assert stepper.advance(seen.append) == (status, 2.5) and seen == told and len(looked) == len(told)


def test_a_run_without_progress(monkeypatch):
    of = explicit_run()
    monkeypatch.setattr(explicit, "advance_to_end", lambda argument: DONE)
    monkeypatch.setattr(explicit, "begins_on_singular_position", lambda given: False)
    stepper = explicit.ExplicitStepper(of)
    monkeypatch.setattr(explicit.ExplicitStepper, "_look_at_rows_again", lambda self: None)
    assert stepper.advance(None)[0] == DONE


@pytest.mark.parametrize(
    ("projects", "nearly", "now", "found", "after"),
    [
        (True, 1, 0.25, Ranks(3, 1e-5, 0.0), 0),
        (True, 1, 0.25, Ranks(3, 0.9e-5, 0.0), 1),
        (True, 1, 0.25, Ranks(2, 1.0, 0.0), 1),
        (True, 1, 0.0, Ranks(3, 1.0, 0.0), 1),
        (False, 1, 0.25, Ranks(3, 1.0, 0.0), 1),
        (True, 0, 0.25, Ranks(2, 1.0, 0.0), 0),
    ],
)
def test_rows_that_are_independent_behind_the_start(monkeypatch, projects, nearly, now, found, after):
    of = explicit_run(projects, nearly, now)
    asked: list[Any] = []
    monkeypatch.setattr(explicit, "ranks_at", lambda *given: asked.append(given) or found)
    explicit.ExplicitStepper(of)._look_at_rows_again()
    assert of.memory.equations.system.settings.nearly_dependent == after
    asks = projects and nearly and now > 0
    assert asked == ([("model", "q", "factor", 1e-7)] if asks else [])


def test_limits_are_checked_before_a_run():
    with pytest.raises(InputError, match="rtol: must be"):
        made("lm1+none", rtol=0.0)
    of = Model(pendulum())
    assert of.terms(0.0, of.start()).blocks.shape == (5, 12)
