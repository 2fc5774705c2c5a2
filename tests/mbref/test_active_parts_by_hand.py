"""Lengths, ranks and moving parts of a scene / arrays worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.equations import active_coordinates as active
from mbref.equations import diagnosis, units
from mbref.equations.active_coordinates import RandomStates


# --- lengths and metrics ----------------------------------------------------------------------------------
def test_moments_of_inertia_of_a_projection():
    """A mass of 2 kg and a length of 3 m give at least 2 (0.5 · 3)² = 4.5 kg m²."""
    mass = np.array([2.0, 2.0, 2.0, 0.1, 4.5, 9.0, 1.0, 1.0, 1.0, 0.1, 0.2, 0.3])
    found = units.metric(mass, np.array([3.0, 0.4]))
    assert found.tolist() == pytest.approx([2, 2, 2, 4.5, 4.5, 9, 1, 1, 1, 0.1, 0.2, 0.3])
    assert mass[3] == 0.1, "the masses stay"
    both = units.metric(np.stack([mass, 2 * mass]), np.array([[3.0, 0.4], [1.0, 2.0]]))
    assert both[0].tolist() == found.tolist()
    assert both[1].tolist() == pytest.approx([4, 4, 4, 1, 9, 18, 2, 2, 2, 2, 2, 2])


def test_inverse_roots_and_lengths_of_rows():
    assert units.inverse_root(np.array([4.0, 0.25, 0.0])).tolist() == [0.5, 2.0, 1.0]
    rows = np.array([[3.0, 4.0], [0.0, 0.0], [0.0, -2.0]])
    assert units.row_lengths(rows).tolist() == [5.0, 1.0, 2.0]
    assert units.unit_rows(rows).tolist() == [[0.6, 0.8], [0.0, 0.0], [0.0, -1.0]]


def test_lengths_of_bodies_are_means_of_their_arms():
    """Arms of 5 m and 1 m of body 0, of 2 m of body 1; body 2 has its anchor in the centre."""
    arms = np.array([[3.0, 4.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -2.0], [0.0, 0.0, 0.0]])
    shares = np.array([[0.5, 0, 0], [0.5, 0, 0], [0, 1, 0], [0, 0, 1]])
    assert units.body_lengths(arms, shares).tolist() == [3.0, 2.0, 2.5]
    assert units.body_lengths(arms[:3], shares[:3, :2]).tolist() == [3.0, 2.0]
    assert units.body_lengths(0 * arms, shares).tolist() == [1.0, 1.0, 1.0]
    arms[3, 0] = 0.9 * units.SHORTEST_LENGTH * 3.0
    assert units.body_lengths(arms, shares)[2] == 2.5
    arms[3, 0] = 1.1 * units.SHORTEST_LENGTH * 3.0
    assert units.body_lengths(arms, shares)[2] == arms[3, 0]
    two = units.body_lengths(np.stack([arms, 2 * arms]), shares)
    assert two[1].tolist() == (2 * two[0]).tolist()


# --- ranks ------------------------------------------------------------------------------------------------
def test_counts_of_singular_values_and_rows_that_take_part():
    assert diagnosis._count_above(np.array([4.0, 2.0, 1.0]), 0.25) == 2
    assert diagnosis._count_above(np.zeros(0), 0.25) == 0
    assert diagnosis.rank_of(np.diag([3.0, 1.0, 1e-3]), 1e-2) == 2
    left = np.array([[0.6e-8, 0.8e-8], [0.6e-8, 0.81e-8], [0.0, -1.0]])
    assert diagnosis.take_part(left).tolist() == [False, True, True]
    assert diagnosis.take_part(np.zeros((2, 0))).tolist() == [False, False]
    model: Any = SimpleNamespace(n=6, m=4, row_joint=("A", "A", "B", "A"))
    found = diagnosis._counts(model, 3)
    assert (found.coordinates, found.rank, found.degrees_of_freedom) == (6, 3, 3)
    assert found.rows_by_joint == {"A": 3, "B": 1} and (found.rows, found.redundant) == (4, 1)


@pytest.mark.parametrize(("spin", "time"), [(2.0, 0.005), (0.0, 1.0), (1e-3, 1.0)])
def test_a_state_near_the_start(monkeypatch, spin, time):
    """The fastest body turns by 0.01 rad; accelerations of least norm obey γ."""
    terms = SimpleNamespace(jacobian=np.array([[0.0, 2.0, 0.0, 0.0, 0.0, 0.0]]), gamma=np.array([6.0]))
    model: Any = SimpleNamespace(terms=lambda t, q, v: terms)
    start: Any = SimpleNamespace(q="q", v=np.array([9.0, 0.0, 0.0, 0.5 * spin, -spin, 0.0]))
    monkeypatch.setattr(diagnosis, "displaced", lambda q, x: (q, x.tolist()))
    monkeypatch.setattr(diagnosis, "solve_positions", lambda model, t, q: ((t, *q), None))
    t, (at, q, moved) = diagnosis.perturbed_state(model, start)
    assert t == at == pytest.approx(time) and q == "q"
    expected = [9.0 * t, 1.5 * t * t, 0.0, 0.5 * spin * t, -spin * t, 0.0]
    assert moved == pytest.approx(expected)


@pytest.mark.parametrize(
    ("rank", "driver", "later", "freedoms"), [(6, (), 5, 0), (4, (), 5, 2), (4, (1,), 5, 1), (6, (1,), 5, 0)]
)
def test_degrees_of_freedom_beside_drivers(monkeypatch, rank, driver, later, freedoms):
    model: Any = SimpleNamespace(n=6, scene=SimpleNamespace(driver=driver))
    monkeypatch.setattr(diagnosis, "rank_at_start", lambda model, start: rank)
    monkeypatch.setattr(diagnosis, "perturbed_state", lambda model, start: (0.5, "q"))
    monkeypatch.setattr(diagnosis, "scaled_jacobian", lambda model, t, q: (t, q))
    monkeypatch.setattr(diagnosis, "rank_of", lambda matrix, tolerance: later if matrix == (0.5, "q") else 99)
    assert diagnosis.freedoms_left(model, "start") == freedoms  # type: ignore[arg-type]


@pytest.mark.parametrize("rows", [40, 41])
def test_the_rank_at_the_start(monkeypatch, rows):
    """Sparse factors find it for more than 40 rows."""
    model: Any = SimpleNamespace(m=rows)
    start: Any = SimpleNamespace(q="q")
    monkeypatch.setattr(
        diagnosis, "_redundancy", lambda *given: (given == (model, start)) and SimpleNamespace(rank=17)
    )
    monkeypatch.setattr(diagnosis, "scaled_jacobian", lambda *given: given)
    monkeypatch.setattr(diagnosis, "rank_of", lambda *given: given)
    dense = (model, 0.0, "q"), 1e-10
    assert diagnosis.rank_at_start(model, start) == (dense if rows == 40 else 17)


@pytest.mark.parametrize("rows", [3, 40, 41, 300, 301])
def test_parts_of_a_diagnosis(monkeypatch, rows):
    """All rows have the length 0.5 and are perpendicular, except the last two, which are equal."""
    names = [*["A"] * (rows - 2), "B", "C"]
    model: Any = SimpleNamespace(m=rows, n=rows + 2, row_joint=names)
    start: Any = SimpleNamespace(q="q")
    jacobian = np.eye(rows, rows + 2) / 2
    jacobian[-1] = jacobian[-2]
    limit = diagnosis.UNIQUE_SHARE
    shares = np.array([*[limit] * (rows - 2), np.nextafter(limit, 1.0), 0.5])
    sparse = SimpleNamespace(rank=rows - 1, shares=shares, singular_values=lambda: (0.25, 4.0))
    monkeypatch.setattr(diagnosis, "find_scene", lambda name: {"door": "scene"}[name])
    monkeypatch.setattr(diagnosis, "Model", lambda scene: {"scene": model}[scene])
    monkeypatch.setattr(diagnosis, "consistent_start", lambda given: start if given is model else None)
    monkeypatch.setattr(diagnosis, "_redundancy", lambda *given: given == (model, start) and sparse)
    monkeypatch.setattr(diagnosis, "_determined", lambda *given: given == (model, start) and "determined")
    monkeypatch.setattr(
        diagnosis, "scaled_jacobian", lambda *given: jacobian if given == (model, 0.0, "q") else None
    )
    found = diagnosis.diagnose("door")
    assert found.counts.rank == rows - 1 and found.counts.redundant == 1
    assert found.redundant_by_joint == {"B": 1, "C": 1} and found.unique_reactions == ("A",)
    sizes = (found.smallest_singular_value, found.largest_singular_value)
    assert sizes == pytest.approx((0.25, 4.0) if rows > 40 else (0.5, np.sqrt(0.5)))
    assert found.determined_reactions == ("determined" if rows <= 300 else None)


def test_terms_of_a_diagnosis_are_those_of_the_start(monkeypatch):
    """The unit rows, the sparse rows, and the components of reactions, all at t = 0."""
    start: Any = SimpleNamespace(q=np.arange(14.0))

    def terms(t: Any, q: np.ndarray) -> Any:
        blocks = f"blocks of {np.shape(t)}" if not np.any(t) and q.size == 14 else None
        return SimpleNamespace(jacobian=np.array([[3.0, 4.0]]) + np.max(t), blocks=blocks)

    structure = SimpleNamespace(sparse=lambda blocks: f"sparse {blocks}")
    model: Any = SimpleNamespace(terms=terms, nb=2, structure=structure)
    monkeypatch.setattr(diagnosis, "Redundancy", lambda matrix: f"redundancy of {matrix}")
    assert diagnosis._redundancy(model, start) == "redundancy of sparse blocks of ()"  # type: ignore[comparison-overlap]
    assert diagnosis.scaled_jacobian(model, 0.0, start.q).tolist() == [[0.6, 0.8]]

    def determined(given: Any, q: np.ndarray, blocks: str) -> dict[str, np.ndarray]:
        assert given is model and q.shape == (1, 2, 7) and blocks == "blocks of (1,)"
        return {"A": np.array([[True, False, True, False, False, True]])}

    monkeypatch.setattr(diagnosis, "determined_components", determined)
    assert diagnosis._determined(model, start) == {"A": ("force x", "force z", "moment z")}


def test_a_diagnosis_without_rows(monkeypatch):
    model: Any = SimpleNamespace(m=0, n=6, row_joint=[])
    monkeypatch.setattr(diagnosis, "find_scene", lambda name: name)
    monkeypatch.setattr(diagnosis, "Model", lambda scene: model)
    monkeypatch.setattr(diagnosis, "consistent_start", lambda model: SimpleNamespace(q="q"))
    monkeypatch.setattr(diagnosis, "_determined", lambda *given: {})
    monkeypatch.setattr(diagnosis, "scaled_jacobian", lambda *given: np.zeros((0, 6)))
    found = diagnosis.diagnose("free")
    assert (found.smallest_singular_value, found.largest_singular_value) == (0.0, 0.0)
    assert found.redundant_by_joint == {} and found.unique_reactions == () and found.counts.rank == 0


# --- parts that move --------------------------------------------------------------------------------------
def test_random_states_of_some_velocities():
    states = RandomStates(np.array([0.5, 0.25]), np.ones((2, 3)), 2 * np.ones((2, 3)))
    some = states.of(np.array([True, False, True]))
    assert some.part.tolist() == [0.5, 0.25]
    assert some.displacement.tolist() == [[1, 0, 1]] * 2 and some.velocity.tolist() == [[2, 0, 2]] * 2
    states = RandomStates(np.array([0.5]), np.array([[4.0, 5.0]]), np.array([[8.0, 9.0]]))
    some = states.of(np.array([True, False]))
    assert some.displacement.tolist() == [[4.0, 0.0]] and some.velocity.tolist() == [[8.0, 0.0]]
    found = active.random_states(3, 4)
    assert found.part.shape == (3,) and found.displacement.shape == found.velocity.shape == (3, 4)
    assert ((found.part >= 0.1) & (found.part <= 1.0)).all() and len(set(found.velocity.ravel())) == 12
    assert active.random_states(3, 4) is found


def test_times_and_places_of_random_states(monkeypatch):
    monkeypatch.setattr(active, "all_displaced", lambda *given: given)
    states = RandomStates(np.array([0.5, 0.25]), np.ones((2, 3)), 2 * np.ones((2, 3)))
    times, (q, x), v = states.about("q", 4.0)  # type: ignore[arg-type]
    assert times.tolist() == [2.0, 1.0] and q == "q" and x is states.displacement and v is states.velocity


def test_states_are_read_until_no_further_velocity_is_reached(monkeypatch):
    """At first nothing moves; the start moves column 0, whose motion reaches column 2."""
    asked: list[Any] = []
    sample = RandomStates(np.array([0.5]), np.ones((1, 3)), np.ones((1, 3)))
    monkeypatch.setattr(active, "random_states", lambda count, n: sample if (count, n) == (2, 3) else None)
    monkeypatch.setattr(active, "_steady", lambda model: None)
    monkeypatch.setattr(RandomStates, "about", lambda self, q, duration: (self.velocity, q, duration))
    moved = [np.array(m, dtype=bool) for m in ([1, 0, 0], [1, 0, 1], [1, 0, 1])]
    entries = [np.eye(2, dtype=bool), np.zeros((2, 2), dtype=bool)]

    def patterns(model: Any, terms: Any) -> Any:
        asked.append(terms)
        first = len(asked) == 1
        return entries[0 if first else 1].copy(), np.array([False, first]), np.array([False, False, False])

    def reached(model: Any, found: Any, rows: np.ndarray, columns: np.ndarray) -> Any:
        assert found.tolist() == [[True, False], [False, True]]
        assert rows.tolist() == [False, True] and columns.tolist() == [True, False, False]
        return moved.pop(0), np.array([True, False])

    monkeypatch.setattr(active, "patterns", patterns)
    monkeypatch.setattr(active, "reached", reached)
    model: Any = SimpleNamespace(n=3, scene=SimpleNamespace(duration=4.0), terms=lambda *given: given)
    read: list[RandomStates] = []
    moving, kept = active.active_entries(model, "q", np.array([0.5, 0.0, 0.0]), read)  # type: ignore[arg-type]
    assert moving.tolist() == [True, False, True] and kept.tolist() == [[True, False], [False, False]]
    assert [each.velocity.tolist() for each in read] == [[[0, 0, 0]], [[1, 0, 0]], [[1, 0, 1]]]
    assert asked[0][0].tolist() == [0.0] and asked[0][1] == "q" and asked[0][2].tolist() == [0.5, 0.0, 0.0]
    assert [(given[0].tolist(), *given[1:]) for given in asked[1:]] == [
        ([[0, 0, 0]], "q", 4.0),
        ([[1, 0, 0]], "q", 4.0),
        ([[1, 0, 1]], "q", 4.0),
    ]


def model_of(columns: list[list[int]]) -> Any:
    return SimpleNamespace(n=12, entry_columns=np.array(columns))


def test_blocks_that_a_force_or_a_row_reaches():
    """Row 0 connects columns 0 and 7, row 1 columns 7 and 3, row 2 column 5 and the fixed frame (12)."""
    model = model_of([[0, 7], [7, 3], [5, 12]])
    entries, none = np.ones((3, 2), dtype=bool), np.zeros(12, dtype=bool)
    rows = np.zeros(3, dtype=bool)
    found, reached = active.reached(model, entries, rows, none | (np.arange(12) == 3))
    assert np.flatnonzero(found).tolist() == [0, 3, 7] and reached.tolist() == [True, True, False]
    found, reached = active.reached(model, entries, np.array([False, False, True]), none)
    assert np.flatnonzero(found).tolist() == [5] and reached.tolist() == [False, False, True]
    entries[1, 0] = False
    found, reached = active.reached(model, entries, rows, none | (np.arange(12) == 3))
    assert np.flatnonzero(found).tolist() == [3] and reached.tolist() == [False, True, False]
    assert found.shape == (12,)


def test_entries_rows_and_columns_that_are_not_zero():
    """Two states: an entry counts where it is not zero at one of them; entries of the fixed frame never."""
    blocks = np.zeros((2, 3, 2))
    blocks[0, 0, 0] = blocks[1, 1, 1] = blocks[0, 2, 1] = 5.0
    numbers = np.zeros((3, 2, 3))
    numbers[0, 0, 0] = numbers[1, 1, 1] = 1e-300
    numbers[2, 0, 1] = -1.0
    force = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, -1.0]])
    terms: Any = SimpleNamespace(blocks=blocks, phi=numbers[0], nu=numbers[1], gamma=numbers[2], force=force)
    bodies = np.array([[True, True], [True, True], [True, False]])
    model: Any = SimpleNamespace(structure=SimpleNamespace(of_bodies=bodies))
    entries, rows, columns = active.patterns(model, terms)
    assert entries.tolist() == [[True, False], [False, True], [False, False]]
    assert rows.tolist() == [True, True, False] and columns.tolist() == [False, True, True]


def test_numbers_of_the_size_of_rounding_become_zero():
    """Positions relative to a length of 10 m, Euler parameters to 1, velocities to the largest one."""
    still = active.STILL
    q = np.array([[9.9 * still, 10.1 * still, 5.0, 1.0, 0.9 * still, 1.1 * still, -0.9 * still]])
    v = np.array([[4.0, 3.9 * still, 4.1 * still, -3.9 * still, -3.9 * still, 0.0]])
    given = np.array([[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]])
    places, rates = active.without_rounding(q, v, given, np.array([10.0]))
    assert places.tolist() == [[0.0, 10.1 * still, 5.0, 1.0, 0.0, 1.1 * still, 0.0]]
    assert rates.tolist() == [[4.0, 0.0, 4.1 * still, 0.0, -3.9 * still, 0.0]]
    least = np.array([[still, 2.0, 3.0, 1.0, still, 0.0, 0.0]])
    rates_of = np.array([[1.0, still, 0.0, 0.0, 0.0, 0.0]])
    places, rates = active.without_rounding(least, rates_of, np.zeros((1, 6)), np.ones(1))
    assert places.tolist() == least.tolist() and rates.tolist() == rates_of.tolist(), "at the limit"
    two = (np.vstack([numbers] * 2) for numbers in (q, v, given))
    both = active.without_rounding(*two, np.array([10.0, 1.0]))
    assert both[0][1, 0] == 9.9 * still and both[0][0, 0] == 0.0


@pytest.mark.parametrize(
    ("q", "velocities", "found"),
    [
        ([0, 0, 0, 1, 0, 0, 0], [0, 2], [0, 2]),
        ([0, 0, 0, 1, 0, 0, 0], [5], [3, 6]),
        ([0, 0, 0, 1, 0, 0, 0], [3], [3, 4]),
        ([0, 0, 0, 1, 0, 0, 0], [4], [3, 5]),
        ([0, 0, 0, 0, 1, 0, 0], [5], [4, 5]),
        ([0, 0, 0, 0, 0, 1, 0], [3], [5, 6]),
        ([0, 0, 0, 0, 0, 0, 1], [4], [4, 6]),
        ([0, 0, 0, 0.6, 0.8, 0, 0], [3], [3, 4]),
        ([0, 0, 0, 0.6, 0.8, 0, 0], [5], [3, 4, 5, 6]),
        ([0, 0, 0, 1, 0, 0, 0], [3, 4], [3, 4, 5, 6]),
        ([0, 0, 0, 1, 0, 0, 0] * 2, [1, 7, 11], [1, 8, 10, 13]),
    ],
)
def test_coordinates_that_velocities_change(q, velocities, found):
    """A rotation about axis k mixes the parameters 0 and k, and the two others."""
    changed = active.active_coordinates(np.array(q, dtype=float), np.array(velocities))
    assert changed.tolist() == found


def test_primitives_that_contain_rows():
    """Rows 0 to 2 are of primitive 0; primitives 2 and 3 share row 4."""
    model: Any = SimpleNamespace(structure=SimpleNamespace(row=np.array([0, 3, 4, 4, 5])))
    assert active.primitives_with(model, np.array([1, 3])).tolist() == [0, 1]
    assert active.primitives_with(model, np.array([4])).tolist() == [2, 3]
    assert active.primitives_with(model, np.array([7])).tolist() == [4]
    assert active.primitives_with(model, np.zeros(0, dtype=int)).tolist() == []
