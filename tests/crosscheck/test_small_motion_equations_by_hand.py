"""Equations of small motions of the judge / matrices, differences and steady rates worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE, EXTENDED
from crosscheck.judge.small_motions import equations, equilibria
from crosscheck.judge.small_motions.equations import (
    STEP,
    Balance,
    NotSteady,
    Small,
    _difference,
    in_doubles,
    ordered,
)
from crosscheck.judge.small_motions.turning import REST, Turning
from mbref import rotations
from mbref.scene import Body, Revolute, Scene

Z, O = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


# --- matrices and eigenvalues -----------------------------------------------------------------------------
def test_eigenvalues_of_two_freedoms():
    """2 u'' + 0.8 u' + 10 u = 0 and 3 v'' - 12 v = 0, mixed by no matrix: -0.2 ± i √4.96 and ± 2."""
    small = Small(np.diag([2.0, 3.0]), np.diag([0.8, 0.0]), np.diag([10.0, -12.0]), np.eye(2))
    found = small.eigenvalues()
    wanted = [-2.0, 2.0, -0.2 + 1j * math.sqrt(4.96), -0.2 - 1j * math.sqrt(4.96)]
    assert found == pytest.approx(wanted) and found.dtype == complex
    coupled = Small(np.eye(2), np.array([[0.0, 2.0], [-2.0, 0.0]]), np.zeros((2, 2)), np.eye(2))
    assert coupled.eigenvalues() == pytest.approx([0.0, 0.0, 2j, -2j], abs=1e-7), "Coriolis forces"
    one = Small(np.array([[4.0]]), np.array([[0.0]]), np.array([[9.0]]), np.eye(1))
    assert one.eigenvalues() == pytest.approx([1.5j, -1.5j])


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ([3.0, -1.0, 2.0], [-1.0, 2.0, 3.0]),
        ([-2j, 2j], [2j, -2j]),
        ([2.0, -2.0], [-2.0, 2.0]),
        ([2.0, -2j, 2j, -2.0], [-2.0, 2j, -2j, 2.0]),
        ([1.0 + 1e-11, -1.0], [-1.0, 1.0 + 1e-11]),
        ([-1.0 + 1e-8, 1.0], [-1.0 + 1e-8, 1.0]),
        ([1.0, -1.0 + 1e-7], [-1.0 + 1e-7, 1.0]),
        ([-1.0 - 1e-7, 1.0], [1.0, -1.0 - 1e-7]),
        ([2.0 + 1e-13j, -2.0 - 1e-13j], [-2.0 - 1e-13j, 2.0 + 1e-13j]),
        ([0.0, 0.0], [0.0, 0.0]),
        ([-1.0 - 3e-10, 1.0], [-1.0 - 3e-10, 1.0]),
        ([-1e-3 - 1e-10, 1e-3], [1e-3, -1e-3 - 1e-10]),
        ([1.0 - 3e-13j, 1.0 + 3e-13j], [1.0 - 3e-13j, 1.0 + 3e-13j]),
        ([1.0 - 8e-13j, 1.0 + 8e-13j], [1.0 + 8e-13j, 1.0 - 8e-13j]),
        ([], []),
    ],
)
def test_order_of_eigenvalues(given, wanted):
    """By size to nine digits of the largest one, then by the real part, then the positive imaginary one."""
    assert ordered(np.array(given, dtype=complex)).tolist() == [complex(value) for value in wanted]


BASIS = np.array([[1.0, 0.0], [2.0, 1.0], [0.0, -3.0]])


@pytest.mark.parametrize(("order", "degree"), [(8, 8), (2, 2)])
def test_differences_are_exact_for_polynomials(order, degree):
    """Along a column b, (c · x)^k has the derivative 0 at 0 except for k = 1; sums of two functions."""
    a, b = np.array([0.5, -0.25, 1.0]), np.array([1.0, 0.5, 0.25])

    def function(x: np.ndarray) -> np.ndarray:
        one, two = x @ a, x @ b
        return np.stack(
            [one, 3 * two + sum(two**k for k in range(2, degree + 1)), 7 + 0 * one, one - two**2], axis=1
        )

    found = _difference(function, BASIS, 0.3, order)
    along = np.stack([a @ BASIS, b @ BASIS])
    assert found == pytest.approx(np.array([along[0], 3 * along[1], [0.0, 0.0], along[0]]), abs=1e-12)


def test_differences_of_lower_order_miss_higher_powers():
    """Of x³ a central difference with the step h gives h²."""
    assert _difference(lambda x: x**3, np.ones((1, 1)), 0.25, 2) == pytest.approx(np.array([[0.0625]]))
    assert _difference(lambda x: x**3, np.ones((1, 1)), 0.25, 8) == pytest.approx(np.zeros((1, 1)), abs=1e-15)
    ninth = _difference(lambda x: x**9, np.ones((1, 1)), 1.0, 8)[0, 0]
    parts = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
    assert ninth == pytest.approx(sum(2 * w * k**9 for k, w in parts)) and abs(ninth) > 100


# --- a balance of forces by stand-ins ---------------------------------------------------------------------
class Equations:
    """Three coordinates, of which the second is a length of 2 m, and their rates; two rows, one is kept."""

    nv, length, rank = 3, 2.0, 1
    kept = np.array([1])
    ends = (3, 3, 3)
    tree = SimpleNamespace(turning=np.array([True, False, True]), scalars=3)
    rows = np.array([[9.0, 9.0, 9.0], [3.0, 0.0, 4.0]])

    def __init__(self) -> None:
        self.loads = self
        self.asked: list[Any] = []

    def at(self, t: np.ndarray, y: np.ndarray) -> Any:
        """The rows become larger with the first coordinate."""
        count = len(y)
        assert t.shape == (count,)
        moving = self.rows[None] * (1 + y[:, :1, None])
        coordinates = SimpleNamespace(y=y, jacobian=np.tile(np.diag([1.0, 2.0, 3.0]), (count, 1, 1)))
        return SimpleNamespace(
            rows=SimpleNamespace(jacobian=moving), placed="placed", coordinates=coordinates, rate=y[:, 3:]
        )

    def terms(self, placed: Any, coordinates: Any, rate: np.ndarray, t: np.ndarray, since: float) -> Any:
        """Forces: polynomials of coordinates and rates."""
        assert placed == "placed" and len(t) == len(rate) and since == 0.0
        q = coordinates.y[:, :3]
        first = 6.0 - 2.0 * q[:, 0] - 0.5 * rate[:, 1]
        second = q[:, 1] ** 3 / 3 - 4.0 * rate[:, 1] - rate[:, 0] ** 3
        return None, np.stack([first, second, 8.0 + q[:, 0] * q[:, 2]], axis=1)

    def mass_matrix(self, placed: Any, coordinates: Any) -> np.ndarray:
        return np.diag([5.0, 6.0, 7.0])[None]

    def _moved(self, states: np.ndarray, step: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        assert jacobian.shape == (len(step), 3, 3) and (jacobian == np.diag([1.0, 2.0, 3.0])).all()
        found = states.copy()
        found[:, :3] += step
        found[:, 3:] = np.nan
        return found


def balance(**parts: Any) -> Any:
    made: Any = object.__new__(Balance)
    made.scene, made.motion, made.arithmetic, made.now = None, REST, DOUBLE, np.zeros(1)
    made.equations = Equations()
    made.__dict__.update(parts)
    return made


Y = np.array([0.0, 3.0, 0.5, 0.1, 0.2, 0.3])


def test_sizes_rows_and_forces_of_a_balance():
    made = balance()
    assert made.sizes.tolist() == [1.0, 2.0, 1.0]
    at = made.at(np.stack([Y, Y + 1]))
    assert made.rows(at).tolist() == [[[3.0, 0.0, 4.0]], [[6.0, 0.0, 8.0]]]
    assert made.forces(at)[0] == pytest.approx([6.0 - 0.1, 9.0 - 0.801, 8.0])


def test_unit_displacements_that_rows_allow(monkeypatch):
    """Along the length of 2 m, and along (4, 0, -3) / 5; forces and multipliers by hand."""
    made = balance()
    basis = made.basis(made.at(Y[None]))
    assert basis.shape == (3, 2) and np.array([3.0, 0.0, 4.0]) @ basis == pytest.approx([0.0, 0.0], abs=1e-15)
    scaled = basis / np.array([[1.0], [2.0], [1.0]])
    assert scaled.T @ scaled == pytest.approx(np.eye(2))
    projected = scaled @ scaled.T
    assert projected == pytest.approx(np.eye(3) - np.outer([0.6, 0.0, 0.8], [0.6, 0.0, 0.8]))
    force = np.array([5.9, 8.199, 8.0])
    assert made.unbalanced(Y) == pytest.approx(basis.T @ force)
    assert made.multipliers(made.at(Y[None])) == pytest.approx([-(3 * 5.9 + 4 * 8.0) / 25])
    asked: list[np.ndarray] = []
    monkeypatch.setattr(np.linalg, "lstsq", lambda a, b, rcond: (asked.append(b) or np.ones(1),))
    assert made.multipliers(made.at(Y[None])).tolist() == [3.0]
    assert asked == [pytest.approx(-force - k * np.array([3.0, 0.0, 4.0])) for k in range(3)]


@pytest.mark.parametrize("size", [1.0, 1e-9])
def test_rows_of_any_size_allow_unit_displacements(size):
    """To the digits of long doubles, which are more than those of the decomposition."""
    rows = np.array([[1.0, 1.1, 1.2], [0.7 * size, -2.0 * size, 0.5 * size]])
    made = balance(arithmetic=EXTENDED)
    found = made.basis(
        SimpleNamespace(rows=SimpleNamespace(jacobian=EXTENDED.array(np.stack([rows[::-1]] * 2)[:1])))
    )
    assert found.shape == (3, 2), "of the row that is kept alone"
    made.equations.kept = np.array([1, 0])
    found = made.basis(SimpleNamespace(rows=SimpleNamespace(jacobian=EXTENDED.array(rows[None]))))
    assert found.shape == (3, 1)
    assert np.linalg.norm(found.astype(float)[:, 0] / [1.0, 2.0, 1.0]) == pytest.approx(1.0)
    apart = np.abs(EXTENDED.array(rows) @ found)[:, 0] / [1.0, size]
    assert apart.max() < 1e-18


def test_conditioning_of_independent_rows():
    """Rows of unit length in units of lengths: (0.6, 0, 0.8) and (0, 1, 0) are as good as can be."""
    assert balance().conditioning(Y) == 1.0
    made = balance()
    made.equations.rows = np.array([[1.0, 1.0, 0.0], [5.0, 0.0, 0.0]])
    made.equations.kept = np.array([0, 1])
    cosine = 1 / math.sqrt(5)
    assert made.conditioning(Y) == pytest.approx(math.sqrt((1 - cosine) / (1 + cosine)))
    made.equations.kept = np.zeros(0, dtype=int)
    assert made.conditioning(Y) == 1.0


def test_stiffness_and_damping_are_slopes_of_forces():
    """-∂(Q + Gᵀ λ)/∂q: the row grows with q₀ by (3, 0, 4) λ; rates stay."""
    made = balance()
    basis = np.array([[1.0, 0.0], [0.5, 1.0], [0.0, 2.0]])
    multiplier = -(3 * 5.9 + 4 * 8.0) / 25
    slope = np.array([[-2.0 + 3 * multiplier, 0.0, 0.0], [0.0, 9.0, 0.0], [0.5 + 4 * multiplier, 0.0, 0.0]])
    assert made.stiffness(Y, basis, 0.1) == pytest.approx(-slope @ basis)
    coarse = -slope @ basis - np.outer([0.0, 1.0, 0.0], 0.1**2 * basis[1] ** 3 / 3)
    assert made.stiffness(Y, basis, 0.1, order=2) == pytest.approx(coarse)
    damping = np.array([[0.0, 0.5, 0.0], [0.03, 4.0, 0.0], [0.0, 0.0, 0.0]])
    assert made.damping(Y, basis, 0.1) == pytest.approx(damping @ basis)
    moved = made.moved(Y, np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 1.0]]))
    assert moved.tolist() == [[1.0, 5.0, 3.5, 0.1, 0.2, 0.3], [0.0, 3.0, 1.5, 0.1, 0.2, 0.3]]


def test_matrices_of_small_motions(monkeypatch):
    made = balance()
    steps: list[Any] = []
    for name in ("stiffness", "damping"):
        own = getattr(made, name)
        monkeypatch.setattr(
            made,
            name,
            lambda y, basis, h, own=own, name=name: steps.append((name, h)) or own(y, basis, h),
            raising=False,
        )
    small = made.small(Y)
    basis = made.basis(made.at(Y[None]))
    assert small.basis == pytest.approx(basis) and small.mass == pytest.approx(
        basis.T @ np.diag([5.0, 6.0, 7.0]) @ basis
    )
    assert small.stiffness == pytest.approx(basis.T @ Balance.stiffness(made, Y, basis, 0.02))
    assert small.damping == pytest.approx(basis.T @ Balance.damping(made, Y, basis, 0.02))
    made.small(Y, 0.5)
    assert steps == [("damping", 0.02), ("stiffness", 0.02), ("damping", 0.5), ("stiffness", 0.5)]
    assert STEP == 0.02


# --- closed loops and steady rates ------------------------------------------------------------------------
@pytest.mark.parametrize(("count", "is_closed"), [(1, True), (6, True), (7, False)])
def test_loops_are_closed_by_six_attempts_at_most(count, is_closed):
    """Each attempt adds one; the gap is small after some attempts."""
    made = balance()
    made.equations.closed = lambda t, y: y + 1
    made.equations.gap = lambda t, y: 1e-12 if y[0] < count else 0.9e-12
    if is_closed:
        assert made.closed(np.zeros(2)).tolist() == [count] * 2
    else:
        with pytest.raises(NotSteady, match="the loops do not close"):
            made.closed(np.zeros(2))
    made.equations.closed = lambda t, y: y * [np.nan, 1.0]
    made.equations.gap = lambda t, y: 0.0
    with pytest.raises(NotSteady, match="the loops do not close"):
        made.closed(np.zeros(2))


def turning(columns: Any, spin: tuple[float, ...] = (0.0, 0.0, 2.0)) -> Any:
    """A balance of bodies at (3, 0, 0) and (0, 2, 0), and the ground, that turns by its joint rates."""
    placed = SimpleNamespace(
        position=np.array([[[3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0] * 3]]), columns=np.array(columns)[None]
    )
    return balance(motion=Turning(np.array(spin), np.zeros(3)), at=lambda y: SimpleNamespace(placed=placed))


def test_joint_rates_of_a_steady_rotation(monkeypatch):
    """Twists (velocity, spin) of both bodies for unit rates: about z, along x, and about x."""
    columns = [
        [[0.0, 3.0, 0.0, 0.0, 0.0, 1.0], [1.0, 0, 0, 0, 0, 0], [0, 0, 0, 1.0, 0, 0]],
        [[-2.0, 0.0, 0.0, 0.0, 0.0, 1.0], [1.0, 0, 0, 0, 0, 0], [0, 0, 0, 1.0, 0, 0]],
        [[0.0] * 6] * 3,
    ]
    made = turning(columns)
    found = made.steady(Y)
    assert found == pytest.approx([0.0, 3.0, 0.5, 2.0, 0.0, 0.0]) and Y[3] == 0.1, "the given state stays"
    assert balance().steady(Y).tolist() == [0.0, 3.0, 0.5, 0.0, 0.0, 0.0], "at rest"
    with monkeypatch.context() as patch:
        asked: list[bool] = []
        exact = lambda a, b, rcond: (2 * np.eye(3)[0] * (asked.append(b.any()) or b.any()),)  # noqa: E731
        patch.setattr(equations, "TURNS_AS_A_WHOLE", 0.0)
        patch.setattr(np.linalg, "lstsq", exact)
        assert made.steady(Y)[3] == 2.0 and asked == [True, False, False], "two refinements"
    columns[0][0] = [0.0, 3.0 * (1 + 4e-9), 0.0, 0.0, 0.0, 1.0]
    with pytest.raises(NotSteady, match="the joints do not let the mechanism turn as a whole"):
        turning(columns).steady(Y)
    columns[0][0] = [0.0, 3.0 * (1 + 1e-10), 0.0, 0.0, 0.0, 1.0]
    assert turning(columns).steady(Y)[3] == pytest.approx(2.0)


def test_a_balance_of_a_scene_and_in_doubles():
    """A bar on a hinge at 2 m below, whose given orientation is turned: poses are those of the scene."""
    turn = (0.8, 0.0, 0.6, 0.0)
    bar = Body(name="b", mass=2.0, inertia=(0.3, 0.4, 0.5), position=(0.0, -2.0, 1.0), orientation=turn)
    hinge = Revolute(name="A", bodies=("ground", "b"), anchor=O, axis=Z)
    scene = Scene(name="s", body=(bar,), joint=(hinge,), gravity=(0.0, -9.0, 0.0))
    made = Balance(scene)
    assert (made.motion, made.arithmetic) == (REST, EXTENDED) and made.now.tolist() == [0.0]
    start = made.start()
    position, orientation = made.poses(start)
    assert position == pytest.approx(np.array([[0.0, -2.0, 1.0]])) and orientation == pytest.approx(
        np.array([turn])
    )
    swung = made.moved(start, EXTENDED.array([[math.pi / 2]]))[0]
    position, orientation = made.poses(swung)
    assert position == pytest.approx(np.array([[2.0, 0.0, 1.0]]), abs=1e-15)
    quarter = rotations.multiply(rotations.from_vector(np.array([0.0, 0.0, math.pi / 2])), np.array(turn))
    assert abs(orientation[0] @ quarter) == pytest.approx(1.0)
    small = made.small(start)
    own = 0.3 * 0.96**2 + 0.5 * 0.28**2
    assert small.mass == pytest.approx(np.array([[8.0 + own]])) and small.stiffness == pytest.approx(
        np.array([[36.0]])
    )
    other = bar.model_copy(
        update={"name": "c", "position": (5.0, 1.0, 2.0), "orientation": (0.0, 0.6, 0.8, 0.0)}
    )
    more = hinge.model_copy(update={"name": "B", "bodies": ("b", "c")})
    both = Balance(scene.with_(body=(bar, other), joint=(hinge, more)))
    position, orientation = both.poses(both.start())
    assert position == pytest.approx(np.array([[0.0, -2.0, 1.0], [5.0, 1.0, 2.0]]))
    assert orientation == pytest.approx(np.array([turn, (0.0, 0.6, 0.8, 0.0)]))
    quick = in_doubles(made)
    assert quick.arithmetic is DOUBLE and quick.scene is scene and quick.motion is REST
    assert quick.equations.kept is made.equations.kept and quick.equations.rank == made.equations.rank


# --- motions that stay ------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("part", "change", "stays"),
    [
        ("mass", 0.9e-8 * 4, True),
        ("mass", 1.1e-8 * 4, False),
        ("damping", 0.9e-8 * 8, True),
        ("damping", 1.1e-8 * 8, False),
        ("stiffness", 0.9e-8 * 40, True),
        ("stiffness", 1.1e-8 * 40, False),
        ("force", 0.9e-8 * 16, True),
        ("force", 1.1e-8 * 16, False),
    ],
)
def test_a_motion_is_steady_if_a_rotation_changes_nothing(part, change, stays):
    """4 kg at 2 rad/s: masses over 4, damping over 8, stiffnesses over the largest, forces over 16."""
    values = {"mass": np.diag([1.0, 4.0]), "damping": np.zeros((2, 2)), "stiffness": np.diag([40.0, 1.0])}
    before = Small(values["mass"].copy(), values["damping"].copy(), values["stiffness"].copy(), np.eye(2))
    force = np.zeros(2)
    if part == "force":
        force[0] = -change
    else:
        values[part][0, 1] -= change
    seen: list[Any] = []
    made = SimpleNamespace(
        motion=SimpleNamespace(rate=2.0),
        arithmetic=DOUBLE,
        equations=SimpleNamespace(
            tree=SimpleNamespace(scalars=1),
            ends=(1, 2, 2),
            loads=SimpleNamespace(mass_matrix=lambda placed, coordinates: values["mass"][None]),
        ),
        at=lambda y: seen.append(y[0].tolist()) or SimpleNamespace(placed=0, coordinates=0),
        damping=lambda y, basis, h: values["damping"] if (len(y), len(basis), h) == (4, 2, STEP) else None,
        stiffness=lambda y, basis, h: (
            values["stiffness"] if (len(y), len(basis), h) == (4, 2, STEP) else None
        ),
        forces=lambda at: force[None],
    )
    y = np.array([0.5, 7.0, 2.0, 9.0])
    assert equilibria._stays(made, y, before) is stays
    assert seen == [[1.5, 7.0, 2.0, 9.0]] and y[0] == 0.5, "by one radian: half a second at 2 rad/s"


@pytest.mark.parametrize(("change", "stays"), [(0.9e-8 * 16, True), (1.1e-8 * 16, False)])
def test_small_stiffnesses_count_relative_to_the_rotation(change, stays):
    """A stiffness of 1 is less than 4 kg times (2 rad/s)²."""
    before = Small(np.diag([1.0, 4.0]), np.zeros((2, 2)), np.eye(2), np.eye(2))
    made = SimpleNamespace(
        motion=SimpleNamespace(rate=2.0),
        arithmetic=DOUBLE,
        equations=SimpleNamespace(
            tree=SimpleNamespace(scalars=1),
            ends=(1, 2, 2),
            loads=SimpleNamespace(mass_matrix=lambda placed, coordinates: np.diag([1.0, 4.0])[None]),
        ),
        at=lambda y: SimpleNamespace(placed=0, coordinates=0),
        damping=lambda y, basis, h: np.zeros((2, 2)),
        stiffness=lambda y, basis, h: np.eye(2) + np.array([[0.0, change], [0.0, 0.0]]),
        forces=lambda at: np.zeros((1, 2)),
    )
    assert equilibria._stays(made, np.array([0.5, 7.0, 2.0]), before) is stays


def test_the_weights_of_differences():
    assert equations.CENTRAL == ((1, 0.8), (2, -0.2), (3, 4 / 105), (4, -1 / 280))
